"""The loop at fixed deadlines, on a clock that only the test moves."""

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.service import loop

PERIOD_NS = 20_000_000
START_NS = 1_000_000_000_000


class Clock:
    """A clock that stands still but for sleeping and working."""

    def __init__(self) -> None:
        self.now_ns = START_NS
        self.late_ns = 0
        self.slept: list[float] = []

    def monotonic_ns(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.slept.append(seconds)
        self.now_ns += round(seconds * 1e9) + self.late_ns


def calls(clock: Clock, work_ns: list[int], late_ns: int = 0) -> list[tuple[int, int]]:
    """(time since the start, missed) of every call, while each call takes its time to work."""
    clock.late_ns = late_ns
    seen: list[tuple[int, int]] = []
    durations: Iterator[int] = iter(work_ns)

    def body(now_ns: int, missed: int, late_ns: int) -> bool:
        assert now_ns == clock.now_ns
        seen.append((now_ns - START_NS, missed))
        work = next(durations, None)
        clock.now_ns += work or 0
        return work is not None

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "time", clock)
        loop.run_at_deadlines(PERIOD_NS, body)
    return seen


def test_the_first_call_is_at_once_and_the_others_at_their_deadlines() -> None:
    seen = calls(Clock(), [0, 5_000_000, 19_000_000, 0])
    assert seen == [(i * PERIOD_NS, 0) for i in range(5)]


def test_it_ends_when_told_to_without_another_sleep() -> None:
    clock = Clock()
    assert calls(clock, []) == [(0, 0)]
    assert clock.slept == []


def test_lateness_of_the_clock_does_not_add_up() -> None:
    late = 3_000_000
    seen = calls(Clock(), [1_000_000] * 500, late_ns=late)
    assert seen[1:] == [(i * PERIOD_NS + late, 0) for i in range(1, 501)]


def test_a_call_that_is_a_little_late_misses_nothing_and_is_caught_up() -> None:
    seen = calls(Clock(), [PERIOD_NS + 5_000_000, 1_000_000, 0])
    assert seen == [(0, 0), (25_000_000, 0), (40_000_000, 0), (60_000_000, 0)]


@pytest.mark.parametrize("missed", [1, 2, 10, 5000])
def test_deadlines_that_passed_are_counted_and_left_out(missed: int) -> None:
    work = (1 + missed) * PERIOD_NS + 7_000_000
    seen = calls(Clock(), [work, 0, 0])
    back = (2 + missed) * PERIOD_NS
    assert seen == [(0, 0), (work, missed), (back, 0), (back + PERIOD_NS, 0)]


def test_ending_on_a_deadline_misses_nothing() -> None:
    assert calls(Clock(), [PERIOD_NS, 0]) == [(0, 0), (PERIOD_NS, 0), (2 * PERIOD_NS, 0)]


def test_an_exception_of_the_body_ends_the_loop() -> None:
    def body(_now_ns: int, _missed: int, _late_ns: int) -> bool:
        raise RuntimeError("broken")

    with pytest.raises(RuntimeError, match="broken"):
        loop.run_at_deadlines(PERIOD_NS, body)


@given(work_ms=st.lists(st.integers(0, 200), max_size=60), late_us=st.integers(0, 19_999))
def test_time_and_count_stay_together(work_ms: list[int], late_us: int) -> None:
    """Calls and missed deadlines together number the deadlines; never two calls in one period."""
    seen = calls(Clock(), [ms * 1_000_000 for ms in work_ms], late_ns=late_us * 1000)
    deadline = 0
    for i, (at, missed) in enumerate(seen):
        deadline += (missed + 1) if i else 0
        late = at - deadline * PERIOD_NS
        assert 0 <= late < PERIOD_NS
    assert sum(1 + missed for _, missed in seen) == deadline + 1
