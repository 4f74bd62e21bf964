"""Rules 5 and 6: rise and fall.

Full command is 125 steps without a dead band here, a step 0.008 of full speed.
"""

import pytest

from canshaper.gate.rules import rise
from tests.faults import variants
from tests.gate.bench import Bench, bench, limited, signs


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
