"""Rule 7: how far an axis goes, by itself and by what a motion adds."""

import math
from types import SimpleNamespace

import pytest

from canshaper.gate.axis import BLEND_S, Asked
from canshaper.gate.build import SLACK, SWING_SLACK, slack_of
from canshaper.shaping.registry import BUILT_IN
from tests.gate.bench import bench, load, signs
from tests.promises.world import World

FULL = 125


class TestDistance:
    """Rule 7: a wrong filter drives no farther than was asked, and a little."""

    @signs
    def test_after_a_tap(self, sign: int) -> None:
        one = bench(tail_s=2.0)
        one.rests()
        for _ in range(5):
            assert not one.sends(sign * FULL, near_far=float(sign))
        left = [one.sends(sign * FULL) for _ in range(120)]
        first = [bool(why) for why in left].index(True)
        assert first * 0.02 == pytest.approx(SWING_SLACK, abs=0.021)
        assert "limit=distance" in left[first]

    @signs
    def test_a_small_demand_gives_no_more_than_it_is(self, sign: int) -> None:
        one = bench(tail_s=2.0)
        one.rests()
        for _ in range(5):
            assert not one.sends(sign * FULL, near_far=float(sign))
        left = [one.sends(sign * FULL, near_far=sign * 0.1) for _ in range(95)]
        first = [bool(why) for why in left].index(True)
        assert first * 0.02 * 0.9 == pytest.approx(SWING_SLACK, abs=0.021)
        assert "limit=distance" in left[first]

    @signs
    @pytest.mark.parametrize("after", [0.0, 0.3])
    def test_no_farther_than_the_file_says(self, sign: int, after: float) -> None:
        """Beyond the demand; a new stroke has the whole way again."""
        one = bench(tail_s=2.0, stop_distance_m=0.5)  # at 1 m/s
        for _ in range(2):
            one.ramp(sign * FULL, near_far=float(sign))
            assert not any(one.sends(sign * FULL, near_far=sign * after) for _ in range(24))
        left = [one.sends(sign * FULL, near_far=sign * after) for _ in range(30)]
        first = [bool(why) for why in left].index(True)
        assert (24 + first) * 0.02 * (1.0 - after) == pytest.approx(0.5, abs=0.021)
        assert "limit=stop_distance_m allowed=0.500" in left[first]

    @signs
    def test_behind_it_a_frame_as_fast_as_asked_leaves(self, sign: int) -> None:
        one = bench(tail_s=2.0, stop_distance_m=0.49)
        one.ramp(sign * FULL, near_far=float(sign))
        assert not any(one.sends(sign * FULL) for _ in range(25))
        assert one.axis.ran > 0.49
        assert not one.sends(-sign * 37, near_far=-sign * 0.3)

    @signs
    @pytest.mark.parametrize(("steps", "at", "more"), [(FULL, 1.0, 24), (0, 0.0, 5)])
    def test_what_is_asked_again_begins_it_and_a_pause_does_not(
        self, sign: int, steps: int, at: float, more: int
    ) -> None:
        one = bench(tail_s=2.0, stop_distance_m=0.5)
        one.ramp(sign * FULL, near_far=float(sign))
        assert not any(one.sends(sign * FULL) for _ in range(20))
        assert not any(one.sends(sign * steps, near_far=sign * at) for _ in range(3))
        left = [one.sends(sign * FULL) for _ in range(30)]
        assert [bool(why) for why in left].index(True) == pytest.approx(more, abs=2)

    @signs
    def test_what_falls_goes_on(self, sign: int) -> None:
        one = bench(tail_s=2.0, stop_distance_m=0.5, fall_per_s=4.8)
        one.ramp(sign * FULL, near_far=float(sign))
        for _ in range(25):
            assert not one.sends(sign * FULL)
        # as slowly as may be: 12 steps in a tick, but for one of rounding
        for steps in range(FULL - 11, 0, -11):
            assert not one.sends(sign * steps)
            assert one.axis.ran >= 0.5

    @signs
    def test_each_stroke_has_its_own_slack(self, sign: int) -> None:
        """An S-curve makes more of each tap than it is, also where tap follows tap."""
        one = bench(tail_s=2.0)
        one.rests()
        for _ in range(6):
            for _ in range(5):
                assert not one.sends(sign * FULL, near_far=float(sign))
            for _ in range(35):
                assert not one.sends(sign * FULL)

    def test_while_it_is_asked_there_is_no_end(self) -> None:
        one = bench()
        one.ramp(FULL, near_far=1.0)
        assert not any(one.sends(FULL, near_far=1.0) for _ in range(500))

    def test_what_was_not_run_is_owed_for_the_tail_only(self) -> None:
        one = bench(tail_s=1.0)
        one.rests()
        for _ in range(500):
            assert not one.sends(0, near_far=1.0)
        assert one.axis.forth.remaining == pytest.approx(1.0)

    @signs
    def test_over_missed_deadlines_the_demand_before_was_held(self, sign: int) -> None:
        one = bench()
        one.rests()
        asked = one.axis.forth if sign > 0 else one.axis.back
        for missed, at, remaining in ((0, 0.5, 0.01), (3, 0.5, 0.05), (2, 0.1, 0.072)):
            assert not one.sends(0, missed=missed, near_far=sign * at)
            assert asked.remaining == pytest.approx(remaining)

    @signs
    def test_a_turn_without_a_frame_counts(self, sign: int) -> None:
        one = bench(stop_distance_m=4.0)
        one.ramp(sign * 60, near_far=sign * 0.48)
        assert not one.sends(sign * 60)
        asked = one.axis.forth if sign > 0 else one.axis.back
        ran, remaining = one.axis.ran, asked.remaining
        one.skips()
        assert not one.sends(sign * 60)
        assert one.axis.ran - ran == pytest.approx(0.48 * 0.04)
        assert remaining - asked.remaining == pytest.approx(0.48 * 0.04)

    @signs
    def test_a_fall_from_what_was_asked_counts_no_distance(self, sign: int) -> None:
        one = bench(fall_per_s=4.8)  # 12 steps in a tick, each 0.008
        one.rests()
        assert one.axis.way_back == pytest.approx(0.008)
        one.ramp(sign * 60, near_far=sign * 0.48)
        asked = one.axis.forth if sign > 0 else one.axis.back
        before = asked.remaining
        assert not one.sends(sign * 49)  # but for a step of rounding
        assert asked.remaining == before
        one.skips()
        assert not one.sends(sign * 49)
        assert one.axis.way_back == pytest.approx(25 * 0.008)
        assert before - asked.remaining == pytest.approx(49 * 0.008 * 0.04)
        one.sends(0)
        assert one.axis.way_back == pytest.approx(0.008)

    @signs
    @pytest.mark.parametrize(("forth", "back"), [(6, 9), (13, 1)])
    def test_the_first_frame_of_the_other_way_counts(
        self, sign: int, forth: int, back: int
    ) -> None:
        one = bench(rise_per_s=5.0, fall_per_s=5.0)
        one.ramp(sign * forth, near_far=float(sign))
        assert not one.sends(-sign * back, near_far=-float(sign))
        asked = one.axis.back if sign > 0 else one.axis.forth
        assert asked.remaining == pytest.approx((1.0 - 0.008 * back) * 0.02)

    @signs
    def test_what_fades_is_added_to_what_was_not_run(self, sign: int) -> None:
        one = bench()
        one.ramp(sign * 60, near_far=float(sign))
        asked = one.axis.forth if sign > 0 else one.axis.back
        before = asked.remaining
        assert before > 0.1
        one.axis.change_filter()
        assert asked.remaining - before == pytest.approx(0.48 * BLEND_S)

    @signs
    def test_a_saw_tooth_counts_its_falls(self, sign: int) -> None:
        """Only the way back from what was asked last is free."""
        one = bench(tail_s=2.0, fall_per_s=5.0)
        one.rests()
        for _ in range(5):
            assert not one.sends(sign * FULL, near_far=float(sign))
        left = [one.sends(sign * (FULL - 12 * (k % 2))) for k in range(120)]
        first = [bool(why) for why in left].index(True)
        assert first * 0.02 <= SWING_SLACK + 0.06
        assert "limit=distance" in left[first]

    @signs
    def test_a_bypass_changes_nothing_but_what_fades(self, sign: int) -> None:
        """Each switching of anti-sway lets the velocity fade; the way in a bypass counts."""
        one = bench(tail_s=2.0)
        one.rests()
        for _ in range(5):
            one.receive(one.joysticks(anti_sway=False, near_far=float(sign)))
            assert not one.sent(sign * FULL)
        left = [one.sends(sign * FULL) for _ in range(120)]
        first = [bool(why) for why in left].index(True)
        assert first * 0.02 == pytest.approx(SWING_SLACK + BLEND_S, abs=0.021)

    def test_only_filters_that_damp_run_ahead(self) -> None:
        assert {kind.name for kind in BUILT_IN if kind.runs_ahead} == {"gff", "robust"}

    @pytest.mark.parametrize(("ahead", "slack"), [(False, SLACK), (True, SWING_SLACK)])
    def test_a_filter_has_the_slack_that_its_kind_says(self, ahead: bool, slack: float) -> None:
        own = SimpleNamespace(runs_ahead=ahead)
        config = load("forwarder").axes["lift"].config.model_copy(update={"filter": own})
        assert slack_of(config) == slack

    def test_what_spreads_the_demand_has_less(self) -> None:
        """A filter that knows of no swing damps none."""
        axes = load("forwarder").axes
        assert slack_of(axes["lift"].config) == SLACK
        assert slack_of(axes["slew"].config) == SWING_SLACK
        lift = axes["lift"].config
        for key in ("allow_faster", "allow_reverse"):
            limits = lift.limits.model_copy(update={key: True})
            assert slack_of(lift.model_copy(update={"limits": limits})) == math.inf
        for key in ("gain_schedule", "profiles", "sway_sensor"):
            assert slack_of(lift.model_copy(update={key: [1]})) == SWING_SLACK


