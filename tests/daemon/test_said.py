"""What a daemon says of itself: to its service manager, in its log, in one line for people."""

import logging
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import pytest

from canshaper.blackbox.keeper import BlackBox
from canshaper.bus.port import ListeningPort
from canshaper.codec.frame import FrameFault
from canshaper.daemon import daemon as module
from canshaper.daemon.daemon import Daemon
from canshaper.daemon.ports import open_ports
from canshaper.errors import BusError
from canshaper.machine.binding import load_deployment
from tests.daemon.test_reload import BUS, SECOND, Bench, FakePort
from tests.rigs.forwarder import TICK_NS

SECOND_TICKS = 50
AXES = "slew,near_far,lift"
READY = "slew READY, near_far READY, lift READY, crane up"


class Diary:
    """All that a daemon does but for its frames, in order; a line each, with its tick."""

    def __init__(self, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
        self.lines: list[tuple[int, str]] = []
        self.starts: list[int] = []  # times of the ticks, from the first one
        self.pings: list[int] = []
        self.pauses: list[int] = []
        self.boxed: list[tuple[int, bool]] = []
        self._bench = bench
        self._at: dict[int, Callable[[], object]] = {}
        self._last = 0
        diary = self

        class Manager:
            def ready(self, status: str) -> None:
                diary.note(f"ready: {status}")

            def reloading(self) -> None:
                diary.note("reloading")

            def stopping(self) -> None:
                diary.note("stopping")

            def status(self, text: str) -> None:
                diary.note(f"status: {text}")

            def ping(self, now_ns: int) -> None:
                diary.pings.append(now_ns)

        class Collector:
            def freeze(self) -> None:
                diary.note("freeze")

            def pause(self, now_ns: int) -> None:
                diary.pauses.append(now_ns)

        monkeypatch.setattr(module, "ServiceManager", Manager)
        monkeypatch.setattr(module, "Collector", Collector)
        monkeypatch.setattr(module, "refuse_huge_pages", lambda: diary.note("no huge pages"))
        monkeypatch.setattr(module, "lock_memory", lambda: diary.note("memory locked"))
        self._watch_box(monkeypatch)
        send = FakePort.send

        def sends(port: FakePort, frame: Any) -> bool:
            if 0x200 <= frame.can_id <= 0x202:
                diary.note(f"{port.name} {frame.can_id:#x}")
            return send(port, frame)

        monkeypatch.setattr(FakePort, "send", sends)
        bench.opening = lambda channel: diary.note(f"open {channel}")

    def _watch_box(self, monkeypatch: pytest.MonkeyPatch) -> None:
        diary, bench = self, self._bench
        begin, close, after_tick = BlackBox.begin, BlackBox.close, BlackBox.after_tick

        def begins(box: BlackBox, now_ns: int) -> None:
            assert now_ns == bench.now_ns
            diary.note("black box begins")
            begin(box, now_ns)

        def closes(box: BlackBox) -> None:
            diary.note("black box closes")
            close(box)

        def follows(box: BlackBox, now_ns: int, events: Iterable[object], *, neutral: bool) -> None:
            diary.boxed.append((now_ns, neutral))
            after_tick(box, now_ns, events, neutral=neutral)

        monkeypatch.setattr(BlackBox, "after_tick", follows)
        monkeypatch.setattr(BlackBox, "begin", begins)
        monkeypatch.setattr(BlackBox, "close", closes)

    def note(self, line: str) -> None:
        self.lines.append((len(self.starts) - 1, line))

    def run(self, last: int, acts: dict[int, Callable[[], object]] | None = None) -> None:
        """Run so many ticks with the joysticks at rest, and do something before some of them."""

        def script(number: int) -> None:
            self.starts.append(self._bench.now_ns - 10**12)
            self._bench.joysticks()
            (acts or {}).get(number, lambda: None)()
            if number == last:
                self._bench.stop()

        self._bench.run(script)

    def all(self, *, of: str = "") -> list[str]:
        return [line for _, line in self.lines if line.startswith(of)]

    def statuses(self) -> list[tuple[int, str]]:
        return [(tick, line[8:]) for tick, line in self.lines if line.startswith("status: ")]


@pytest.fixture
def diary(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> Diary:
    return Diary(bench, monkeypatch)


@pytest.fixture
def log(caplog: pytest.LogCaptureFixture) -> Callable[[str], list[str]]:
    caplog.set_level(logging.INFO, "canshaper")
    return lambda what: [
        f"{r.levelname} {r.getMessage()}" for r in caplog.records if what in r.getMessage()
    ]


VALVES = ["crane 0x200", "crane 0x201", "crane 0x202"]


# -- a life ----------------------------------------------------------------------------------------


def test_neutral_goes_out_before_the_service_is_ready_and_after_its_last_tick(
    diary: Diary,
) -> None:
    diary.run(3)
    assert diary.all()[:9] == [
        "open vcan0",
        "no huge pages",
        "memory locked",
        "freeze",
        *VALVES,
        "black box begins",
        f"ready: started, axes {AXES}",
    ]
    assert diary.all()[-5:] == ["stopping", *VALVES, "black box closes"]


def test_every_tick_has_its_time_and_pings_the_watchdog(diary: Diary) -> None:
    """The watchdog's ping says that the loop is alive; garbage waits for the end of a tick."""
    diary.run(100)
    assert diary.starts == [n * TICK_NS for n in range(101)]
    assert diary.pings == diary.pauses == [10**12 + start for start in diary.starts]
    assert diary.boxed == [(start, True) for start in diary.pings]


def test_the_log_says_what_runs(bench: Bench, diary: Diary, log: Callable[[str], Any]) -> None:
    diary.run(3)
    assert log("started") == [f"INFO started file={bench.file} axes={AXES}"]
    assert log("memory=") == ["INFO memory=locked"]


def test_the_log_says_why_memory_is_not_locked(
    diary: Diary, log: Callable[[str], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "lock_memory", lambda: "too much of it")
    diary.run(3)
    assert log("memory=") == ["INFO memory=not-locked (too much of it)"]


# -- the line for people ---------------------------------------------------------------------------


def test_once_a_second_it_says_how_axes_buses_and_loop_are(bench: Bench, diary: Diary) -> None:
    """Of a second the worst lateness; of a life the deadlines that were missed."""

    def busy(ms: int) -> Callable[[], None]:
        return lambda: bench.sleep(ms / 1000)

    diary.run(120, {10: busy(45), 20: busy(22)})
    first, second, third = diary.statuses()
    assert first == (0, f"{READY}, late 0 us, missed 0")
    assert second == (SECOND_TICKS - 1, f"{READY}, late 25000 us, missed 1")
    assert third == (2 * SECOND_TICKS - 1, f"{READY}, late 0 us, missed 1")


def test_who_only_listens_says_so_first(bench: Bench, diary: Diary) -> None:
    bench.script = lambda number: bench.stop() if number == 3 else None
    Daemon(lambda: replace(load_deployment(bench.file), listen_only=True)).run()
    (status,) = diary.statuses()
    assert status[1].startswith("listen-only, slew ")


def test_once_a_second_the_log_is_flushed(diary: Diary) -> None:
    """A reader that was slow may be back."""

    class Counts(logging.Handler):
        flushed = 0

        def emit(self, record: logging.LogRecord) -> None:
            pass

        def flush(self) -> None:
            self.flushed += 1

    handler = Counts()
    logging.getLogger().addHandler(handler)
    try:
        diary.run(120)
        assert handler.flushed == 3
    finally:
        logging.getLogger().removeHandler(handler)


# -- faults ----------------------------------------------------------------------------------------


def test_faults_in_turn_are_logged_once_a_second(
    bench: Bench, diary: Diary, log: Callable[[str], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fault that is another one in every tick must not flood the log."""
    faults: list[Callable[[FrameFault], None]] = []
    opened = bench._open

    def opens(name: str, bus: Any, fault: Callable[[FrameFault], None], ids: Any) -> Any:
        faults.append(fault)
        return opened(name, bus, fault, ids)

    monkeypatch.setattr("canshaper.daemon.ports.open_port", opens)
    kinds = (FrameFault.ERROR_FRAME, FrameFault.SEND_FAILED, FrameFault.WRONG_LENGTH)
    ticks: list[int] = []

    def fault(number: int) -> Callable[[], None]:
        def acts() -> None:
            ticks.extend([number - 1] * (len(log("fault=")) - len(ticks)))
            faults[0](kinds[number % 3])

        return acts

    diary.run(120, {number: fault(number) for number in range(1, 121)})
    assert ticks == [1, 1 + SECOND_TICKS, 1 + 2 * SECOND_TICKS]


# -- reloads ---------------------------------------------------------------------------------------


def test_a_reload_is_put_to_work_behind_neutral_and_at_once(
    bench: Bench, diary: Diary, log: Callable[[str], list[str]]
) -> None:
    """The manager knows while it lasts; the next tick does not wait for a bus that is not new."""
    diary.run(80, {9: bench.reload})
    (tick,) = {tick for tick, line in diary.lines if line == "reloading"}
    during = [line for at, line in diary.lines if at == tick]
    done = ["black box begins", "ready: reload applied", "freeze"]
    assert during == [*VALVES, "reloading", *VALVES, *done]
    assert diary.starts[tick + 1] == diary.starts[tick]
    assert log("reload=") == [f"INFO reload=applied file={bench.file}"]
    assert [at for at, _ in diary.statuses()] == [0, tick + 1 + SECOND_TICKS]


def test_a_reload_that_is_refused_changes_nothing_and_people_can_read_why(
    bench: Bench, diary: Diary
) -> None:
    """For a second, before the line says again how things are; deadlines stay as they were."""

    def opening(channel: str) -> None:
        if channel == "vcan1":
            raise BusError("bus two: cannot open: no such adapter")

    bench.opening = opening
    diary.run(80, {9: lambda: bench.reload(BUS, SECOND)})
    (tick,) = {tick for tick, line in diary.lines if line == "reloading"}
    during = [line for at, line in diary.lines if at == tick]
    why = "reload refused: bus two: cannot open: no such adapter"
    assert during == [*VALVES, "reloading", "ready: as before", f"status: {why}"]
    assert [at for at, _ in diary.statuses()] == [0, tick, tick + SECOND_TICKS]
    assert diary.starts == [n * TICK_NS for n in range(81)]


def test_a_reload_in_motion_is_logged_as_waiting_while_it_waits(
    bench: Bench, log: Callable[[str], list[str]]
) -> None:
    seen: list[list[str]] = []

    def script(number: int) -> None:
        bench.joysticks(Slew=1000 if 5 <= number < 20 else 0)
        if number == 10:
            bench.reload()
        if number == 15:
            seen.append(log("reload="))
        if number == 200:
            bench.stop()

    bench.run(script)
    assert seen == [["INFO reload=waiting until every axis is neutral"]]


# -- buses of a reload -----------------------------------------------------------------------------


def test_a_port_that_stays_open_gets_what_it_is_for_now(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    watched: list[Any] = []
    monkeypatch.setattr(FakePort, "watch", lambda _, name, ids: watched.append((name, ids)))

    def script(number: int) -> None:
        bench.joysticks()
        if number == 9:
            bench.reload("timeout_ms: 100 #", "timeout_ms: 120 #")
        if number == 40:
            bench.stop()

    bench.run(script)
    ((name, ids),) = watched
    routes = load_deployment(bench.file).routing.buses["crane"]
    assert (name, ids.sent, ids.claims) == ("crane", routes.sent, routes.claims)


@pytest.mark.parametrize("at_start", [True, False])
def test_of_buses_that_do_not_all_open_none_stays_open_that_was_not(
    bench: Bench, at_start: bool
) -> None:
    three = f"{SECOND}\n  three: {{ interface: socketcan, channel: vcan2 }}"

    def opening(channel: str) -> None:
        if channel == "vcan2":
            raise BusError("bus three: cannot open")

    def script(number: int) -> None:
        if number == 9:
            bench.reload(BUS, three)
        if number == 30:
            closed.extend((port.channel, port.closed) for port in bench.ports)
            bench.stop()

    bench.opening = opening
    closed: list[tuple[str, bool]] = []
    if at_start:
        bench.file.write_text(bench.text.replace(BUS, three, 1), encoding="utf-8")
        with pytest.raises(BusError, match="bus three"):
            Daemon(lambda: load_deployment(bench.file))
        assert [port.closed for port in bench.ports] == [True, True]
    else:
        bench.run(script)
        assert closed == [("vcan0", False), ("vcan1", True)]


def test_a_fault_of_a_bus_that_a_reload_opened_is_counted(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, log: Callable[[str], list[str]]
) -> None:
    faults: list[Callable[[FrameFault], None]] = []
    opened = bench._open

    def opens(name: str, bus: Any, fault: Callable[[FrameFault], None], ids: Any) -> Any:
        assert ids.sent == load_deployment(bench.file).routing.buses[name].sent
        faults.append(fault)
        return opened(name, bus, fault, ids)

    monkeypatch.setattr("canshaper.daemon.ports.open_port", opens)

    def script(number: int) -> None:
        if number == 9:
            bench.reload(BUS, SECOND)
        if number == 30:
            faults[1](FrameFault.ERROR_FRAME)
        if number == 40:
            bench.stop()

    bench.run(script)
    assert log("fault=ERROR_FRAME")


def test_who_takes_part_has_the_port_itself_and_who_listens_one_around_it(bench: Bench) -> None:
    """No step more on the way of a frame than there has to be."""
    deployment = load_deployment(bench.file)
    (port,) = open_ports(deployment, {}, lambda _fault: None).values()
    assert port is bench.ports[0]
    listening = replace(deployment, listen_only=True)
    (port,) = open_ports(listening, {}, lambda _fault: None).values()
    assert isinstance(port, ListeningPort)
    opened = {listening.config.buses["crane"]: port}
    assert open_ports(listening, opened, lambda _fault: None) == {"crane": port}
