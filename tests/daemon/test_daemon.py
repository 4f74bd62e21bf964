"""The daemon around its loop: buses that fail, the last frames, reads of its file, its end."""

import signal
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.daemon import daemon as module
from canshaper.daemon import reloads
from canshaper.daemon.daemon import Daemon
from canshaper.errors import BusError, WrongBusError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.daemon.test_reload import BUS, Bench, FakePort, Read


def at(bench: Bench, acts: dict[int, Callable[[], Any]], last: int = 20) -> None:
    """Run, and do something before these ticks."""

    def script(number: int) -> None:
        bench.joysticks()
        if number in acts:
            acts[number]()
        if number == last:
            bench.stop()

    bench.run(script)


def test_the_state_of_a_bus_is_logged_when_it_changes(
    bench: Bench, log: Callable[[], list[str]]
) -> None:
    def becomes(state: BusState) -> Callable[[], None]:
        return lambda: setattr(bench.ports[0], "state", state)

    at(bench, {5: becomes(BusState.DOWN), 10: becomes(BusState.UP)})
    assert [line for line in log() if "bus=" in line] == [
        "WARNING bus=crane state=down",
        "INFO bus=crane state=up",
    ]


# No one receives us there, or we no one; and where a bus only has trouble.
OFF = [
    BusState.BUS_OFF,
    BusState.NOT_CONFIRMED,
    BusState.DOWN,
    BusState.GONE,
    BusState.WRONG_DEVICE,
]
ON = [BusState.UP, BusState.PASSIVE, BusState.FAILED]


def test_we_are_on_a_bus_or_not_whatever_its_state() -> None:
    """A state that is new has to be put to one of them."""
    assert {*OFF, *ON} == {*BusState}


@pytest.mark.parametrize("state", OFF)
def test_of_a_bus_that_we_are_not_on_the_controller_knows(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, state: BusState
) -> None:
    off: list[str] = []
    monkeypatch.setattr(module.Controller, "on_bus_off", lambda _, bus: off.append(bus))
    at(bench, {5: lambda: setattr(bench.ports[0], "state", state)}, last=6)
    assert set(off) == {"crane"}


@pytest.mark.parametrize("state", ON)
def test_a_bus_that_only_has_trouble_is_one_that_we_are_on(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, state: BusState
) -> None:
    off: list[str] = []
    monkeypatch.setattr(module.Controller, "on_bus_off", lambda _, bus: off.append(bus))
    at(bench, {5: lambda: setattr(bench.ports[0], "state", state)}, last=6)
    assert off == []


def test_a_fault_of_a_bus_is_counted(bench: Bench, log: Callable[[], list[str]]) -> None:
    faults: list[Callable[[FrameFault], None]] = []
    opened = bench._open

    def opens(name: str, bus: Any, fault: Callable[[FrameFault], None], ids: Any) -> Any:
        faults.append(fault)
        return opened(name, bus, fault, ids)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("canshaper.daemon.ports.open_port", opens)
        at(bench, {5: lambda: faults[0](FrameFault.ERROR_FRAME)})
    assert any("fault=ERROR_FRAME" in line and "'ErrorFrames': 1" in line for line in log())


def test_who_only_listens_says_so(bench: Bench, log: Callable[[], list[str]]) -> None:
    bench.script = lambda number: bench.stop() if number == 3 else None
    Daemon(lambda: replace(load_deployment(bench.file), listen_only=True)).run()
    lines = log()
    assert "WARNING listen-only=yes valves=none: nothing is sent but status" in lines
    assert lines[-1] == "INFO stopped valves=not-sent"
    assert not any(frame.can_id in range(0x200, 0x203) for frame in bench.sent)


# -- the last frames -------------------------------------------------------------------------------


def test_neutral_that_is_not_sent_is_tried_again_and_then_reported(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, log: Callable[[], list[str]]
) -> None:
    tries: list[Frame] = []

    def full(_port: FakePort, frame: Frame) -> bool:
        tries.append(frame)
        return frame.can_id != 0x201

    at(bench, {20: lambda: monkeypatch.setattr(FakePort, "send", full)})
    assert [line for line in log() if "not-sent" in line] == [
        "ERROR neutral=not-sent bus=crane id=0x201"
    ]
    last = [frame.can_id for frame in tries[-10:]]
    assert last == [0x201] * 10  # the others only once
    assert log()[-1] == "INFO stopped valves=neutral"


def test_neutral_is_sent_as_soon_as_the_queue_has_room(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, log: Callable[[], list[str]]
) -> None:
    full_until_ns: list[int] = []
    send = FakePort.send

    def full(port: FakePort, frame: Frame) -> bool:
        full_until_ns[:] = full_until_ns or [bench.now_ns + 50_000_000]
        return bench.now_ns >= full_until_ns[0] and send(port, frame)

    at(bench, {20: lambda: monkeypatch.setattr(FakePort, "send", full)})
    assert not [line for line in log() if "not-sent" in line]
    assert [f.can_id for f in bench.sent[-3:]] == [0x200, 0x201, 0x202]


# -- reading the file again ------------------------------------------------------------------------


class Slow(Read):
    """One that takes its time."""

    all: list["Slow"] = []  # noqa: RUF012

    def __init__(self, load: Callable[[], Deployment]) -> None:
        super().__init__(load)
        self.ended = False
        Slow.all.append(self)

    def result(self) -> Deployment | None:  # type: ignore[override]
        return None

    def end(self) -> None:
        self.ended = True


