"""Rules 1 to 3: reasons to stop, at once or shaped, and neutral first."""

from dataclasses import replace
from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.gate.axis import FOREIGN_NS
from tests.faults import variants
from tests.gate.bench import Bench, bench, load, signs
from tests.promises.world import World

FULL = 125


class TestStopsAtOnce:
    """Rule 1: nothing leaves in the same tick, and nothing moves again without a reset."""

    def moving(self, **limits: Any) -> Bench:
        one = bench(**limits)
        one.ramp(60, near_far=1.0)
        return one

    def needs_another_press(self, one: Bench) -> None:
        """Reset that is held resets nothing; released and pressed again it does."""
        one.rests(5, reset=True)
        assert not one.axis.armed
        one.rests(1)
        one.rests(2, reset=True)
        assert one.axis.armed

    def test_a_second_sender(self) -> None:
        one = self.moving()
        one.gate.receive(one.key, bytes(2), one.now_ns)
        assert "why=second sender" in one.sends(60, near_far=1.0)
        for k in range(FOREIGN_NS // 20_000_000):
            one.sends(0, enable=k != 20)
            assert not one.axis.armed
        one.rests(5)  # a press within the second is no reset
        assert not one.axis.armed
        one.sends(0, enable=False)
        one.rests()
        assert one.axis.armed

    def test_the_log_names_why_it_stands(self) -> None:
        assert "limit=stopped why=start speed=" in bench().sends(10, near_far=0.5)
        for why, stop in (
            ("send failed", lambda gate: gate.send_failed(gate.axes["near_far"].of.valve)),
            ("decoders disagree", lambda gate: gate.disagrees([gate.axes["near_far"]])),
            ("second sender", lambda gate: gate.receive(gate.axes["near_far"].of.valve, b"", 0)),
        ):
            one = self.moving()
            stop(one.gate)
            assert f"limit=stopped why={why} speed=" in one.sends(60, near_far=1.0)
        one = self.moving()
        one.sends(60, near_far=1.0, enable=False)
        assert "why=enable speed=" in one.sends(60, near_far=1.0, enable=False)
        one = self.moving(stop_s=0.1)
        one.change = lambda frame: None
        left = [one.sends(60) for _ in range(20)]
        assert "limit=stopped why=joystick speed=" in next(filter(None, left))

    def test_what_a_frame_says_after_the_tick_began_counts_for_the_next_frame(self) -> None:
        one = self.moving()
        one.receive(one.joysticks(near_far=1.0))
        one.gate.tick(one.now_ns, 0)
        one.receive(one.joysticks(near_far=1.0, enable=False))
        assert "why=enable speed=" in one.gate.leaving(one.key, one.frame(60))

    def test_a_press_before_it_is_no_reset(self) -> None:
        one = bench()
        one.rests(3)
        one.rests(3, enable=False)
        one.ramp(60, near_far=1.0)
        assert one.sends(-FULL, near_far=1.0)
        one.rests(10)
        assert not one.restarts(10, near_far=0.5)

    def test_the_log_names_what_came_between_tick_and_frame(self) -> None:
        for why, stop in (
            ("loop stalled", lambda gate: gate.stalled()),
            ("decoders disagree", lambda gate: gate.disagrees([gate.axes["near_far"]])),
            ("second sender", lambda gate: gate.receive(gate.axes["near_far"].of.valve, b"", 0)),
        ):
            one = self.moving()
            one.receive(one.joysticks(near_far=1.0))
            one.gate.tick(one.now_ns, 0)
            stop(one.gate)
            assert f"why={why} speed=" in one.gate.leaving(one.key, one.frame(60))

    def test_with_the_stick_in_neutral_it_may_not_fall_either(self) -> None:
        one = self.moving(fall_per_s=2.0)
        one.gate.send_failed(one.key)
        assert "why=send failed" in one.sends(56)

    def test_a_second_sender_that_is_read_late_latches(self) -> None:
        one = bench()
        one.rests()
        one.gate.receive(one.key, bytes(2), one.now_ns)
        one.number += 60
        one.rests()
        assert one.axis.latched

    @pytest.mark.parametrize("failed", [True, False])
    def test_a_press_just_before_it_is_no_reset(self, failed: bool) -> None:
        one = self.moving()
        assert not one.sends(60, near_far=1.0, reset=True)
        one.gate.send_failed(one.key) if failed else one.gate.stalled()
        self.needs_another_press(one)

    def test_a_press_in_the_same_tick_just_before_it_is_no_reset(self) -> None:
        one = self.moving()
        one.receive(one.joysticks(reset=True, near_far=1.0))
        one.gate.disagrees([one.axis])
        assert "why=decoders" in one.sent(60)
        self.needs_another_press(one)

    def test_a_press_while_the_reason_lasts_is_no_reset(self) -> None:
        """At rest a lost emergency stop would latch nothing: it keeps what it latched in motion."""
        one = Bench(variants.machine("protected")[1], "near_far")
        stop = one.deployment.emergency_stop
        assert stop is not None
        one.rests(10)
        for steps in range(1, 20):
            assert not one.sends(steps, near_far=1.0)
        one.change = lambda frame: None if frame[:3] == stop.key else frame
        while not one.sends(19, near_far=1.0):
            assert one.number < 100
        one.rests(10)
        assert one.axis.latched
        one.rests(3, enable=False)
        one.rests(3)
        one.change = lambda frame: frame
        one.rests(10)
        assert not one.axis.armed
        one.rests(3, enable=False)
        one.rests(1)
        assert one.axis.armed

    def test_a_press_that_counted_stays_one(self) -> None:
        """A reason at rest behind it, which latches nothing, asks for neutral alone."""
        one = self.moving()
        one.gate.send_failed(one.key)
        one.rests(1)
        one.receive(one.joysticks(reset=True, near_far=1.0))
        one.sent(0)
        one.gate.disagrees([one.axis])
        one.sends(0, near_far=1.0)
        one.rests(1)
        assert one.axis.armed

    def test_a_release_in_a_frame_that_does_not_count_makes_no_press(self) -> None:
        one = bench()
        seen: list[Frame] = []

        def keep(frame: Frame) -> Frame:
            seen.append(frame)
            return frame

        one.change = keep
        one.ramp(60, near_far=1.0)
        one.gate.send_failed(one.key)
        one.rests()
        (last,) = [f for f in seen if f[:3] == one.deployment.joysticks["left"].key][-1:]
        field = one.axis.joystick.pressed.of.field
        released = int.from_bytes(last.data, "little") & ~(field.mask << field.shift)
        one.gate.receive(last[:3], released.to_bytes(8, "little"), one.now_ns)  # its counter stands
        assert one.axis.joystick.pressed.released
        one.rests()
        assert not one.axis.armed
        one.rests(enable=False)
        one.rests(1)
        assert one.axis.armed

    def test_a_press_just_after_it_is_one(self) -> None:
        one = self.moving()
        one.gate.send_failed(one.key)
        one.rests(2, reset=True)
        assert one.axis.armed

    def test_a_standstill_at_rest_latches_nothing(self) -> None:
        one = bench()
        one.rests()
        one.gate.stalled()
        one.rests()
        assert one.axis.armed

    def test_released_and_pressed_between_two_ticks(self) -> None:
        """A press after the reason is a reset."""
        one = self.moving()
        one.receive(one.joysticks(enable=False))
        one.rests(1)
        assert not one.axis.armed
        one.rests(1)
        assert one.axis.armed

    def test_a_switch_at_rest_latches_nothing(self) -> None:
        world = World("ecu-forwarder")
        for world.agree in (True, False, True):
            world.go(25)
        axes = world.gated._gate.axes.values()
        assert all(axis.armed for axis in axes)

    def test_a_reset_is_a_press_too(self) -> None:
        one = self.moving()
        assert one.sends(-FULL, near_far=1.0)
        one.rests(5)
        one.rests(5, reset=True)
        assert not one.sends(10, near_far=0.5)

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
        assert "why=emergency stop speed=" in one.sends(10, near_far=1.0)
        one.rests(10, enable=False)
        one.rests(10)
        assert not one.sends(10, near_far=1.0)


class TestStopsShaped:
    """Rule 2: for ``stop_s`` it may fall, and then neutral comes first."""

    @signs
    def test_when_neutral_was_seen_again_nothing_runs_against_the_stick(self, sign: int) -> None:
        one = bench()
        one.ramp(sign * 60, near_far=sign * 0.5)
        one.change = lambda frame: None
        assert not any(one.sends(sign * 60) for _ in range(10))
        one.change = lambda frame: frame
        assert not one.sends(sign * 60)
        assert "limit=asked" in one.sends(sign * 60, near_far=-sign * 0.5)

    def stuck(self) -> Bench:
        """A stick may stand still for a second."""
        deployment = load("forwarder")
        left = deployment.joysticks["left"]
        config = left.config.model_copy(update={"stuck_s": 1.0})
        joysticks = {**deployment.joysticks, "left": replace(left, config=config)}
        return Bench(replace(deployment, joysticks=joysticks), "near_far")

    def test_a_stick_that_stands_still(self) -> None:
        one = self.stuck()
        one.ramp(60, near_far=0.5)
        armed = []
        for _ in range(60):
            assert not one.sends(60, near_far=0.5)
            armed.append(one.axis.armed)
        assert armed.index(False) == 50 - 15 + 1  # stuck_s, less the ramp

    def test_a_stick_that_stands_still_in_neutral(self) -> None:
        """At the edge of it, and for longer."""
        one = self.stuck()
        one.rests(60, near_far=0.02)
        assert one.axis.of.stick.band == one.axis.demand
        assert one.axis.armed
