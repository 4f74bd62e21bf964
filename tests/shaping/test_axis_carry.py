"""An added velocity and the grid of the valve: what is sent, carried and dropped."""

import math

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.output import MOST_CARRY
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.states import CommandInput, Reason, State
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import Off

LARGEST = 0.3
TICK_S = 0.05
MODE = SwayMode(2.86, 0.05)
POLES = (-5.655, -4.112)


def axis_with(limits: OutputLimits, steps: int = 125) -> ShapedAxis:
    model = SwayModel(MODE, TICK_S)
    axis = ShapedAxis(TICK_S, limits, sway=model, shaper=Gff(model, POLES), grid_steps=steps)
    axis.allow_added(1.0, 3600.0)
    axis.tick(CommandInput())
    assert axis.state is State.READY
    return axis


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1.1, -1.1])
@pytest.mark.parametrize("command", [0.0, 0.5])
def test_no_velocity_trips_and_poisons_nothing(bad: float, command: float) -> None:
    axis = axis_with(OutputLimits(tail_s=0.4))
    for _ in range(10):
        axis.tick(CommandInput(command), 0.2)
    axis.tick(CommandInput(command), bad)
    assert (axis.state, axis.reason, axis.output.steps) == (State.TRIPPED, Reason.OUTPUT_INVALID, 0)
    assert axis.sway is not None
    assert (axis.sway.angle, axis.sway.rate, axis.output.applied) == (0.0, 0.0, 0.0)
    axis.tick(CommandInput(enabled=False))
    axis.tick(CommandInput())
    axis.tick(CommandInput())
    axis.tick(CommandInput(), 0.2)
    assert (axis.state, axis.reason) == (State.ACTIVE, Reason.COMPENSATING)
    assert axis.output.setpoint > 0.1


@pytest.mark.parametrize("steps", [10, 125, 1000])
def test_a_slow_path_there_and_back_is_run_to_its_end(steps: int) -> None:
    """Far below a coarse grid's step: the quantisation error is carried, and nothing is left."""
    axis = axis_with(OutputLimits(deadband=0.05), steps)
    travel = []
    position = 0.0
    for i in range(200):
        axis.tick(CommandInput(), 0.13 * math.sin(2.0 * math.pi * i / 200.0))
        position += axis.output.setpoint * TICK_S
        travel.append(position)
    # a coarse grid leaves out the first and last part of either way, below half a step
    assert max(travel) == pytest.approx(0.13 * 200 * TICK_S / math.pi, rel=0.08)
    assert abs(position) <= MOST_CARRY * TICK_S + 0.5 / steps * TICK_S


def test_an_addition_below_the_valves_minimum_is_not_sent() -> None:
    axis = axis_with(OutputLimits(minimum=0.1, rise_per_s=100.0, fall_per_s=100.0))
    for _ in range(50):
        axis.tick(CommandInput(), 0.05)
        assert axis.output.steps == 0
    axis.tick(CommandInput(), 0.2)
    assert axis.output.setpoint == pytest.approx(
        0.2 + 1 / 125, abs=0.005
    )  # a step of what is carried


def test_an_addition_of_less_than_half_a_step_is_not_sent() -> None:
    """What is carried of it waits for a motion: it is no reason to twitch."""
    axis = axis_with(OutputLimits(rise_per_s=100.0, fall_per_s=100.0))
    for _ in range(50):
        axis.tick(CommandInput(), 0.003)
        assert axis.output.steps == 0


@pytest.mark.parametrize(("joystick", "added"), [(1 / 3, 0.03), (-0.41, 0.0271), (0.25, -0.05)])
def test_in_the_long_run_joystick_and_addition_are_sent_in_full(
    joystick: float, added: float
) -> None:
    """Where the operator asked for more within the tail."""
    limits = OutputLimits(rise_per_s=100.0, fall_per_s=100.0, tail_s=20.0)
    axis = ShapedAxis(TICK_S, limits, sway=None, shaper=Off())
    axis.allow_added(LARGEST, 1.0)
    axis.tick(CommandInput())
    axis.tick(CommandInput(math.copysign(1.0, joystick)))
    sent = 0.0
    for _ in range(200):
        axis.tick(CommandInput(joystick), added)
        sent += axis.output.setpoint
    assert sent == pytest.approx(200 * (joystick + added), abs=0.02)


def test_what_was_carried_is_dropped_at_rest() -> None:
    limits = OutputLimits(rise_per_s=1.0, tail_s=0.0)
    axis, fresh = axis_with(limits), axis_with(limits)
    for added in (0.5, 0.5, 0.0, 0.0):
        axis.tick(CommandInput(), added)
    assert axis.state is State.READY
    for _ in range(5):
        axis.tick(CommandInput(), 0.02)
        fresh.tick(CommandInput(), 0.02)
        assert axis.output.steps == fresh.output.steps


def test_a_change_of_filter_in_motion_joins_with_an_addition_too() -> None:
    axis = axis_with(OutputLimits(rise_per_s=100.0, fall_per_s=100.0))
    for _ in range(4):  # after that the filter brakes against its model's swing
        axis.tick(CommandInput(0.8), -0.2)
    before = axis.output.setpoint
    assert before == pytest.approx(0.6)
    axis.retune(MODE, lambda model: Gff(model, (-1.5, -1.5)))
    axis.tick(CommandInput(0.8), -0.2)
    assert axis.output.setpoint == pytest.approx(before, abs=0.01)