def test_a_read_that_is_overtaken_is_ended_and_so_is_the_last_one(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    Slow.all.clear()
    monkeypatch.setattr(reloads, "ConfigReload", Slow)
    at(bench, {5: bench.reload, 10: bench.reload})
    assert [one.ended for one in Slow.all] == [True, True]


def test_without_a_process_to_read_in_a_reload_is_refused(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, log: Callable[[], list[str]]
) -> None:
    def none(_load: object) -> None:
        raise BlockingIOError(11, "no more processes")

    monkeypatch.setattr(reloads, "ConfigReload", none)
    at(bench, {5: bench.reload})
    assert [line for line in log() if "reload=" in line] == [
        "ERROR reload=refused cannot read: no more processes"
    ]


def test_what_cannot_be_read_is_refused_line_by_line(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, log: Callable[[], list[str]]
) -> None:
    class Broken(Slow):
        def result(self) -> str:  # type: ignore[override]
            return "machine.yaml:1: one\nmachine.yaml:2: two"

    monkeypatch.setattr(reloads, "ConfigReload", Broken)
    at(bench, {5: bench.reload})
    assert [line for line in log() if "reload=" in line] == [
        "ERROR reload=refused machine.yaml:1: one",
        "ERROR reload=refused machine.yaml:2: two",
    ]


def test_a_reload_in_motion_waits_and_the_log_says_so_once(
    bench: Bench, log: Callable[[], list[str]]
) -> None:
    def script(number: int) -> None:
        bench.joysticks(Slew=1000 if 5 <= number < 20 else 0)
        if number == 10:
            bench.reload()
        if number == 200:
            bench.stop()

    bench.run(script)
    lines = [line for line in log() if "reload=" in line]
    assert lines[0] == "INFO reload=waiting until every axis is neutral"
    assert [line.split()[1] for line in lines[1:]] == ["reload=applied"]


def test_signals_are_those_of_a_service(bench: Bench) -> None:
    at(bench, {})
    assert {signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGCHLD} == bench._handlers.keys()
    assert bench._handlers[signal.SIGCHLD] == signal.SIG_DFL


def test_the_digest_that_does_not_go_out_is_counted(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    status = load_deployment(bench.file).identity_status
    assert status is not None
    failed: list[Frame] = []
    monkeypatch.setattr(module.Controller, "send_failed", lambda _, frame: failed.append(frame))
    send = FakePort.send
    monkeypatch.setattr(
        FakePort, "send", lambda port, f: f[:3] != status.sender.key and send(port, f)
    )
    at(bench, {}, last=60)
    assert [frame[:3] for frame in failed] == [status.sender.key] * 2


def test_the_digest_is_not_sent_from_an_address_that_is_not_ours(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    status = load_deployment(bench.file).identity_status
    assert status is not None
    silent = property(lambda _: frozenset({"crane"}))
    monkeypatch.setattr(module.Controller, "silent_buses", silent)
    at(bench, {}, last=60)
    assert not [frame for frame in bench.sent if frame[:3] == status.sender.key]


# -- a bus that is another device ------------------------------------------------------------------


def test_a_bus_of_another_device_is_a_problem_of_its_line_in_the_file(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.text = bench.text.replace(
        BUS, "crane:\n    interface: socketcan\n    channel: vcan0\n    match: { serial: '1' }"
    )
    bench.file.write_text(bench.text, encoding="utf-8")

    def wrong(*_: object) -> None:
        raise WrongBusError("crane", "expected serial number 1, found 2")

    monkeypatch.setattr("canshaper.daemon.ports.open_port", wrong)
    with pytest.raises(BusError) as error:
        Daemon(lambda: load_deployment(bench.file))
    lines = bench.text.splitlines()
    number = 1 + next(i for i, line in enumerate(lines) if "match:" in line)
    assert str(error.value).startswith(f"{bench.file}:{number}: buses.crane.match:")
    assert str(error.value).endswith("expected serial number 1, found 2")


class Left(Exception):
    """In place of the end of the process."""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_second_signal_to_stop_leaves_at_once_with_neutral_valves(
    bench: Bench,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    log: Callable[[], list[str]],
    number: int,
) -> None:
    codes: list[int] = []
    sent: set[int] = set()  # by then: the end of the loop sends neutral as well
    flushed: list[int] = []
    monkeypatch.setattr(caplog.handler, "flush", lambda: flushed.append(1))

    def leave(code: int) -> None:
        assert len(flushed) == 2  # after that of the last line itself
        codes.append(code)
        sent.update(frame.can_id for frame in bench.sent)
        raise Left

    monkeypatch.setattr(module.os, "_exit", leave)

    def script(tick: int) -> None:
        bench.joysticks()
        if tick == 5:
            bench.sent.clear()
            flushed.clear()
            for _ in range(2):
                bench._handlers[number](number, None)

    with pytest.raises(Left):
        bench.run(script)
    valves = {frame.can_id for frame in bench.rig.controller.neutral_frames()}
    assert sent >= valves
    assert codes == [128 + number]
    assert f"WARNING stopped at-once signal={signal.Signals(number).name}" in log()


def test_a_trip_is_a_warning_and_other_states_are_not(
    bench: Bench, log: Callable[[], list[str]]
) -> None:
    foreign = Frame("crane", 0x200, False, b"\0\0")
    at(bench, {10: lambda: bench.put(foreign)})
    states = [line for line in log() if "axis=slew state=" in line]
    assert states[0].startswith("INFO axis=slew state=READY")
    assert states[1].startswith("WARNING axis=slew state=TRIPPED")