def refusals(world: World, ticks: int, **stick: float) -> list[str]:
    """Hold the sticks so; return what the gate refuses of the sound controller."""
    world.go(ticks, **stick)
    return world.refusals()


def test_a_stop_forgets_what_may_run_on_and_not_what_was_asked() -> None:
    """A motion may add by every demand within the tail, each for its own time."""
    of, asked = bench(tail_s=0.2).axis.of, Asked()
    for period, size in enumerate((1.0, 0.5, 0.3, 0.3)):
        asked.note(size, size * 0.02, period, of)
    asked.forget()
    assert (asked.most, asked.remaining, asked.before) == (0.0, 0.0, 1.0)
    seen = []
    for period in range(4, 16):
        asked.note(0.1 if period == 5 else 0.0, 0.0, period, of)
        seen.append((asked.before, asked.most))
    assert seen == [
        *[(1.0, 0.0), *[(1.0, 0.1)] * 6],
        *[(0.5, 0.1), (0.3, 0.1), (0.3, 0.1), (0.1, 0.1), (0.1, 0.1)],
    ]


def test_what_ran_too_far_is_forgotten_with_the_tail() -> None:
    of, asked = bench(tail_s=0.2).axis.of, Asked()
    asked.note(1.0, 0.02, 0, of)
    asked.remaining -= 1.0
    for period in range(1, 12):
        assert asked.remaining < 0.0
        asked.note(0.0, 0.0, period, of)
    assert asked.remaining == 0.0


