"""Rules 1 to 7: what may move, how fast and how far, and what the log says where it may not.

Full command is 125 steps without a dead band here, a step 0.008 of full speed.
"""

from dataclasses import replace
from typing import Any

import pytest

from canshaper.gate.axis import FOREIGN_NS
from canshaper.gate.rules import LATE, SLACK
from tests.faults import variants
from tests.gate.bench import Bench, bench, limited, load, signs

FULL = 125


@signs
def test_neutral_comes_first(sign: int) -> None:
    one = bench()
    assert "limit=stopped why=start" in one.sends(sign * 5, near_far=float(sign))
    assert not one.restarts(sign * 5, near_far=float(sign))


@signs
def test_from_neutral_it_moves(sign: int) -> None:
    one = bench()
    one.rests()
    assert not one.sends(sign * 50, near_far=sign * 0.5)


class TestStopsAtOnce:
    """Rule 1: nothing leaves in the same tick, and nothing moves again without a reset."""

    def moving(self, **limits: Any) -> Bench:
        one = bench(**limits)
        one.ramp(60, near_far=1.0)
        return one

    def test_enable_is_released(self) -> None:
        one = self.moving()
        assert "limit=stopped why=enable" in one.sends(60, near_far=1.0, enable=False)

    def test_enable_was_released_for_one_frame_only(self) -> None:
        one = self.moving()
        one.receive(one.joysticks(near_far=1.0, enable=False))
        assert "why=enable" in one.sends(60, near_far=1.0)

    def test_what_a_frame_says_after_the_tick_began_counts_for_the_next_frame(self) -> None:
        one = self.moving()
        one.receive(one.joysticks(near_far=1.0))
        one.gate.tick(one.now_ns, 0)
        one.receive(one.joysticks(near_far=1.0, enable=False))
        assert "why=enable" in one.gate.leaving(one.key, one.frame(60))

    def test_a_second_sender(self) -> None:
        one = self.moving()
        one.gate.receive(one.key, bytes(2), one.now_ns)
        assert "why=second sender" in one.sends(60, near_far=1.0)
        start = one.number
        while (one.number - start) * 20_000_000 <= FOREIGN_NS:
            one.sends(0, enable=one.number % 2 == 0)
            assert not one.axis.armed
        one.sends(0, enable=False)
        one.rests()
        assert one.axis.armed

    def test_a_frame_that_did_not_get_out(self) -> None:
        one = self.moving()
        one.gate.send_failed(one.key)
        assert "why=send failed" in one.sends(60, near_far=1.0)

    def test_a_loop_that_stood_still(self) -> None:
        one = self.moving()
        one.gate.stalled()
        assert "limit=stopped" in one.sends(60, near_far=1.0)

    def test_what_has_waited_does_not_count_but_bad_news(self) -> None:
        one = bench()
        one.rests()
        one.gate.stalled()
        one.receive(one.joysticks(near_far=0.5))
        one.receive(one.joysticks(enable=False))
        one.receive(one.joysticks())
        assert "limit=stopped" in one.sent(10)
        assert one.axis.joystick.press < 0

    def test_decoders_disagree(self) -> None:
        one = self.moving()
        one.gate.disagrees([one.axis])
        assert "why=decoders disagree" in one.sends(60, near_far=1.0)

    @pytest.mark.parametrize("how", ["enable", "sender", "send", "loop", "refused"])
    def test_latched_it_does_not_move_until_a_press(self, how: str) -> None:
        one = self.moving()
        if how == "enable":
            one.sends(0, near_far=1.0, enable=False)
        elif how == "sender":
            one.gate.receive(one.key, bytes(2), one.now_ns)
            one.number += FOREIGN_NS // 20_000_000
        elif how == "send":
            one.gate.send_failed(one.key)
        elif how == "loop":
            one.gate.stalled()
        else:
            assert one.sends(-FULL, near_far=1.0)
        if how != "enable":  # neutral alone is no reset
            one.rests(10)
            assert not one.restarts(10, near_far=0.5)
            one.rests(10, enable=False)
        one.rests(10)
        assert not one.sends(10, near_far=0.5)

    def test_a_press_before_it_is_no_reset(self) -> None:
        one = bench()
        one.rests(3)
        one.rests(3, enable=False)
        one.ramp(60, near_far=1.0)
        assert one.sends(-FULL, near_far=1.0)
        one.rests(10)
        assert not one.restarts(10, near_far=0.5)

    def test_a_reset_is_a_press_too(self) -> None:
        one = self.moving()
        assert one.sends(-FULL, near_far=1.0)
        one.rests(5)
        one.rests(5, reset=True)
        assert not one.sends(10, near_far=0.5)

    def test_a_reset_that_waited_in_a_standstill_is_none(self) -> None:
        one = self.moving()
        assert one.sends(-FULL, near_far=1.0)
        one.rests(5)
        one.gate.stalled()
        one.receive(one.joysticks(reset=True))
        one.rests(5, reset=True)
        assert not one.restarts(10, near_far=0.5)

    def test_at_rest_it_latches_nothing_but_waits_for_neutral(self) -> None:
        one = bench()
        one.rests()
        one.gate.send_failed(one.key)
        one.gate.send_failed(("crane", 0x7FF, False))
        one.rests(3, near_far=0.5, enable=False)
        assert "limit=stopped" in one.sends(10, near_far=0.5)
        one.rests()  # a refusal latches; what stopped it before did not
        one.rests(3, enable=False)
        one.rests()
        assert not one.sends(10, near_far=0.5)

    def test_the_emergency_stop_latches_at_rest_too(self) -> None:
        one = Bench(variants.machine("protected")[1], "near_far")
        one.rests(10)
        stop = one.deployment.emergency_stop
        assert stop is not None
        assert stop.protection.check is not None
        for frame in one.joysticks():
            if frame[:3] == stop.key:
                pressed = frame._replace(data=stop.protection.check.protect(b"\1\1", 0))
                one.gate.receive(stop.key, pressed.data, one.now_ns)
        one.rests(10)
        assert "why=emergency stop" in one.sends(10, near_far=1.0)
        one.rests(10, enable=False)
        one.rests(10)
        assert not one.sends(10, near_far=1.0)

    def test_an_emergency_stop_that_is_not_received(self) -> None:
        one = Bench(variants.machine("protected")[1], "near_far")
        one.ramp(60, near_far=1.0)
        stop = one.deployment.emergency_stop
        assert stop is not None
        one.change = lambda frame: None if frame[:3] == stop.key else frame
        left = [one.sends(60, near_far=1.0) for _ in range(20)]
        first = next(number for number, why in enumerate(left) if why)
        assert first in range(5, 9)  # 140 ms, of a frame that came up to 40 ms before
        assert "why=emergency stop" in left[first]

    def test_another_switch_that_enables_is_lost(self) -> None:
        one = Bench(variants.machine("switches")[1], "slew")
        one.ramp(60, slew=1.0)
        others = {one.of.message for one in one.axis.joystick.others}
        keys = {
            key
            for key, message in one.gate.ids.items()
            if message.of.name in others and not message.axes
        }
        assert keys
        one.change = lambda frame: None if frame[:3] in keys else frame
        left = [one.sends(60, slew=1.0) for _ in range(60)]
        assert "why=enable" in next(filter(None, left))


