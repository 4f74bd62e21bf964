"""Rules 4, 6 and 7 in a motion of two axes: what one adds to the other."""

from typing import Any

import pytest

from canshaper.gate.build import SWING_SLACK
from tests.gate.bench import Bench, limited, load, signs

FULL = 125


@signs
def test_what_a_motion_may_go_on_counts_for_its_axis(sign: int) -> None:
    free = {"deadband_pct": 0.0, "rise_per_s": 100.0, "fall_per_s": 100.0, "stop_distance_m": None}
    one = Bench(limited(load("forwarder-robust"), "near_far", **free), "near_far")
    one.rests()
    for _ in range(5):
        assert not one.sends(sign * FULL, near_far=float(sign))
    left = [one.sends(sign * FULL) for _ in range(110)]
    first = [bool(why) for why in left].index(True)
    assert first * 0.02 == pytest.approx(SWING_SLACK + 0.3, abs=0.021)
    assert "limit=distance" in left[first]


class TestAdded:
    """Slew and near-far of forwarder-robust add velocities to each other."""

    def robust(self, axis: str = "near_far", **limits: Any) -> Bench:
        free = {"deadband_pct": 0.0, "rise_per_s": 100.0, "fall_per_s": 100.0} | limits
        return Bench(limited(load("forwarder-robust"), axis, **free), axis)

    @signs
    @pytest.mark.parametrize("axis", ["slew", "near_far"])
    def test_as_fast_as_the_file_says(self, sign: int, axis: str) -> None:
        other = {"slew": "near_far", "near_far": "slew"}[axis]
        for steps, passes in ((31, True), (32, False)):  # 25 %
            one = self.robust(axis)
            one.rests()
            why = one.sends(sign * steps, **{other: 1.0})
            assert ("limit=asked allowed=0.250" in why) is not passes

    @signs
    @pytest.mark.parametrize(("steps", "passes"), [(31, True), (32, False)])
    def test_behind_its_stopping_distance_too(self, sign: int, steps: int, passes: bool) -> None:
        one = self.robust(stop_distance_m=0.29)
        one.ramp(sign * FULL, near_far=float(sign))
        assert not any(one.sends(sign * FULL, slew=1.0) for _ in range(20))
        assert not one.sends(0, slew=1.0)
        why = one.sends(sign * steps, slew=1.0)
        assert ("limit=stop_distance_m" in why) is not passes

    @signs
    def test_not_against_a_stick_that_is_held(self, sign: int) -> None:
        one = self.robust()
        one.rests()
        assert "limit=asked" in one.sends(-sign * 10, slew=1.0, near_far=sign * 0.3)

    @signs
    def test_not_against_it_by_what_was_asked_before_a_trip(self, sign: int) -> None:
        one = self.robust()
        one.ramp(sign * 60, near_far=sign * 0.5)
        one.sends(0, enable=False)
        one.rests()
        assert not one.sends(sign * 60, slew=1.0)
        one.rests(slew=1.0)
        assert "limit=asked allowed=0.000" in one.sends(sign * 10, slew=1.0, near_far=-sign * 0.3)

    @signs
    def test_where_it_is_asked_nothing_is_added(self, sign: int) -> None:
        one = self.robust()
        one.rests()
        why = one.sends(sign * 31, slew=1.0, near_far=sign * 0.1)
        assert "limit=asked allowed=0.100" in why

    @signs
    def test_where_the_file_allows_it_faster_in_a_motion_too(self, sign: int) -> None:
        one = self.robust(allow_faster=True)
        one.rests()
        assert not one.sends(sign * 125, slew=1.0, near_far=sign * 0.1)

    @signs
    def test_without_a_demand_nothing_is_added(self, sign: int) -> None:
        one = self.robust()
        for _ in range(3):  # from the first tick on
            assert "limit=asked" in one.sends(sign * 10)
            one.sends(0, enable=False)

    @signs
    def test_to_and_fro_it_goes_on_and_one_way_no_farther(self, sign: int) -> None:
        one = self.robust(stop_distance_m=None, tail_s=4.0)
        one.axis.of.slack = 0.4
        one.rests()
        for side in [sign] * 5 + [-sign] * 5:
            assert not one.sends(side * FULL, near_far=float(side))
        for side in ([sign] * 10 + [-sign] * 10) * 5:  # 1 s of each
            assert not one.sends(side * FULL)
        left = [one.sends(sign * FULL) for _ in range(60)]
        first = [bool(why) for why in left].index(True)
        assert first * 0.02 == pytest.approx(0.4 + 0.3, abs=0.021)
        assert "limit=distance" in left[first]

    def test_as_far_as_the_file_says(self) -> None:
        one = self.robust()
        one.rests()
        left = [one.sends(31, slew=1.0) for _ in range(200)]
        first = [bool(why) for why in left].index(True)
        assert "near_far limit=path of added velocity speed=" in left[first]
        # a tenth more than 0.3 m, and 0.01 s, in steps of 0.248 * 0.02
        assert (first, one.axis.of.full_m_s) == (68, 1.0)
        assert one.axis.of.path_m == 0.3
        one = self.robust()
        one.rests()
        assert not any(one.sends(31 if n // 20 % 2 else -31, slew=1.0) for n in range(200))

    def test_as_long_as_the_file_says(self) -> None:
        one = self.robust("slew")
        one.rests()
        left = [one.sends(10, near_far=1.0) for _ in range(400)]
        first = [bool(why) for why in left].index(True)
        assert "slew limit=time of added velocity speed=" in left[first]
        assert first == round(6.0 / 0.02) + 2

    def test_it_ends_at_once_where_the_other_one_stops(self) -> None:
        one = Bench(limited(load("forwarder-robust"), "near_far", deadband_pct=0.0), "near_far")
        one.rests()
        for steps in (10, 20, 31):
            assert not one.sends(steps, slew=1.0)
        slew = one.gate.axes["slew"]
        assert one.axis.dropped(one.gate.made) == 0.25  # at rest: when it stopped is not known
        slew.last = 0.5
        assert one.axis.dropped(one.gate.made) == 0.0
        slew.halt("refused", one.gate.made, one.gate.frames)
        assert one.axis.dropped(one.gate.made) == 1.0
        one.axis.of.period = 3
        assert one.axis.dropped(one.gate.made + 6) == 1.0
        assert one.axis.dropped(one.gate.made + 7) == 0.0

    @signs
    @pytest.mark.parametrize(
        ("slew", "stops", "steps", "passes"),
        # 0.48 less 0.1, a step and a half; less 0.25 too where it is not known whether slew stopped
        [(0.5, False, 46, True), (0.5, False, 45, False), (0.0, False, 15, True),
         (0.0, False, 14, False), (0.5, True, 1, True)],
    )  # fmt: skip
    def test_it_falls_where_the_other_one_stops(
        self, sign: int, slew: float, stops: bool, steps: int, passes: bool
    ) -> None:
        one = self.robust(fall_per_s=5.0)
        one.ramp(sign * 60, near_far=sign * 0.5)
        other = one.gate.axes["slew"]
        if not slew:
            other.left(0.0, one.gate.made, one.number)
        other.last, other.sent_at = slew, one.number
        if stops:
            other.armed = False  # on its run-on
            one.gate.refused(other.of.valve)
        why = one.sends(sign * steps, near_far=sign * 0.5)
        assert ("limit=fall" in why) is not passes

    @signs
    @pytest.mark.parametrize(("later", "passes"), [(0, True), (1, True), (2, False)])
    def test_it_falls_in_two_ticks_or_no_more(self, sign: int, later: int, passes: bool) -> None:
        one = self.robust(fall_per_s=5.0)
        one.ramp(sign * 60, near_far=sign * 0.5)
        other = one.gate.axes["slew"]
        one.gate.refused(other.of.valve)
        other.last, other.sent_at = 0.5, one.number
        for _ in range(later):
            assert not one.sends(sign * 60, near_far=sign * 0.5)
        assert ("limit=fall" in one.sends(sign * 20, near_far=sign * 0.5)) is not passes

    @signs
    @pytest.mark.parametrize(("steps", "goes_on"), [(44, True), (45, False)])
    def test_to_neutral_by_what_is_added_and_a_fall(
        self, sign: int, steps: int, goes_on: bool
    ) -> None:
        one = self.robust(fall_per_s=4.8)
        one.ramp(sign * steps, near_far=sign * 0.5)
        assert not one.sends(0, near_far=sign * 0.5)
        assert one.axis.armed is goes_on

    @signs
    def test_while_both_are_asked_there_is_no_end(self, sign: int) -> None:
        one = self.robust()
        one.ramp(sign * FULL, near_far=float(sign))
        assert not any(one.sends(sign * FULL, near_far=float(sign), slew=1.0) for _ in range(250))

    def test_a_pause_is_no_part_of_its_time(self) -> None:
        one = self.robust("slew")
        one.rests()
        assert not any(one.sends(10 * (k % 2), near_far=1.0) for k in range(450))

    def test_a_motion_of_slew_alone_moves_nothing_else(self) -> None:
        one = Bench(load("forwarder"), "near_far")
        assert not one.axis.of.added
        assert one.axis.partner is None
