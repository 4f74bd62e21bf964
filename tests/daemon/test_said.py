"""Reports of a daemon: to its service manager, in its log, in one line for people."""

import logging
from collections.abc import Callable
from typing import Any

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.daemon import daemon as module
from tests.daemon.bench import Bench
from tests.daemon.diary import SECOND_TICKS, VALVES, Diary
from tests.rigs.forwarder import TICK_NS

AXES = "slew,near_far,lift"
READY = "slew READY, near_far READY, lift READY, crane up"


def test_neutral_goes_out_before_the_service_is_ready_and_after_its_last_tick(diary: Diary) -> None:
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
    assert log("started") == [f"INFO started file={bench.file} axes={AXES} valves=neutral"]
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


def test_valve_frames_that_waited_are_in_the_log_once_a_second(
    bench: Bench, diary: Diary, log: Callable[[str], Any]
) -> None:
    def wait() -> None:
        bench.ports[0].waited += 2

    diary.run(120, {10: wait, 11: wait})
    assert log("waited=") == ["WARNING bus=crane waited=4: valve frames, in a queue"]


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
    bench: Bench, diary: Diary, log: Callable[[str], list[str]]
) -> None:
    """A fault that is another one in every tick must not flood the log."""
    kinds = (FrameFault.ERROR_FRAME, FrameFault.SEND_FAILED, FrameFault.WRONG_LENGTH)
    ticks: list[int] = []

    def fault(number: int) -> Callable[[], None]:
        def acts() -> None:
            ticks.extend([number - 1] * (len(log("fault=")) - len(ticks)))
            bench.faults[0](kinds[number % 3])

        return acts

    diary.run(120, {number: fault(number) for number in range(1, 121)})
    assert ticks == [1, 1 + SECOND_TICKS, 1 + 2 * SECOND_TICKS]