class TestStopsShaped:
    """Rule 2: for ``stop_s`` it may fall, and then neutral comes first."""

    def silent(self, one: Bench, ticks: int) -> list[str]:
        return [one.sent(60) for _ in range(ticks)]

    def test_silence(self) -> None:
        one = bench(stop_s=1.0)
        one.ramp(60, near_far=1.0)
        left = self.silent(one, 80)
        # timeout_ms and stop_s
        assert [bool(why) for why in left].index(True) == (100 + 1000) // 20
        assert not one.restarts(10, near_far=0.5)

    @pytest.mark.parametrize("fault", ["error", "enable", "counter", "jump"])
    def test_what_a_joystick_may_say_wrong(self, fault: str) -> None:
        one = Bench(limited(load("forwarder"), "near_far", stop_s=0.5), "near_far")
        one.ramp(60, near_far=1.0)

        def change(frame: Any) -> Any:
            data = bytearray(frame.data)
            if fault == "error":
                data[2:4] = (0x7FFF).to_bytes(2, "little")
            elif fault == "enable":
                data[4] |= 3
            elif fault == "counter":
                data[7] = 0
            else:
                data[7] = data[7] * 5 & 0xFF
            return frame._replace(data=bytes(data))

        one.change = change
        left = [one.sends(60, near_far=1.0) for _ in range(60)]
        first = [bool(why) for why in left].index(True)
        at_once = fault in ("error", "enable")
        assert first == 25 if at_once else 25 < first < 32
        assert "limit=stopped why=joystick" in left[first]

    def test_a_stick_that_stands_still(self) -> None:
        deployment = load("forwarder")
        left = deployment.joysticks["left"]
        config = left.config.model_copy(update={"stuck_s": 1.0})
        joysticks = {**deployment.joysticks, "left": replace(left, config=config)}
        one = Bench(replace(deployment, joysticks=joysticks), "near_far")
        one.ramp(60, near_far=0.5)
        armed = []
        for _ in range(60):
            assert not one.sends(60, near_far=0.5)
            armed.append(one.axis.armed)
        assert armed.index(False) == 50 - 15 + 1  # stuck_s, less the ramp

    def test_in_neutral_it_may_stand_still(self) -> None:
        one = bench()
        one.rests(1200)
        assert not one.sends(10, near_far=0.5)


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
    def test_the_other_way_as_fast_as_was_asked_only(self, sign: int) -> None:
        one = bench(allow_reverse=True)
        one.rests()
        for now in (0.4, 0.3, 0.0):
            assert not one.sends(0, near_far=sign * now)
        assert not one.sends(-sign * 50)
        assert "limit=asked allowed=0.400" in one.sends(-sign * 51)

    @signs
    def test_a_reversal_may_be_braked_along_the_filter(self, sign: int) -> None:
        one = bench(reversal="brake_shaped")
        one.ramp(sign * 60, near_far=sign * 0.5)
        assert not one.sends(sign * 60, near_far=-sign * 0.5)
        one = bench()
        one.ramp(sign * 60, near_far=sign * 0.5)
        one.gate.late = -LATE
        assert "limit=asked" in one.sends(sign * 60, near_far=-sign * 0.5)

    @signs
    def test_after_a_missed_deadline_it_may_run_on_against_the_stick_once(self, sign: int) -> None:
        one = bench(tail_s=1.0)
        one.ramp(sign * 60, near_far=sign * 0.5)
        assert not one.sends(sign * 60, missed=1, near_far=-sign * 0.5)
        assert not one.axis.armed
        left = [one.sends(sign * 60, near_far=-sign * 0.5) for _ in range(60)]
        assert any(left)


