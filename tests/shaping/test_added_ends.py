"""An added velocity: how it ends."""

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.fir import Fir
from canshaper.shaping.states import CommandInput, Reason, State
from canshaper.shaping.transfer import Off
from tests.shaping.added_pair import LARGEST, SLACK, TICK_S, TIME_S, pair, run


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("command", "left"), [(0.0, 0.0), (0.3, 0.3)])
def test_who_adds_and_loses_the_right_to_leaves_nothing(
    sign: float, command: float, left: float
) -> None:
    """However slowly the valve may fall."""
    axis, _ = pair(OutputLimits(rise_per_s=1.0, fall_per_s=0.2))
    axis.tick(CommandInput(sign * command and sign))  # it asked for more before
    run(axis, 20, sign * command)
    run(axis, 6, sign * command, sign * 0.2)
    assert sign * axis.output.setpoint == pytest.approx(left + 0.2, abs=SLACK)
    axis.drop_added()
    axis.tick(CommandInput(sign * command))
    assert sign * axis.output.setpoint == pytest.approx(left, abs=SLACK)


def test_what_was_added_against_the_own_part_ends_by_the_rates() -> None:
    axis, _ = pair(OutputLimits(rise_per_s=1.0))
    run(axis, 20, 0.5, -0.2)
    assert axis.output.setpoint == pytest.approx(0.3, abs=SLACK)
    axis.drop_added()
    axis.tick(CommandInput(0.5))
    assert axis.output.setpoint == pytest.approx(0.35, abs=SLACK)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_was_added_beyond_the_own_part_stops_before_the_own_part_begins(sign: float) -> None:
    axis, _ = pair(
        OutputLimits(rise_per_s=1.0, tail_s=2.0, reversal_s=5.0), lambda: Fir([0.0] * 40 + [1.0])
    )
    axis.allow_added(1.0, TIME_S)
    for command, ticks in ((0.4, 30), (-1.0, 2)):
        run(axis, ticks, sign * command)
    run(axis, 20, 0.0, -sign)
    assert sign * axis.output.setpoint < -0.5
    assert sign * axis.stage._own_ramp > 0.1
    axis.drop_added()
    seen = []
    for _ in range(3):
        axis.tick(CommandInput())
        seen.append(sign * axis.output.setpoint)
    assert seen == pytest.approx([0.0, 0.05, 0.1], abs=SLACK)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_was_added_to_an_own_part_that_turns_ends_before_the_other_side(sign: float) -> None:
    limits = OutputLimits(rise_per_s=1.0, fall_per_s=0.9, tail_s=3.0, reversal_s=5.0)
    axis, _ = pair(limits, lambda: Fir([0.0] * 30 + [1.0]))
    axis.tick(CommandInput())
    for command, ticks in ((-1.0, 1), (-0.4, 10), (1.0, 11)):
        run(axis, ticks, sign * command)
    run(axis, 27, 0.0, -sign * 0.1)
    assert sign * axis.stage._own_ramp == pytest.approx(-0.04)
    assert sign * axis.output.setpoint == pytest.approx(-0.14, abs=SLACK)
    axis.drop_added()
    axis.tick(CommandInput())
    assert axis.output.setpoint == 0.0
    axis.tick(CommandInput())
    assert sign * axis.output.setpoint == pytest.approx(0.05, abs=SLACK)


def test_an_axis_at_rest_has_nothing_to_drop() -> None:
    axis, _ = pair(OutputLimits())
    axis.drop_added()
    axis.tick(CommandInput())
    assert (axis.state, axis.output.steps) == (State.READY, 0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_command_after_what_was_added_begins_at_rest(sign: float) -> None:
    axis, _ = pair(OutputLimits(rise_per_s=1.0))
    run(axis, 10, 0.0, sign * 0.2)
    axis.drop_added()
    axis.tick(CommandInput(sign * 0.5))
    assert sign * axis.output.setpoint == pytest.approx(0.05, abs=SLACK)


@pytest.mark.parametrize("fault", [Reason.JOYSTICK_TIMEOUT, Reason.JOYSTICK_ERROR])
def test_what_was_added_falls_by_the_rate_when_the_joystick_is_lost(fault: Reason) -> None:
    axis, _ = pair(OutputLimits(fall_per_s=2.0))
    run(axis, 10, 0.0, 0.2)
    for left in (0.1, 0.0):
        axis.tick(CommandInput(fault=fault), 0.2)
        assert axis.output.setpoint == pytest.approx(left, abs=SLACK)
    axis.tick(CommandInput(fault=fault), 0.2)
    assert axis.state is State.NEUTRAL_WAIT


def test_nor_while_it_falls_already() -> None:
    axis, _ = pair(OutputLimits(fall_per_s=0.2))
    run(axis, 10, 0.0, 0.2)
    axis.tick(CommandInput())
    assert axis.output.setpoint == pytest.approx(0.19, abs=SLACK)
    axis.drop_added()
    axis.tick(CommandInput())
    assert axis.output.setpoint == 0.0


def test_nor_what_rounding_has_left_out() -> None:
    axis = ShapedAxis(TICK_S, OutputLimits(), sway=None, shaper=Off(), grid_steps=10)
    axis.allow_added(LARGEST, TIME_S)
    axis.tick(CommandInput())
    axis.tick(CommandInput(1.0))
    run(axis, 10, 0.3)
    axis.drop_added()
    axis.tick(CommandInput(0.3), 0.001)
    assert axis.output.setpoint == pytest.approx(0.3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_falls_is_rounded_to_the_side_of_rest(sign: float) -> None:
    axis = ShapedAxis(TICK_S, OutputLimits(fall_per_s=0.07), sway=None, shaper=Off(), grid_steps=50)
    axis.allow_added(LARGEST, TIME_S)
    axis.tick(CommandInput())
    run(axis, 10, 0.0, sign * 0.2)
    for _ in range(40):
        axis.tick(CommandInput())
        assert 0.0 <= sign * axis.output.setpoint <= sign * axis.stage.ramp + 1e-12


def test_with_anti_sway_off_nothing_that_is_added_begins_a_motion() -> None:
    axis, _ = pair(OutputLimits())
    axis.tick(CommandInput(bypass=True), 0.2)
    assert (axis.state, axis.output.steps) == (State.READY, 0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_shaped_stop_is_that_of_an_axis_to_which_nothing_is_added(sign: float) -> None:
    axis, plain = pair(OutputLimits(), lambda: Fir([0.1] * 10))
    for one in (axis, plain):
        run(one, 20, sign)
    for _ in range(12):
        for one in (axis, plain):
            one.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT))
        assert (axis.state, axis.output.setpoint) == (plain.state, plain.output.setpoint)
    assert plain.output.setpoint == 0.0
