"""The loop at fixed deadlines, on a clock that only the test moves."""

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.gate import cycle

PERIOD_NS = 20_000_000
START_NS = 1_000_000_000_000


class Clock:
    """A clock that stands still but for sleeping and working.

    Args:
        late_ns: how late each sleep ends; the last one stands for all further ones.
    """

    def __init__(self, *late_ns: int) -> None:
        self.now_ns = START_NS
        self.slept: list[float] = []
        self._late_ns = [*late_ns] or [0]

    def boottime_ns(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.slept.append(seconds)
        late_ns = self._late_ns.pop(0) if len(self._late_ns) > 1 else self._late_ns[0]
        self.now_ns += round(seconds * 1e9) + late_ns


def calls(clock: Clock, work_ns: list[int]) -> list[tuple[int, int, int]]:
    """(time since the start, missed, late) of every call, while each takes its time to work."""
    seen: list[tuple[int, int, int]] = []
    durations: Iterator[int] = iter(work_ns)

    def body(now_ns: int, missed: int, late_ns: int) -> bool:
        assert now_ns == clock.now_ns
        seen.append((now_ns - START_NS, missed, late_ns))
        work = next(durations, None)
        clock.now_ns += work or 0
        return work is not None

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cycle, "time", clock)
        patch.setattr(cycle, "boottime_ns", clock.boottime_ns)
        cycle.run_at_deadlines(PERIOD_NS, body)
    return seen


def test_the_first_call_is_at_once_and_the_others_at_their_deadlines() -> None:
    seen = calls(Clock(), [0, 5_000_000, 19_000_000, 0])
    assert seen == [(i * PERIOD_NS, 0, 0) for i in range(5)]


def test_it_ends_on_request_without_another_sleep() -> None:
    clock = Clock()
    assert calls(clock, []) == [(0, 0, 0)]
    assert clock.slept == []


def test_lateness_of_the_clock_does_not_add_up() -> None:
    late = 3_000_000
    seen = calls(Clock(late), [1_000_000] * 500)
    assert seen[1:] == [(i * PERIOD_NS + late, 0, late) for i in range(1, 501)]


def test_a_call_that_is_a_little_late_misses_nothing_and_is_caught_up() -> None:
    late = 5_000_000
    seen = calls(Clock(), [PERIOD_NS + late, 1_000_000, 0])
    assert seen == [(0, 0, 0), (25_000_000, 0, late), (40_000_000, 0, 0), (60_000_000, 0, 0)]


@pytest.mark.parametrize("missed", [1, 2, 10, 5000])
def test_deadlines_that_passed_during_a_call_are_counted_and_left_out(missed: int) -> None:
    late = missed * PERIOD_NS + 7_000_000
    seen = calls(Clock(), [PERIOD_NS + late, 0, 0])
    back = (2 + missed) * PERIOD_NS
    assert seen == [
        (0, 0, 0),
        (PERIOD_NS + late, missed, late),
        (back, 0, 0),
        (back + PERIOD_NS, 0, 0),
    ]


@pytest.mark.parametrize("missed", [1, 2, 10, 5000])
def test_deadlines_that_were_slept_through_are_known_at_once(missed: int) -> None:
    """Before the frames of that call are sent, not one call later, and never as a burst."""
    late = missed * PERIOD_NS + 7_000_000
    seen = calls(Clock(0, late, 0), [0] * 4)
    woken = 2 * PERIOD_NS + late
    back = (3 + missed) * PERIOD_NS
    assert seen == [
        (0, 0, 0),
        (PERIOD_NS, 0, 0),
        (woken, missed, late),
        (back, 0, 0),
        (back + PERIOD_NS, 0, 0),
    ]


@pytest.mark.parametrize(("late", "missed"), [(-1, 0), (0, 1), (1, 1)])
def test_a_deadline_is_missed_when_the_next_one_has_come(late: int, missed: int) -> None:
    seen = calls(Clock(PERIOD_NS + late), [0])
    assert seen[1] == (2 * PERIOD_NS + late, missed, PERIOD_NS + late)