class TestRates:
    """Rules 5 and 6."""

    @signs
    @pytest.mark.parametrize(("steps", "passes"), [(36, True), (37, False)])
    def test_faster_than_the_last_by_the_rise(self, sign: int, steps: int, passes: bool) -> None:
        one = bench(rise_per_s=4.0)  # 0.08 in a tick
        one.ramp(sign * 25, near_far=float(sign))
        why = one.sends(sign * steps, near_far=float(sign))
        # 0.2, a step, the rise, and half a step
        assert ("limit=rise allowed=0.292" in why) is not passes

    @signs
    def test_missed_deadlines_give_no_more_rise(self, sign: int) -> None:
        one = bench(rise_per_s=4.0)
        one.ramp(sign * 25, near_far=float(sign))
        assert "limit=rise" in one.sends(sign * 37, missed=5, near_far=float(sign))

    @signs
    @pytest.mark.parametrize(("steps", "passes"), [(80, True), (79, False)])
    def test_slower_than_the_last_by_the_fall(self, sign: int, steps: int, passes: bool) -> None:
        one = bench(fall_per_s=2.0)  # 0.04 in a tick
        one.ramp(sign * 86, near_far=float(sign))
        why = one.sends(sign * steps, near_far=float(sign))
        assert ("limit=fall" in why) is not passes

    @signs
    def test_a_fall_to_neutral_is_a_stop(self, sign: int) -> None:
        one = bench(fall_per_s=2.0)
        one.ramp(sign * 60, near_far=float(sign))
        assert not one.sends(0, near_far=float(sign))
        assert not one.axis.armed
        assert "why=fell to neutral at once" in one.sends(sign * 5, near_far=float(sign))

    @signs
    def test_the_other_way_by_way_of_zero(self, sign: int) -> None:
        one = bench(fall_per_s=2.0)
        one.ramp(sign * 60, near_far=float(sign))
        assert "limit=rise allowed=0.012" in one.sends(-sign * 60, near_far=-float(sign))

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
                one.receive(one.joysticks(near_far=at))
                one.gate.tick(one.now_ns, 0)
                one.number += 1
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
        assert first * 0.02 == pytest.approx(SLACK, abs=0.021)
        assert "limit=distance" in left[first]

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

    def test_after_a_bypass_the_filter_runs_what_was_run_in_it(self) -> None:
        one = bench(tail_s=2.0)
        one.rests()
        for _ in range(5):
            one.receive(one.joysticks(anti_sway=False, near_far=1.0))
            assert not one.sent(FULL)
        assert not any(one.sends(FULL) for _ in range(80))


