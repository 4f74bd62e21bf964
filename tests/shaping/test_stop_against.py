"""A shaped stop whose joystick is held against the run-on."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.states import CommandInput, Reason, State

DriveWith = Callable[..., Any]
TICK_S = 0.02
LIMITS = OutputLimits(tail_s=2.0, rise_per_s=2.0, fall_per_s=4.0)
FALL = 4.0 * TICK_S + 1.5 / 125  # and the rounding of two frames
LATE = Reason.LOOP_OVERRUN


class Delay:
    """A filter that repeats its command for as long as it is asked to."""

    def __init__(self) -> None:
        self.repeated = 0.0

    def step(self, command: float) -> float:
        return command or self.repeated


def stopping(drive_with: DriveWith, sign: float, limits: OutputLimits = LIMITS) -> Any:
    """In a stop that runs on at 0.8."""
    shaper = Delay()
    drive = drive_with(shaper, limits)
    drive.to_ready().run(CommandInput(sign * 0.8), 1.0)
    shaper.repeated = sign * 0.8
    drive.run(CommandInput(sign * 0.8, fault=LATE), 0.1)
    assert drive.state is State.STOPPING
    assert drive.axis.output.setpoint == pytest.approx(sign * 0.8, abs=0.01)
    return drive


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("fault", [LATE, None])
def test_held_the_other_way_it_ends_the_run_on_by_the_fall(
    drive_with: DriveWith, sign: float, fault: Reason | None
) -> None:
    drive = stopping(drive_with, sign)
    before = drive.axis.output.setpoint
    for _ in range(11):
        drive.tick(CommandInput(sign * -0.03, fault=fault))
        assert 0.0 <= sign * drive.axis.output.setpoint <= max(0.0, sign * before - FALL + 3 / 125)
        before = drive.axis.output.setpoint
    assert (drive.axis.output.steps, drive.state) == (0, State.NEUTRAL_WAIT)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_begins_no_run_on_against_a_joystick_that_is_held(
    drive_with: DriveWith, sign: float
) -> None:
    """Both directions were commanded within the tail; the filter changes over to the other one."""
    shaper = Delay()
    drive = drive_with(shaper, LIMITS)
    drive.to_ready().run(CommandInput(-sign * 0.8), 0.5)
    drive.run(CommandInput(sign * 0.8), 0.5)
    shaper.repeated = -sign * 0.5
    for _ in range(20):
        drive.tick(CommandInput(sign * 0.8, fault=LATE))
        assert sign * drive.axis.output.setpoint >= 0.0
    assert drive.axis.output.setpoint == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_in_the_middle_of_a_reversal_it_ends_in_neutral(drive_with: DriveWith, sign: float) -> None:
    """The other direction was commanded too, and does not begin in the stop."""
    shaper = Delay()
    drive = drive_with(shaper, LIMITS)
    drive.to_ready().run(CommandInput(sign * 0.8), 1.0)
    drive.run(CommandInput(-sign * 0.8), 0.1)
    assert sign * drive.axis.output.setpoint > 0.2
    shaper.repeated = -sign * 0.8
    for _ in range(20):
        drive.tick(CommandInput(-sign * 0.8, fault=LATE))
        assert sign * drive.axis.output.setpoint >= 0.0
    assert drive.axis.output.steps == 0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_short_touch_is_enough(drive_with: DriveWith, sign: float) -> None:
    """It does not run on again when the joystick is let go of."""
    drive = stopping(drive_with, sign)
    drive.tick(CommandInput(sign * -1.0, fault=LATE))
    drive.run(CommandInput(fault=LATE), 10 * TICK_S)
    assert drive.axis.output.steps == 0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("held", [0.0, -0.02, 0.5, 1.0])
def test_held_the_same_way_or_in_neutral_it_leaves_the_run_on(
    drive_with: DriveWith, sign: float, held: float
) -> None:
    drive = stopping(drive_with, sign)
    drive.run(CommandInput(sign * held, fault=LATE), 0.5)
    assert drive.axis.output.setpoint == pytest.approx(sign * 0.8, abs=0.01)


@pytest.mark.parametrize("allowed", [{"reversal_s": 1.0}, {"allow_reverse": True}])
def test_where_a_reversal_may_run_on_a_stop_may_too(
    drive_with: DriveWith, allowed: dict[str, Any]
) -> None:
    drive = stopping(drive_with, 1.0, replace(LIMITS, **allowed))
    drive.run(CommandInput(-1.0, fault=LATE), 0.5)
    assert drive.axis.output.setpoint == pytest.approx(0.8, abs=0.01)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_held_the_same_way_it_leaves_a_run_on_that_has_yet_to_begin(
    drive_with: DriveWith, sign: float
) -> None:
    class Late:
        output = 0.0

        def step(self, command: float) -> float:
            return self.output

    shaper = Late()
    drive = drive_with(shaper, LIMITS).to_ready()
    drive.run(CommandInput(sign * 0.8), 0.1)
    drive.run(CommandInput(sign * 0.8, fault=LATE), 0.1)
    assert (drive.axis.output.steps, drive.state) == (0, State.STOPPING)
    shaper.output = sign * 0.8
    drive.run(CommandInput(sign * 0.8, fault=LATE), 0.5)
    assert drive.axis.output.setpoint == pytest.approx(sign * 0.8, abs=0.01)
