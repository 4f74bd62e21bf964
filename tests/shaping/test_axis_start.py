"""An axis that has just been made, with nothing said but what has to be."""

from collections.abc import Callable
from typing import Any

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.states import CommandInput, Reason, State, Transition
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import Off

Drive = Any  # the class of conftest.py
DriveWith = Callable[..., Any]

TICK_S = 0.02
MODE = SwayMode(2.86, 0.05)
OTHER = SwayMode(2.2, 0.02)
CENTRED = CommandInput()


class Stubborn:
    """A filter that never lets go."""

    def step(self, command: float) -> float:
        return 1.0


def new_axis() -> ShapedAxis:
    model = SwayModel(MODE, TICK_S)
    return ShapedAxis(TICK_S, OutputLimits(), sway=model, shaper=Gff(model, (-5.0, -4.0)))


def test_before_the_first_tick_an_axis_carries_neutral() -> None:
    """A frame may go out before the first tick: the first one sent is that of a neutral valve."""
    axis = new_axis()
    assert (axis.state, axis.reason) == (State.NEUTRAL_WAIT, Reason.START)
    assert (axis.output.steps, axis.output.setpoint, axis.output.applied, axis.demand) == (
        0,
        0.0,
        0.0,
        0.0,
    )
    assert isinstance(axis.output.steps, int)
    assert axis.output.commanded is False
    assert axis.neutral is True
    assert axis.added_time.unattended is False


def test_ticks_missed_before_the_first_one_swing_nothing() -> None:
    axis = new_axis()
    axis.hold(5)
    assert axis.sway is not None
    assert (axis.sway.angle, axis.sway.rate) == (0.0, 0.0)


def test_a_retune_before_the_first_tick_is_a_start_with_the_new_filter() -> None:
    model = SwayModel(OTHER, TICK_S)
    right = ShapedAxis(TICK_S, OutputLimits(), sway=model, shaper=Gff(model, (-2.0, -2.5)))
    axis = new_axis()
    axis.retune(OTHER, lambda sway: Gff(sway, (-2.0, -2.5)))
    assert axis.sway is not None
    assert (axis.sway.angle, axis.sway.rate) == (0.0, 0.0)
    for joystick in [CENTRED, CENTRED, *[CommandInput(0.7)] * 60, *[CENTRED] * 60]:
        assert axis.tick(joystick) == right.tick(joystick)
        assert (axis.output.steps, axis.output.applied) == (
            right.output.steps,
            right.output.applied,
        )
    assert axis.sway.angle == model.angle
    waiting = new_axis()
    waiting.retune(OTHER, lambda sway: Gff(sway, (-2.0, -2.5)))
    assert waiting.tick(CommandInput(0.5)) is None
    assert (waiting.reason, waiting.output.steps) == (Reason.JOYSTICK_NOT_NEUTRAL, 0)


@pytest.mark.parametrize("reset", [False, True])
def test_a_switch_that_was_never_seen_off_makes_no_edge(drive: Drive, reset: bool) -> None:
    """Tripped before the first valid frame, in which enable is on, or reset is pressed."""
    drive.tick(CommandInput(trip=Reason.SEND_FAILED, fault=Reason.JOYSTICK_TIMEOUT))
    on, off = CommandInput(reset=reset), CommandInput(enabled=reset)
    drive.run(on, 0.2)
    assert drive.state is State.TRIPPED
    assert drive.tick(off) is None
    assert drive.tick(on) == Transition(State.TRIPPED, State.NEUTRAL_WAIT, Reason.RESET)


def test_a_stop_takes_two_seconds_at_most_where_nothing_else_is_said() -> None:
    axis = ShapedAxis(TICK_S, OutputLimits(tail_s=9.0), sway=None, shaper=Stubborn())
    for joystick in [CENTRED, *[CommandInput(1.0)] * 20]:
        axis.tick(joystick)
    stopping = 0
    while axis.output.steps:
        axis.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT))
        stopping += 1
    assert stopping == round(2.0 / TICK_S) + 1
    assert axis.reason is Reason.STOP_DONE


def test_a_stop_shorter_than_a_tick_is_one_tick() -> None:
    axis = ShapedAxis(TICK_S, OutputLimits(tail_s=9.0), sway=None, shaper=Stubborn(), stop_s=0.001)
    for joystick in [CENTRED, *[CommandInput(1.0)] * 20]:
        axis.tick(joystick)
    axis.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT))
    assert (axis.state, axis.output.steps) == (State.STOPPING, 125)
    axis.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT))
    assert (axis.state, axis.output.steps) == (State.NEUTRAL_WAIT, 0)


def test_full_speed_is_125_steps_where_nothing_else_is_said() -> None:
    """The frame of ISO 11783-7: 125 steps to either side."""
    axis = ShapedAxis(TICK_S, OutputLimits(), sway=None, shaper=Off())
    for joystick in [CENTRED, *[CommandInput(1.0)] * 20]:
        axis.tick(joystick)
    assert axis.output.steps == 125


# -- what it says ----------------------------------------------------------------------------------


def test_the_anti_sway_switch_is_named_as_the_reason(drive: Drive) -> None:
    drive.to_ready()
    requested, released = Reason.BYPASS_REQUESTED, Reason.BYPASS_RELEASED
    bypassed = CommandInput(0.8, bypass=True)
    assert drive.tick(bypassed) == Transition(State.READY, State.BYPASS_ON, requested)
    assert drive.axis.reason is requested
    assert drive.tick(CommandInput(0.8)) == Transition(State.BYPASS_ON, State.ACTIVE, released)
    assert drive.tick(bypassed) == Transition(State.ACTIVE, State.BYPASS_ON, requested)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_full_speed_may_be_added(drive_with: DriveWith, sign: float) -> None:
    axis = drive_with(limits=OutputLimits(rise_per_s=100.0)).to_ready().axis
    axis.allow_added(1.0, 1.0)
    axis.tick(CENTRED, sign)
    assert (axis.state, axis.reason) == (State.ACTIVE, Reason.COMPENSATING)
    assert axis.output.setpoint == sign


def test_an_axis_that_starts_latched_is_not_freed_by_an_enable_that_is_held(drive: Drive) -> None:
    drive.axis.restore(State.TRIPPED, Reason.EMERGENCY_STOP)
    drive.run(CommandInput(), 0.2)
    assert drive.state is State.TRIPPED


def test_with_the_enable_off_a_joystick_that_reports_nothing_is_no_news(drive: Drive) -> None:
    drive.tick(CommandInput(fault=Reason.JOYSTICK_NOT_AVAILABLE, enabled=False))
    assert drive.axis.reason is Reason.ENABLE_OFF
    drive.tick(CommandInput(fault=Reason.JOYSTICK_NOT_AVAILABLE))
    assert drive.axis.reason is Reason.JOYSTICK_NOT_AVAILABLE


@pytest.mark.parametrize("state", [State.ACTIVE, State.BYPASS_ON, State.STOPPING])
def test_no_axis_continues_in_motion(drive: Drive, state: State) -> None:
    with pytest.raises(ValueError, match=f"expected one with neutral output, got {state.name}"):
        drive.axis.restore(state, Reason.JOYSTICK_MOVED)
    assert (drive.state, drive.axis.reason) == (State.NEUTRAL_WAIT, Reason.START)