class TestAdded:
    """What slew and near-far of forwarder-robust add to each other."""

    def robust(self, axis: str = "near_far") -> Bench:
        free = {"deadband_pct": 0.0, "rise_per_s": 100.0, "fall_per_s": 100.0}
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
    def test_not_against_a_stick_that_is_held(self, sign: int) -> None:
        one = self.robust()
        one.rests()
        assert "limit=asked" in one.sends(-sign * 10, slew=1.0, near_far=sign * 0.3)

    @signs
    def test_without_a_demand_nothing_is_added(self, sign: int) -> None:
        one = self.robust()
        one.rests()
        assert "limit=asked" in one.sends(sign * 10)

    def test_as_far_as_the_file_says(self) -> None:
        one = self.robust()
        one.rests()
        left = [one.sends(31, slew=1.0) for _ in range(200)]
        first = [bool(why) for why in left].index(True)
        assert "limit=path" in left[first]
        way_m = first * 0.02 * 0.248 * one.axis.of.full_m_s
        assert way_m == pytest.approx(1.1 * one.axis.of.path_m, abs=0.02)
        assert one.axis.of.path_m == 0.3
        one = self.robust()
        one.rests()
        assert not any(one.sends(31 if n // 20 % 2 else -31, slew=1.0) for n in range(200))

    def test_as_long_as_the_file_says(self) -> None:
        one = self.robust("slew")
        one.rests()
        left = [one.sends(10, near_far=1.0) for _ in range(400)]
        first = [bool(why) for why in left].index(True)
        assert "limit=time" in left[first]
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
        slew.halt("refused", one.gate.made, latch=True)
        assert one.axis.dropped(one.gate.made) == 1.0

    def test_a_motion_of_slew_alone_moves_nothing_else(self) -> None:
        one = Bench(load("forwarder"), "near_far")
        assert not one.axis.of.added
        assert one.axis.partner is None