class TestSound:
    """Sequences in which a sound filter goes farthest beyond what was asked."""

    def test_taps_in_the_time_of_the_swing(self) -> None:
        world = World("forwarder")
        assert not refusals(world, 25)
        for _ in range(9):
            assert not refusals(world, 8, slew=1.0)
            assert not refusals(world, 98)

    def test_a_tap_after_a_long_way_back(self) -> None:
        world = World("forwarder")
        assert not refusals(world, 25)
        for slew, ticks in ((-1.0, 178), (0.04, 12), (0.87, 1), (0.0, 1), (0.04, 55), (0.0, 60)):
            assert not refusals(world, ticks, slew=slew)

    def test_what_a_bypass_has_left(self) -> None:
        world = World("forwarder-robust")
        assert not refusals(world, 25)
        for _ in range(3):
            world.raw = {"left": {"AntiSwayOff": 1}}
            assert not refusals(world, 60, slew=1.0)
            assert not refusals(world, 5)
            world.raw = {}
            assert not refusals(world, 120)
        assert not refusals(world, 40, slew=1.0)
        assert not refusals(world, 120)

    @pytest.mark.parametrize(("wait", "slew", "ticks"), [(20, 0.5, 80), (60, -1.0, 40)])
    def test_what_trips_have_left(self, wait: int, slew: float, ticks: int) -> None:
        """A demand of before a trip bounds the velocity that a motion adds after it."""
        world = World("forwarder-robust")
        assert not refusals(world, 25)
        for _ in range(3):
            assert not refusals(world, 90 if slew < 0.0 else 30, slew=1.0)
            world.enable = 0
            assert not refusals(world, 3)
            world.enable = 1
            assert not refusals(world, wait)
        assert not refusals(world, ticks, slew=slew)
        assert not refusals(world, 120)

    @pytest.mark.parametrize(("period_s", "slack"), [(2.9, SWING_SLACK), (10.0, 5.0)])
    def test_a_slow_swing_takes_longer_to_damp(self, period_s: float, slack: float) -> None:
        config = load("forwarder").axes["slew"].config
        assert config.sway is not None
        sway = config.sway.model_copy(update={"period_s": period_s, "damping_ratio": 0.0})
        assert slack_of(config.model_copy(update={"sway": sway})) == pytest.approx(slack)

    def test_of_a_rope_the_longest_counts(self) -> None:
        config = load("bridge-crane").axes["bridge"].config
        assert slack_of(config) == pytest.approx(math.pi * math.sqrt(30.0 / 9.81), rel=1e-4)
