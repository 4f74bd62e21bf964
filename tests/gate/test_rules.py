"""Rule 4: direction and size, and what the log says.

Full command is 125 steps without a dead band here, a step 0.008 of full speed.
"""

import pytest

from tests.faults import variants
from tests.gate.bench import Bench, bench, limited, load, signs


class TestDirectionAndSize:
    """Rule 4."""

    @signs
    def test_beyond_the_demand(self, sign: int) -> None:
        one = bench()
        one.rests()
        assert not one.sends(sign * 25, near_far=sign * 0.2)
        why = one.sends(sign * 26, near_far=sign * 0.2)
        assert why == f"axis=near_far limit=asked allowed=0.200 speed={sign * 0.208:.3f}"

    @signs
    def test_beyond_the_maximum(self, sign: int) -> None:
        one = bench(max_pct=80.0)
        one.rests()
        assert not one.sends(sign * 100, near_far=sign * 1.0)
        why = one.sends(sign * 101, near_far=sign * 1.0)
        assert why == f"axis=near_far limit=asked allowed=0.800 speed={sign * 0.808:.3f}"

    @signs
    def test_as_soon_as_neutral_was_seen(self, sign: int) -> None:
        one = bench()
        one.rests(1)
        assert not one.sends(sign * 10, near_far=sign * 0.5)

    @signs
    def test_what_was_asked_before_neutral_was_seen_counts_for_nothing(self, sign: int) -> None:
        one = bench()
        for _ in range(3):
            assert not one.sends(0, near_far=sign * 0.5)
        one.rests(1)
        assert "limit=asked" in one.sends(sign * 10)

    @signs
    def test_against_the_stick(self, sign: int) -> None:
        one = bench()
        one.ramp(0, near_far=-sign * 0.5)
        assert "limit=asked allowed=0.000" in one.sends(sign * 25, near_far=-sign * 0.5)

    @signs
    def test_a_demand_holds_for_the_tail(self, sign: int) -> None:
        one = bench(tail_s=0.5)
        one.ramp(sign * 60, near_far=sign * 0.5)
        left = [one.sends(sign * 60) for _ in range(40)]
        assert [bool(why) for why in left].index(True) == 25

    @signs
    def test_the_largest_within_the_tail_counts(self, sign: int) -> None:
        one = bench(tail_s=0.5)
        one.ramp(sign * 60, near_far=sign * 0.5)
        for size in (0.4, 0.3, 0.45, 0.1):
            assert not one.sends(sign * 60, near_far=sign * size)
        left = [one.sends(sign * 56) for _ in range(40)]
        # 0.45 was asked a tick before the last one
        assert [bool(why) for why in left].index(True) == 24

    @signs
    def test_on_its_way_back_it_is_lower_with_each_frame(self, sign: int) -> None:
        one = bench(tail_s=0.0, fall_per_s=2.0)
        one.ramp(sign * 100, near_far=float(sign))
        # 0.8, a step of rounding, and 0.04 less in each frame
        for steps in (96, 91, 86):
            assert not one.sends(sign * steps)
        assert "limit=asked" in one.sends(sign * 86)

    @signs
    def test_by_less_than_a_step_too(self, sign: int) -> None:
        """Rounding is given once, not with each frame: else it would never end."""
        one = bench(tail_s=0.0, fall_per_s=0.2)  # half a step in a tick
        one.ramp(sign * 100, near_far=float(sign))
        left = [one.sends(sign * 100) for _ in range(4)]
        assert [bool(why) for why in left] == [False, False, True, True]
        one = bench(tail_s=0.0, fall_per_s=0.2)
        one.ramp(sign * 100, near_far=float(sign))
        one.skips()
        assert not one.sends(sign * 100)
        assert one.axis.top == pytest.approx(0.8)  # a step more, and two ticks less

    @signs
    def test_missed_deadlines_give_no_time_to_be_higher(self, sign: int) -> None:
        one = bench(tail_s=0.0, fall_per_s=2.0)
        one.ramp(sign * 100, near_far=float(sign))
        assert not one.sends(sign * 96, missed=4)
        assert "limit=asked" in one.sends(sign * 96, missed=3)

    @signs
    def test_faster_and_the_other_way_where_the_file_allows_it(self, sign: int) -> None:
        free = {"deadband_pct": 0.0, "rise_per_s": 100.0, "fall_per_s": 100.0}
        one = Bench(limited(variants.machine("allowing")[1], "near_far", **free), "near_far")
        one.ramp(sign * 125, near_far=sign * 0.2)
        for steps in (60, 30, 0, -15, -25):
            assert not one.sends(sign * steps, near_far=sign * 0.2), steps

    @signs
    def test_faster_is_not_the_other_way(self, sign: int) -> None:
        one = bench(allow_faster=True)
        one.ramp(sign * 60, near_far=sign * 0.5)
        assert not one.sends(sign * 125)
        assert not one.sends(0)
        assert "limit=asked allowed=0.000" in one.sends(-sign * 10)

    @signs
    def test_the_other_way_as_fast_as_was_asked_only(self, sign: int) -> None:
        one = bench(allow_reverse=True)
        one.rests()
        for now in (0.4, 0.3, 0.0):
            assert not one.sends(0, near_far=sign * now)
        assert not one.sends(-sign * 50)
        assert "limit=asked allowed=0.400" in one.sends(-sign * 51)

    @signs
    def test_a_reversal_may_be_braked_along_the_filter(self, sign: int) -> None:
        one = bench(reversal="brake_shaped", reversal_s=0.4)
        one.ramp(sign * 60, near_far=sign * 0.5)
        for _ in range(5):  # neutral is no part of it
            assert not one.sends(sign * 60)
        for _ in range(20):
            assert not one.sends(sign * 60, near_far=-sign * 0.5)
        assert "limit=asked" in one.sends(sign * 60, near_far=-sign * 0.5)
        one = bench()
        one.ramp(sign * 60, near_far=sign * 0.5)
        assert "limit=asked" in one.sends(sign * 60, near_far=-sign * 0.5)

    @signs
    def test_a_missed_deadline_lets_nothing_run_on_against_the_stick(self, sign: int) -> None:
        one = bench(tail_s=1.0)
        one.ramp(sign * 60, near_far=sign * 0.5)
        assert "limit=asked" in one.sends(sign * 60, missed=1, near_far=-sign * 0.5)


def test_what_a_gateway_missed_has_fallen_already() -> None:
    """A frame after two periods, on its way back: the next one may be a fall below it."""
    axis = Bench(load("gateway-forwarder"), "slew").axis
    axis.last, axis.top, axis.ticks = 0.5, 0.5, 2
    axis.left(0.4, 10, 10)
    assert axis.top == pytest.approx(0.4)


@pytest.mark.parametrize("last", [0.0, -0.3])
def test_what_fell_on_the_other_side_is_no_fall_on_this_one(last: float) -> None:
    axis = Bench(load("forwarder"), "slew").axis
    axis.last, axis.way_back, axis.most = last, 0.9, 1.0
    for number, velocity in enumerate((0.3, 0.2)):
        axis.ticks = 1
        axis.left(velocity, number, number)
    assert axis.forth.remaining == pytest.approx(-0.5 * 0.02)
