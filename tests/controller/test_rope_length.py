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
