"""The daemon around its loop: reads of its file, its digest, its end."""

import signal
from collections.abc import Callable

import pytest

from canshaper.codec.frame import Frame
from canshaper.daemon import daemon as module
from canshaper.daemon import reloads
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.daemon.bench import Bench, FakePort, Read, at


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
        if number == 15:
            assert lines() == ["INFO reload=waiting until every axis is neutral"]
        if number == 200:
            bench.stop()

    def lines() -> list[str]:
        return [line for line in log() if "reload=" in line]

    bench.run(script)
    assert [line.split()[1] for line in lines()] == ["reload=waiting", "reload=applied"]


def test_a_motion_that_begins_while_the_file_is_read_ends_before_it_is_in_force(
    bench: Bench, log: Callable[[], list[str]]
) -> None:
    def script(number: int) -> None:
        bench.joysticks(Slew=1000 if 11 <= number < 20 else 0)
        if number == 10:
            bench.reload()
        if 12 <= number < 20:
            assert bench.reported()[0] == "ACTIVE"
            assert not any("reload=applied" in line for line in log())
        if number == 200:
            bench.stop()

    bench.run(script)
    assert any("reload=applied" in line for line in log())


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
        FakePort, "send", lambda port, f: f[:3] != status.message.key and send(port, f)
    )
    at(bench, {}, last=60)
    assert [frame[:3] for frame in failed] == [status.message.key] * 2


def test_the_digest_is_not_sent_from_an_address_that_is_not_ours(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    status = load_deployment(bench.file).identity_status
    assert status is not None
    silent = property(lambda _: frozenset({"crane"}))
    monkeypatch.setattr(module.Controller, "silent_buses", silent)
    at(bench, {}, last=60)
    assert not [frame for frame in bench.sent if frame[:3] == status.message.key]


class Left(BaseException):
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
