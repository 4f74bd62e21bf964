"""Rules 4 to 6: direction and size, rise and fall, and what the log says.

Full command is 125 steps without a dead band here, a step 0.008 of full speed.
"""

import pytest

from canshaper.gate.rules import rise
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


class TestRates:
    """Rules 5 and 6."""

    @signs
    @pytest.mark.parametrize(("steps", "passes"), [(39, True), (40, False)])
    def test_faster_than_the_last_by_the_rise(self, sign: int, steps: int, passes: bool) -> None:
        one = bench(rise_per_s=5.0)  # 0.1 in a tick
        one.ramp(sign * 25, near_far=float(sign))
        why = one.sends(sign * steps, near_far=float(sign))
        # 0.2, a step, the rise, and half a step
        assert ("limit=rise allowed=0.312" in why) is not passes

    @signs
    @pytest.mark.parametrize("rise_per_s", [0.2, 0.5, 2.0])
    def test_rounding_does_not_add_up_over_frames(self, sign: int, rise_per_s: float) -> None:
        one = bench(rise_per_s=rise_per_s)
        one.rests()
        axis, steps, ticks = one.axis, 0, 20
        for _ in range(ticks):  # each frame as fast as the rule allows
            assert not one.sends(sign * steps, near_far=float(sign))
            while not rise(axis, axis.of.velocity(sign * (steps + 1)), 1):
                steps += 1
        ramp = ticks * rise_per_s * 0.02
        assert ramp <= steps * axis.of.step <= ramp + 1.5 * axis.of.step

    @signs
    def test_missed_deadlines_give_no_more_rise(self, sign: int) -> None:
        one = bench(rise_per_s=4.0)
        one.ramp(sign * 25, near_far=float(sign))
        assert "limit=rise" in one.sends(sign * 37, missed=5, near_far=float(sign))

    @signs
    def test_a_tick_without_a_frame_gives_no_more_rise(self, sign: int) -> None:
        one = bench(rise_per_s=4.0)
        one.ramp(sign * 25, near_far=float(sign))
        one.skips(near_far=float(sign))
        assert "limit=rise" in one.sends(sign * 37, near_far=float(sign))

    @signs
    @pytest.mark.parametrize(("silent", "passes"), [(9, True), (10, False)])
    def test_a_valve_that_has_closed_rises_from_rest(
        self, sign: int, silent: int, passes: bool
    ) -> None:
        one = bench(rise_per_s=4.0)
        one.ramp(sign * 60, near_far=float(sign))
        for _ in range(silent):  # 200 ms are its timeout
            one.skips(near_far=float(sign))
        why = one.sends(sign * 60, near_far=float(sign))
        assert ("limit=rise" in why) is not passes

    @signs
    def test_a_valve_that_has_closed_opens_again(self, sign: int) -> None:
        one = bench(rise_per_s=4.0, fall_per_s=4.0)
        one.ramp(sign * 60, near_far=float(sign))
        for _ in range(10):
            one.skips(near_far=float(sign))
        assert not one.sends(sign * 10, near_far=float(sign))

    @signs
    @pytest.mark.parametrize(("steps", "passes"), [(72, True), (71, False)])
    def test_slower_than_the_last_by_the_fall(self, sign: int, steps: int, passes: bool) -> None:
        one = bench(fall_per_s=5.0)  # 0.1 in a tick
        one.ramp(sign * 86, near_far=float(sign))
        why = one.sends(sign * steps, near_far=float(sign))
        assert ("limit=fall" in why) is not passes

    @signs
    def test_a_fall_to_neutral_is_a_stop(self, sign: int) -> None:
        one = bench(fall_per_s=2.0)
        one.ramp(sign * 60, near_far=float(sign))
        assert not one.sends(0, near_far=float(sign))
        assert not one.axis.armed
        assert not one.axis.latched
        assert "why=fell to neutral at once" in one.sends(sign * 5, near_far=float(sign))

    @signs
    @pytest.mark.parametrize(
        ("steps", "turns", "goes_on"),
        [(13, 1, True), (14, 1, False), (25, 2, True), (26, 2, False)],
    )
    def test_by_the_fall_to_neutral_is_none(
        self, sign: int, steps: int, turns: int, goes_on: bool
    ) -> None:
        one = bench(fall_per_s=4.8)  # 12 steps in a tick, and a step and a half
        one.ramp(sign * steps, near_far=float(sign))
        for _ in range(turns - 1):
            one.skips(near_far=float(sign))
        assert not one.sends(0, near_far=float(sign))
        assert one.axis.armed is goes_on

    @signs
    def test_the_other_way_by_way_of_zero(self, sign: int) -> None:
        one = bench(fall_per_s=2.0)
        one.ramp(sign * 60, near_far=float(sign))
        assert "limit=rise allowed=0.012" in one.sends(-sign * 60, near_far=-float(sign))

    @signs
    @pytest.mark.parametrize(("steps", "passes"), [(14, True), (15, False)])
    def test_a_step_over_zero_is_a_fall_to_zero(self, sign: int, steps: int, passes: bool) -> None:
        one = bench(fall_per_s=5.0)
        one.ramp(sign * steps, near_far=float(sign))
        # 0.1 and a step and a half are 14 steps
        assert ("limit=fall" in one.sends(-sign, near_far=-float(sign))) is not passes

    @signs
    def test_a_step_over_zero_against_the_stick(self, sign: int) -> None:
        one = bench(fall_per_s=5.0)
        one.ramp(sign * 13, near_far=float(sign))
        assert "limit=asked" in one.sends(-sign, near_far=float(sign))

    @signs
    def test_a_small_step_over_zero_takes_a_part_of_the_tick(self, sign: int) -> None:
        one = bench(rise_per_s=5.0, fall_per_s=5.0)
        one.ramp(sign * 6, near_far=float(sign))
        # 0.048 less a step is 0.4 of the tick; what is left of 0.1, and a step and a half
        assert not one.sends(-sign * 9, near_far=-float(sign))
        one = bench(rise_per_s=5.0, fall_per_s=5.0)
        one.ramp(sign * 6, near_far=float(sign))
        assert "limit=rise allowed=0.072" in one.sends(-sign * 10, near_far=-float(sign))

    @signs
    @pytest.mark.parametrize(("steps", "passes"), [(64, True), (65, False)])
    def test_a_valve_of_three_ticks_rises_by_three_ticks(
        self, sign: int, steps: int, passes: bool
    ) -> None:
        slow = limited(variants.machine("slow-valves")[1], "near_far", deadband_pct=0.0)
        one = Bench(slow, "near_far")

        def turn(steps: int, at: float) -> str:
            why = one.sends(steps, near_far=at)
            for _ in range(2):
                one.skips(near_far=at)
            return why

        for size, at in ((0, 0.0), (0, 0.0), (0, float(sign)), (25, float(sign))):
            assert not turn(sign * size, at)
        # 0.2, a step, 5 per second in 60 ms, and half a step
        assert (turn(sign * steps, float(sign)) == "") is passes

    @signs
    def test_by_a_curve_rounding_is_as_coarse_as_its_steepest_part(self, sign: int) -> None:
        curve = {"curve_command_pct": [-100, -50, -1, 1, 50, 100]}
        one = bench(**curve, curve_speed_pct=[-100, -20, 0, 0, 20, 100], rise_per_s=5.0)
        one.rests()
        why = one.sends(sign * 100, near_far=float(sign))
        # 1.6 / 125 of full speed in a step: one and a half of them, and the rise
        assert f"limit=rise allowed=0.119 speed={sign * 0.68:.3f}" in why


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