def test_sleep_and_work_that_are_late_together_count_once() -> None:
    """Work of one period and a half, then a sleep that ends one period late."""
    work = PERIOD_NS * 3 // 2
    seen = calls(Clock(PERIOD_NS), [work, 0])
    assert [missed for _, missed, _ in seen] == [0, 0, 1]
    assert [at for at, _, _ in seen] == [0, work, 3 * PERIOD_NS]


def test_ending_on_a_deadline_misses_nothing() -> None:
    seen = calls(Clock(), [PERIOD_NS, 0])
    assert seen == [(0, 0, 0), (PERIOD_NS, 0, 0), (2 * PERIOD_NS, 0, 0)]


def test_a_clock_that_wakes_a_little_early_misses_nothing() -> None:
    seen = calls(Clock(-1, 0), [0, 0])
    assert [missed for _, missed, _ in seen] == [0, 0, 0]
    assert seen[2][0] == 2 * PERIOD_NS


def test_an_exception_of_the_body_ends_the_loop() -> None:
    def body(_now_ns: int, _missed: int, _late_ns: int) -> bool:
        raise RuntimeError("broken")

    with pytest.raises(RuntimeError, match="broken"):
        cycle.run_at_deadlines(PERIOD_NS, body)


@given(
    work_ms=st.lists(st.integers(0, 200), max_size=60),
    late_us=st.lists(st.integers(0, 90_000), min_size=1, max_size=60),
)
def test_time_and_count_stay_together(work_ms: list[int], late_us: list[int]) -> None:
    """Calls and missed deadlines together number the deadlines; never two calls for one of them."""
    seen = calls(Clock(*(us * 1000 for us in late_us)), [ms * 1_000_000 for ms in work_ms])
    deadline = -1
    for at, missed, late in seen:
        first = (deadline + 1) * PERIOD_NS  # not yet called for
        assert late == at - first
        deadline += 1 + missed
        assert 0 <= at - deadline * PERIOD_NS < PERIOD_NS


def test_who_waits_otherwise_is_informed_for_how_long() -> None:
    clock = Clock()
    waited: list[float] = []
    left = iter((True, True, False))

    def wait(seconds: float) -> None:
        waited.append(seconds)
        clock.now_ns += round(seconds * 1e9)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cycle, "time", clock)
        patch.setattr(cycle, "boottime_ns", clock.boottime_ns)
        cycle.run_at_deadlines(PERIOD_NS, lambda *_: next(left), wait)
    assert waited == [0.02, 0.02]
    assert clock.slept == []


@given(
    work_ms=st.lists(st.integers(0, 200), max_size=60),
    late_us=st.lists(st.integers(0, 90_000), min_size=1, max_size=60),
    steps_us=st.lists(st.integers(-200, 200), min_size=1, max_size=60),
)
def test_deadlines_that_are_moved_are_counted_as_others(
    work_ms: list[int], late_us: list[int], steps_us: list[int]
) -> None:
    """Each is a period behind the one before, moved as asked; none is called for twice."""
    clock = Clock(*(us * 1000 for us in late_us))
    steps = iter(steps_us)
    steered: list[tuple[int, int]] = []

    def steer(deadline_ns: int) -> int:
        steered.append((deadline_ns, next(steps, 0) * 1000))
        return steered[-1][1]

    deadline = START_NS
    left = iter(work_ms)

    def body(now_ns: int, missed: int, late_ns: int) -> bool:
        nonlocal deadline
        if steered:
            before, step = steered[-1]
            assert before == deadline + PERIOD_NS
            deadline = before + step
        assert late_ns == now_ns - deadline
        assert missed == max(late_ns // PERIOD_NS, 0)
        deadline += missed * PERIOD_NS
        work = next(left, None)
        clock.now_ns += (work or 0) * 1_000_000
        return work is not None

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cycle, "time", clock)
        patch.setattr(cycle, "boottime_ns", clock.boottime_ns)
        cycle.run_at_deadlines(PERIOD_NS, body, steer=steer)
