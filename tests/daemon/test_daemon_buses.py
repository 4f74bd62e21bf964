"""The daemon and its buses: one that fails, one of another device, and the last frames on it."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.daemon import daemon as module
from canshaper.daemon.daemon import Daemon
from canshaper.daemon.ports import seen_sent
from canshaper.errors import BusError, WrongBusError
from canshaper.machine.binding import load_deployment
from tests.daemon.bench import BUS, Bench, FakePort, at
from tests.daemon.diary import Diary


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
    BusState.UNFIT,
]
ON = [BusState.UP, BusState.UNCONFIRMED, BusState.PASSIVE, BusState.FAILED]


def test_we_are_on_a_bus_or_not_whatever_its_state() -> None:
    """A state that is new has to be put to one of them."""
    assert {*OFF, *ON} == {*BusState}


@pytest.mark.parametrize("state", OFF + ON)
def test_the_controller_knows_of_a_bus_that_we_are_not_on(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, state: BusState
) -> None:
    off: list[str] = []
    monkeypatch.setattr(module.Controller, "on_bus_off", lambda _, bus: off.append(bus))
    at(bench, {5: lambda: setattr(bench.ports[0], "state", state)}, last=6)
    assert set(off) == ({"crane"} if state in OFF else set())


def test_a_fault_of_a_bus_is_counted(bench: Bench, log: Callable[[], list[str]]) -> None:
    at(bench, {5: lambda: bench.faults[0](FrameFault.ERROR_FRAME)})
    assert any("fault=ERROR_FRAME" in line and "'ErrorFrames': 1" in line for line in log())


def test_who_only_listens_says_so(bench: Bench, diary: Diary, log: Callable[[], list[str]]) -> None:
    bench.script = lambda number: bench.stop() if number == 3 else None
    Daemon(lambda: replace(load_deployment(bench.file), listen_only=True)).run()
    lines, (status,) = log(), diary.statuses()
    assert status[1].startswith("listen-only, slew ")
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
        "ERROR neutral=not-sent bus=crane id=0x201",
        "INFO stopped valves=not-sent",
    ]
    last = [frame.can_id for frame in tries[-10:]]
    assert last == [0x201] * 10  # the others only once


@pytest.mark.parametrize(
    ("confirmed", "said"), [(True, "neutral"), (False, "not-confirmed"), (None, "sent")]
)
def test_the_last_words_are_what_is_known_of_the_last_frames(
    bench: Bench,
    monkeypatch: pytest.MonkeyPatch,
    log: Callable[[], list[str]],
    confirmed: bool | None,
    said: str,
) -> None:
    monkeypatch.setattr(FakePort, "confirmed", confirmed)
    at(bench, {})
    assert any(f"started file={bench.file}" in one and f"valves={said}" in one for one in log())
    assert log()[-1] == f"INFO stopped valves={said}"


def test_what_comes_while_the_last_frames_are_waited_for_is_received() -> None:
    class Confirming(FakePort):
        def __init__(self) -> None:
            self.frames_left = [Frame("crane", 0x201, False, b""), None, None]

        @property
        def confirmed(self) -> bool:  # type: ignore[override]
            return not self.frames_left

        def background(self) -> Iterator[Frame]:
            if (frame := self.frames_left.pop(0)) is not None:
                yield frame

    received: list[Frame] = []
    assert seen_sent([Confirming()], received.append) == "neutral"
    assert [frame.can_id for frame in received] == [0x201]


def test_a_bus_that_changes_all_the_time_does_not_flood_the_log(
    bench: Bench, log: Callable[[], list[str]]
) -> None:
    def becomes(state: BusState) -> Callable[[], None]:
        return lambda: setattr(bench.ports[0], "state", state)

    states = [BusState.FAILED, BusState.UP]
    at(bench, {tick: becomes(states[tick % 2]) for tick in range(1, 101)}, last=200)
    lines = [line for line in log() if "bus=" in line]
    assert len(lines) <= 4 * 3
    assert lines[-1] == "WARNING bus=crane state=failed"  # the one that it has


def test_what_a_port_says_of_its_interface_and_why_is_logged(
    bench: Bench, log: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def unfit() -> None:
        bench.ports[0].state, bench.ports[0].why = BusState.UNFIT, "no MTU"

    monkeypatch.setattr(FakePort, "look", lambda _: "interface=parked")
    at(bench, {5: unfit})
    assert "WARNING bus=crane interface=parked" in log()
    assert "WARNING bus=crane state=unfit why=no MTU" in log()


def test_a_service_waits_for_its_bus(
    bench: Bench, log: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a service manager it ends, with one it says so once and tries again."""
    opened, tries, said = bench._open, [], []

    def late(*arguments: Any) -> Any:
        tries.append(arguments)
        if len(tries) % 4:
            raise BusError("bus crane: cannot open")
        return opened(*arguments)

    monkeypatch.setattr("canshaper.daemon.ports.open_port", late)
    with pytest.raises(BusError, match="cannot open"):
        Daemon(lambda: load_deployment(bench.file))
    monkeypatch.setattr(module.ServiceManager, "present", True)
    monkeypatch.setattr(module.ServiceManager, "waiting", lambda _, text: said.append(text))
    monkeypatch.setattr(bench, "sleep", lambda _: None)
    Daemon(lambda: load_deployment(bench.file))
    assert said == ["waiting: bus crane: cannot open"] * 2
    assert log() == ["ERROR waiting for a bus: bus crane: cannot open"]


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


# -- a bus that is another device ------------------------------------------------------------------


def test_a_bus_of_another_device_is_a_problem_of_its_line_in_the_file(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.text = bench.text.replace(
        BUS, "crane:\n    interface: socketcan\n    channel: vcan0\n    match: { serial: '1' }"
    )
    bench.file.write_text(bench.text, encoding="utf-8")

    def wrong(*_: object) -> None:
        raise WrongBusError("crane", "expected serial number 1, got 2")

    monkeypatch.setattr("canshaper.daemon.ports.open_port", wrong)
    with pytest.raises(BusError) as error:
        Daemon(lambda: load_deployment(bench.file))
    lines = bench.text.splitlines()
    number = 1 + next(i for i, line in enumerate(lines) if "match:" in line)
    assert str(error.value).startswith(f"{bench.file}:{number}: buses.crane.match:")
    assert str(error.value).endswith("expected serial number 1, got 2")
