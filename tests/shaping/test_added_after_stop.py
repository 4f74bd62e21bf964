"""How fast the motion may move an axis after a stop: the demand of before still counts."""

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.states import CommandInput, Reason, State
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import Off
from tests.shaping.added_pair import run

TICK_S, TAIL = 0.02, 50
DEMAND, LARGEST = 0.09, 0.25
SLACK = 0.5 / 125
LIMITS = OutputLimits(tail_s=TAIL * TICK_S, rise_per_s=10.0, fall_per_s=10.0)
TRIP = CommandInput(enabled=False)
LOST = CommandInput(fault=Reason.JOYSTICK_TIMEOUT)


def stopped(sign: float, stop: CommandInput) -> ShapedAxis:
    """Demanded once, stopped with the next tick, and ready again in the fourth one after it."""
    sway = SwayModel(SwayMode(2.86, 0.05), TICK_S)
    axis = ShapedAxis(TICK_S, LIMITS, sway=sway, shaper=Off(), stop_s=2 * TICK_S)
    axis.allow_added(LARGEST, 6.0)
    for joystick in (CommandInput(), CommandInput(sign * DEMAND), stop, stop):
        axis.tick(joystick)
    axis.tick(CommandInput())
    axis.tick(CommandInput())
    assert axis.state is State.READY
    assert not axis.output.commanded
    return axis


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("stop", [TRIP, LOST])
def test_in_the_direction_of_the_demand_no_faster_until_the_tail_is_over(
    sign: float, stop: CommandInput
) -> None:
    axis = stopped(sign, stop)
    for _ in range(TAIL - 4):
        axis.tick(CommandInput(), sign * 0.5)
        assert sign * axis.output.setpoint <= DEMAND + SLACK
    assert sign * axis.output.setpoint == pytest.approx(DEMAND, abs=2 * SLACK)
    axis.tick(CommandInput(), sign * 0.5)
    assert sign * axis.output.setpoint > DEMAND + SLACK
    for _ in range(5):
        axis.tick(CommandInput(), sign * 0.5)
        assert sign * axis.output.setpoint <= LARGEST + SLACK
    assert sign * axis.output.setpoint == pytest.approx(LARGEST, abs=2 * SLACK)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("stop", [TRIP, LOST])
def test_in_the_other_direction_up_to_the_largest_at_once(sign: float, stop: CommandInput) -> None:
    axis = stopped(sign, stop)
    run(axis, 5, 0.0, sign * -0.5)
    assert sign * axis.output.setpoint == pytest.approx(-LARGEST, abs=SLACK)


def test_missed_ticks_count_towards_the_tail() -> None:
    axis = stopped(1.0, TRIP)
    axis.hold(TAIL)
    axis.tick(CommandInput(), 0.5)
    assert axis.output.setpoint > DEMAND + SLACK


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("demand", [0.1, 0.6])
def test_after_a_bypass_in_neutral_the_slower_of_both_counts(sign: float, demand: float) -> None:
    sway = SwayModel(SwayMode(2.86, 0.05), TICK_S)
    axis = ShapedAxis(TICK_S, LIMITS, sway=sway, shaper=Off())
    axis.allow_added(LARGEST, 6.0)
    for joystick in (CommandInput(), *[CommandInput(sign * demand, bypass=True)] * 10):
        axis.tick(joystick)
    run(axis, 20, 0.0, sign * 0.8)
    assert sign * axis.output.setpoint == pytest.approx(min(demand, LARGEST), abs=2 * SLACK)
    axis.tick(CommandInput(sign * 0.05), sign * 0.8)
    run(axis, 5, sign * 0.05, sign * 0.8)
    assert sign * axis.output.setpoint == pytest.approx(0.05, abs=SLACK)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_missed_ticks_give_no_time_back_that_is_used_up(sign: float) -> None:
    sway = SwayModel(SwayMode(2.86, 0.05), TICK_S)
    axis = ShapedAxis(TICK_S, LIMITS, sway=sway, shaper=Off())
    axis.allow_added(LARGEST, 10 * TICK_S)
    axis.tick(CommandInput())
    run(axis, 30, 0.0, sign * 0.2)
    assert axis.output.steps == 0
    for _ in range(5):
        axis.hold(2)
        axis.tick(CommandInput(), sign * 0.2)
        assert axis.output.steps == 0


def test_missed_ticks_of_an_axis_that_stands_use_up_no_time() -> None:
    """The motion asks for less than a step of the frame."""
    sway = SwayModel(SwayMode(2.86, 0.05), TICK_S)
    axis = ShapedAxis(TICK_S, LIMITS, sway=sway, shaper=Off())
    axis.allow_added(LARGEST, 10 * TICK_S)
    axis.tick(CommandInput())
    run(axis, 3, 0.0, 0.001)
    assert (axis.state, axis.output.steps) == (State.ACTIVE, 0)
    axis.hold(20)
    axis.tick(CommandInput(), 0.2)
    assert axis.output.steps
