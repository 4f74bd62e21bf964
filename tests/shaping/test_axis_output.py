"""Setpoints of an axis: bounds in time, and the input of the model."""

import itertools
from collections.abc import Callable
from typing import Any

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.states import CommandInput, Reason
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import Off

Drive = Any  # the class of conftest.py
DriveWith = Callable[..., Any]
TICK_S = 0.02
LOST = CommandInput(fault=Reason.JOYSTICK_TIMEOUT)


class Stubborn:
    """A filter that never lets go."""

    def step(self, command: float) -> float:
        return 1.0


@pytest.mark.parametrize("missed", [0, 1, 9])
def test_late_ticks_lengthen_neither_a_stop_nor_the_run_on(
    drive_with: DriveWith, missed: int
) -> None:
    limits = OutputLimits(rise_per_s=50.0, fall_per_s=50.0, tail_s=1.0)
    for joystick, bound_s in ((LOST, 0.6), (CommandInput(), 1.0)):
        drive = drive_with(Stubborn(), limits, stop_s=0.6).moving()
        ticks = 0
        while drive.axis.output.steps and ticks < 200:
            drive.tick(joystick)
            drive.axis.hold(missed)
            ticks += 1
        # the last output stays until the tick after the bound
        assert bound_s - TICK_S <= ticks * (1 + missed) * TICK_S <= bound_s + TICK_S * (3 + missed)


# -- what is sent ----------------------------------------------------------------------------------


def test_a_coarse_frame_does_not_hold_up_a_slow_rate(drive_with: DriveWith) -> None:
    """One tick's growth is a fortieth of a step: rounding must not swallow it."""
    limits = OutputLimits(rise_per_s=0.2, fall_per_s=1.0)
    drive = drive_with(Off(), limits, grid_steps=10).to_ready()
    drive.run(CommandInput(1.0), 5.1)
    assert drive.axis.output.steps == 10


def test_below_the_minimum_the_output_is_zero(drive_with: DriveWith) -> None:
    drive = drive_with(Off(), OutputLimits(minimum=0.2)).to_ready()
    drive.run(CommandInput(0.19), 1.0)
    assert not any(drive.raw)
    drive.run(CommandInput(0.21), 1.0)
    assert drive.axis.output.setpoint == pytest.approx(0.21, abs=0.01)
    drive.run(CommandInput(0.19), 1.0)
    assert drive.axis.output.steps == 0


@pytest.mark.parametrize("bypass", [False, True])
def test_a_joystick_beyond_the_maximum_is_shaped_as_one_at_it(*, bypass: bool) -> None:
    """Cut off behind the filter, two thirds of the swing would come back."""
    limits = OutputLimits(maximum=0.4, rise_per_s=5.0, fall_per_s=5.0)

    def sent(full: float) -> list[float]:
        sway = SwayModel(SwayMode(2.27, 0.024), 0.02)
        axis = ShapedAxis(0.02, limits, sway=sway, shaper=Gff(sway, (-2.0, -2.5)))
        velocities = []
        for number in range(500):
            if number == 250:
                new = SwayMode(2.5, 0.03)
                axis.retune(new, lambda model: Gff(model, (-2.2, -2.7)))
            command = 0.0 if number < 2 else (full, -full, 0.0)[number // 100 % 3]
            axis.tick(CommandInput(command, bypass=bypass))
            velocities.append(axis.output.setpoint)
        return velocities

    assert sent(1.0) == sent(0.4)


def test_limits_change_in_neutral_and_hold_from_then_on() -> None:
    sway = SwayModel(SwayMode(2.27, 0.024), 0.02)
    axis = ShapedAxis(0.02, OutputLimits(), sway=sway, shaper=Off(), grid_steps=10_000)
    slow = OutputLimits(maximum=0.5, rise_per_s=1.0, fall_per_s=2.0)
    axis.tick(CommandInput(0.0))
    axis.limit(slow)
    sent = []
    for number in range(100):
        axis.tick(CommandInput(1.0 if number < 50 else 0.0))
        sent.append(axis.output.setpoint)
        if number == 10:
            with pytest.raises(ValueError, match=r"^limits change in neutral only$"):
                axis.limit(OutputLimits())
    assert max(sent) == pytest.approx(0.5, abs=1e-4)
    steps = [b - a for a, b in itertools.pairwise([0.0, *sent])]
    assert max(steps) == pytest.approx(1.0 * 0.02, abs=2e-4)
    assert min(steps) == pytest.approx(-2.0 * 0.02, abs=2e-4)


@pytest.mark.parametrize("kind", ["gff", "robust"])
def test_late_ticks_leave_no_more_swing(kind: str) -> None:
    """One tick in seven comes four late: filter and model have seen the time in between."""
    model = SwayModel(SwayMode.from_period(2.36, 0.05), 0.02)
    options = {"gff": {"a1": 0.708, "a2": 0.12}, "robust": {"taps": [1 / 118] * 118}}

    def left(missed: int) -> float:
        truth, sway = model.retuned(model.mode, 0.0), model.retuned(model.mode, 0.0)
        shaper = build_shaper(kind, 0.02, sway, valve_rate_per_s=5.0, **options[kind])
        axis = ShapedAxis(0.02, OutputLimits(), sway=sway, shaper=shaper)
        axis.tick(CommandInput())
        largest, now = 0.0, 0
        while now < 600:
            if now % 7 == 0 and missed:
                axis.hold(missed)
                for _ in range(missed):
                    truth.step(axis.output.setpoint)
                now += missed
            axis.tick(CommandInput(0.7 if now < 200 else 0.0))
            truth.step(axis.output.setpoint)
            now += 1
            if now > 450:
                largest = max(largest, abs(truth.angle))
        return largest

    assert left(4) <= 1.2 * left(0) + 0.002


def test_of_a_long_standstill_not_every_tick_is_gone_through(drive: Drive) -> None:
    class Counted:
        times = 0

        def step(self, command: float) -> float:
            self.times += 1
            return 0.0

    drive.axis.transfer.shaper = counted = Counted()
    drive.axis.hold(50 * 86_400)
    assert counted.times <= 2000


def test_in_missed_ticks_the_filter_sees_the_last_command(drive_with: DriveWith) -> None:
    commands = []

    class Seen:
        def step(self, command: float) -> float:
            commands.append(command)
            return command

    drive = drive_with(limits=OutputLimits(maximum=0.5))
    drive.moving()
    drive.axis.transfer.shaper = Seen()
    for joystick in (0.3, -0.8):
        drive.tick(CommandInput(joystick))
        drive.axis.hold(2)
    assert commands == [0.3] * 3 + [-0.5] * 3
