"""A reload sets nothing going, and does not take ourselves for another sender."""

import logging

import pytest

from canshaper.codec.frame import Frame
from canshaper.daemon import daemon as module
from canshaper.daemon import ports as service_ports
from canshaper.errors import BusError
from tests.daemon.bench import BUS, FOREIGN, SECOND, Bench, at
from tests.rigs.forwarder import TICK_NS


def test_frames_that_queued_while_a_reload_was_refused_move_nothing(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    """The joystick went out meanwhile, and its joystick died."""

    def opening(channel: str) -> None:
        if channel == "vcan1":
            for joystick in [0] * 50 + [1000] * 50:
                bench.joysticks(Slew=joystick)
                bench.now_ns += TICK_NS
            bench.now_ns += 10**9
            raise BusError("bus two: cannot open: no such adapter")

    def script(tick: int) -> None:
        if tick < 10:
            bench.joysticks()
        if tick == 9:
            assert bench.reported() == ("READY", "JOYSTICK_NEUTRAL")
            bench.reload(BUS, SECOND)
        if tick == 100:
            bench.stop()

    bench.opening = opening
    bench.run(script)
    assert "reload=refused bus two: cannot open: no such adapter" in caplog.messages
    assert not bench.moved()
    assert bench.reported() == ("NEUTRAL_WAIT", "JOYSTICK_TIMEOUT")


def test_nor_do_those_of_a_reload_that_was_applied(bench: Bench) -> None:
    """On a bus that stays open: what it says is old, and the next frame has the joystick out."""
    since: list[int] = []

    def opening(channel: str) -> None:
        if channel == "vcan1":
            for _ in range(50):
                bench.joysticks()
                bench.now_ns += TICK_NS

    def script(tick: int) -> None:
        if len(bench.ports) < 2:
            bench.joysticks()
        elif since:
            bench.joysticks(Slew=1000)
        else:
            since.append(tick)
        if tick == 9:
            bench.reload(BUS, SECOND)
        if tick == 100:
            bench.stop()

    bench.opening = opening
    bench.run(script)
    assert [port.channel for port in bench.ports] == ["vcan0", "vcan1"]
    assert not bench.moved()
    assert bench.reported() == ("NEUTRAL_WAIT", "JOYSTICK_NOT_NEUTRAL")


def test_a_bus_that_changes_does_not_take_us_for_a_second_sender(bench: Bench) -> None:
    """What was sent from the old port comes to the new one, some of it after it was opened."""
    at(bench, {9: lambda: bench.reload("bitrate: 250000", "bitrate: 500000")}, last=100)
    assert [(port.channel, port.closed) for port in bench.ports] == [("vcan0", True)] * 2
    assert bench.reported() == ("READY", "JOYSTICK_NEUTRAL")


def test_a_second_sender_is_seen_after_it_too(bench: Bench) -> None:
    def script(tick: int) -> None:
        bench.joysticks()
        bench.put(FOREIGN)
        if tick == 9:
            bench.reload("bitrate: 250000", "bitrate: 500000")
        if tick == 30:
            bench.stop()

    bench.run(script)
    assert len(bench.ports) == 2
    assert bench.reported() == ("TRIPPED", "SECOND_SENDER")


@pytest.mark.parametrize("late", [False, True])
def test_what_waits_on_a_bus_that_is_opened_again_is_read(
    bench: Bench, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, late: bool
) -> None:
    """An emergency message comes once: before the old port closes, or while the new one is new."""
    caplog.set_level(logging.INFO, "canshaper")
    bench.become("canopen-forwarder")
    emergency = Frame("crane", 0xA0, False, bytes.fromhex("0380810000000000"))
    sleep = bench.sleep

    def opening(_channel: str) -> None:
        if not late:
            bench.put(emergency)

    def sleeping(seconds: float) -> None:
        sleep(seconds)
        if late and seconds == service_ports.ON_THE_BUS_S:
            bench.put(emergency)

    def script(tick: int) -> None:
        if tick == 9:
            bench.opening = opening
            bench.reload("bitrate: 250000", "bitrate: 500000")
        if tick == 30:
            bench.stop()

    monkeypatch.setattr(bench, "sleep", sleeping)
    bench.run(script)
    assert len(bench.ports) == 2
    (line,) = [text for text in caplog.messages if "emergency=0x8003" in text]
    assert line == "bus=crane node=slew state=lost emergency=0x8003"


def test_the_program_is_read_before_a_bus_is_open(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What waits in the sockets grows old while it is read."""
    order: list[str] = []
    monkeypatch.setattr(module, "program_sha256", lambda: order.append("program"))
    bench.opening = lambda channel: order.append("bus")
    bench.run(lambda number: bench.stop())
    assert order == ["program", "bus"]
