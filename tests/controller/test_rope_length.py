"""Length of a rope by its signal."""

import math

import pytest

from canshaper.controller.measured_limits import MOST_PER_S, SETTLES_S, RopeLength
from canshaper.shaping.states import Lost

TICK_S = 0.02


def rope(lost: Lost = "longest", measured: float | None = 5.0) -> RopeLength:
    one = RopeLength(2.0, 30.0, lost)
    if measured is not None:
        one.step(measured, TICK_S, rests=True)
    return one


class TestLength:
    def test_before_it_is_known_it_is_the_longest(self) -> None:
        assert rope(measured=None).length_m == 30.0

    def test_at_rest_it_is_taken_at_once(self) -> None:
        one = rope()
        assert one.length_m == 5.0
        assert not one.step(5.3, TICK_S, rests=True)
        assert one.length_m == 5.3

    @pytest.mark.parametrize(("measured", "length"), [(1.0, 2.0), (160.0, 30.0)])
    def test_it_stays_in_the_range_of_the_file(self, measured: float, length: float) -> None:
        assert rope(measured=measured).length_m == length

    @pytest.mark.parametrize("measured", [None, 0.0, -1.0, math.nan])
    def test_what_is_no_length_is_lost(self, measured: float | None) -> None:
        one = rope()
        assert one.step(measured, TICK_S, rests=True)
        assert one.state == "lost"
        assert one.step(5.0, TICK_S, rests=True)
        assert one.state == "known"

    @pytest.mark.parametrize(
        ("lost", "length"), [("longest", 30.0), ("hold", 5.0), ("neutral", 5.0)]
    )
    def test_while_it_is_lost_the_file_says_what_holds(self, lost: Lost, length: float) -> None:
        one = rope(lost)
        assert not one.stops
        one.step(None, TICK_S, rests=True)
        assert one.length_m == length
        assert one.stops is (lost == "neutral")

    @pytest.mark.parametrize("to", [8.0, 2.0])
    def test_a_jump_of_three_metres_counts_when_it_has_settled(self, to: float) -> None:
        one = rope("hold")
        assert one.step(to, TICK_S, rests=True)
        assert one.state == "jumped"
        assert one.length_m == 5.0
        for _ in range(round(SETTLES_S / TICK_S) - 1):
            assert not one.step(to, TICK_S, rests=True)
        assert one.step(to, TICK_S, rests=True)
        assert (one.state, one.length_m) == ("known", to)

    def test_a_fast_hoist_that_is_told_twice_a_second_does_not_jump(self) -> None:
        one, length = rope(), 5.0
        for tick in range(200):
            if tick % 25 == 24:
                length += 1.4
            assert not one.step(length, TICK_S, rests=True)

    def test_in_motion_it_changes_no_faster_than_by_itself_in_a_second(self) -> None:
        one = rope()
        one.step(None, TICK_S, rests=False)  # then the longest holds
        assert one.length_m == pytest.approx(5.0 * (1.0 + MOST_PER_S * TICK_S))
        for _ in range(200):
            one.step(None, TICK_S, rests=False)
        assert one.length_m == 30.0


def state_after(lost_s: float, length_m: float, without: float | None = None) -> str:
    """State when a rope of 10 m is measured again, which was lost for some time."""
    rope = RopeLength(1.0, 12.0, "hold")
    for _ in range(100):
        rope.step(10.0, 0.02, rests=True)
    for _ in range(round(lost_s / 0.02)):
        rope.step(without, 0.02, rests=False)
        assert rope.state == "lost"
    rope.step(length_m, 0.02, rests=False)
    return rope.state


@pytest.mark.parametrize("without", [None, 0.0])
def test_a_lost_reading_hides_no_jump(without: float | None) -> None:
    assert state_after(0.0, 2.0) == state_after(0.02, 2.0, without) == "jumped"
    assert state_after(0.02, 8.5, without) == "known"


@pytest.mark.parametrize(("lost_s", "way_m"), [(1.0, 4.8), (2.0, 7.8)])
def test_a_lost_rope_may_have_run_all_the_time(lost_s: float, way_m: float) -> None:
    """At 3 m/s, for the time lost and up to half a second between two values, and 0.3 m."""
    assert state_after(lost_s, 10.0 - way_m + 0.01) == "known"
    assert state_after(lost_s, 10.0 - way_m - 0.01) == "jumped"


def test_after_four_seconds_the_length_before_says_nothing() -> None:
    assert state_after(4.0, 0.1) == state_after(4.0, 12.0) == "known"


def test_time_lost_before_counts_once() -> None:
    rope = RopeLength(1.0, 12.0, "hold")
    for measured_m in (10.0, *[None] * 200, 10.0, 2.0):
        rope.step(measured_m, 0.02, rests=False)
    assert rope.state == "jumped"
