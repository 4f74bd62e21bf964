"""Measured valve: command and speed over each other, and what does not make a curve."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import (
    OutputLimits,
    ValveCurve,
    on_grid,
    with_deadband,
    without_deadband,
)
from canshaper.shaping.states import CommandInput
from canshaper.shaping.transfer import Off

# Opens at 7 % one way and at 4 % the other, where it is slower.
COMMANDS = (-1.0, -0.5, -0.04, 0.07, 0.4, 1.0)
SPEEDS = (-0.8, -0.3, 0.0, 0.0, 0.35, 1.0)
CURVE = ValveCurve(COMMANDS, SPEEDS)
NO_ENDS = "expected commands from -100 to 100 %, with the ends of the dead band between"
NO_BAND = "expected two neighbouring commands with speed 0, the ends of the dead band"
NOT_FULL = "the faster direction has speed 100 % at full command, and none has more"


@pytest.mark.parametrize(("command", "speed"), list(zip(COMMANDS, SPEEDS, strict=True)))
def test_it_goes_through_its_points(command: float, speed: float) -> None:
    assert CURVE.velocity(command) == pytest.approx(speed)
    if speed:
        assert CURVE.command(speed) == pytest.approx(command)


@given(st.floats(-0.8, 1.0))
def test_a_command_gives_the_velocity_it_was_made_for(velocity: float) -> None:
    assert CURVE.velocity(CURVE.command(velocity)) == pytest.approx(velocity, abs=1e-12)


@pytest.mark.parametrize(("velocity", "command"), [(0.0, 0.0), (-1.0, -1.0), (-0.9, -1.0)])
def test_zero_is_zero_and_what_it_cannot_give_is_full_command(
    velocity: float, command: float
) -> None:
    assert CURVE.command(velocity) == command


def test_the_smallest_velocity_opens_the_valve() -> None:
    assert CURVE.command(1e-12) == pytest.approx(0.07)
    assert CURVE.command(-1e-12) == pytest.approx(-0.04)


@given(st.floats(-1.0, 1.0), st.sampled_from((0.0, 0.05, 0.2)))
def test_a_symmetrical_one_is_the_deadband(velocity: float, deadband: float) -> None:
    edge = deadband or 1e-9
    curve = ValveCurve((-1.0, -edge, edge, 1.0), (-1.0, 0.0, 0.0, 1.0))
    assert curve.command(velocity) == pytest.approx(with_deadband(velocity, deadband), abs=1e-6)
    assert curve.velocity(velocity) == pytest.approx(without_deadband(velocity, deadband), abs=1e-6)


@given(
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 0.0),
    st.floats(0.0, 1.0),
    st.sampled_from((20, 125, 250, 64_000)),
)
def test_the_grid_stays_within_its_bounds(
    velocity: float, low: float, high: float, steps: int
) -> None:
    velocity = min(max(velocity, low), high)
    raw, sent = on_grid(velocity, low, high, 0.0, steps, curve=CURVE)
    assert low <= sent <= high
    assert (raw == 0) == (sent == 0.0)
    assert sent == 0.0 or sent == CURVE.velocity(raw / steps)
    # A step of the frame is at most two steps of speed on the steepest part of this curve.
    reached = min(max(velocity, -0.8), 1.0)
    assert abs(sent - reached) <= 2.2 / steps or sent == 0.0 or abs(sent) < abs(reached)


@pytest.mark.parametrize(
    ("commands", "speeds", "says"),
    [
        ((-1, 0, 1), (-1, 0, 0, 1), "expected a speed for each command, got 3 and 4"),
        ((-1, 0, 1), (-1, 0, 1), NO_ENDS),
        ((-0.9, -0.1, 0.1, 1), (-1, 0, 0, 1), NO_ENDS),
        ((-1, -0.1, 0.1, 0.9), (-1, 0, 0, 1), NO_ENDS),
        ((-1, 0.1, 0.1, 1), (-1, 0, 0, 1), "commands do not rise"),
        ((-1, -0.1, 0.1, 1), (-1, -0.1, 0, 1), NO_BAND),
        ((-1, -0.1, 0, 0.1, 1), (-1, 0, 0, 0, 1), NO_BAND),
        ((-1, -0.1, 0.1, 1), (0, 0, 0.5, 1), NO_BAND),
        ((-1, -0.5, 0.1, 1), (-1, -0.5, 0, 0), NO_BAND),
        ((-1, 0.1, 0.2, 1), (-1, 0, 0, 1), "the dead band does not lie around command 0"),
        ((-1, -0.2, -0.1, 1), (-1, 0, 0, 1), "the dead band does not lie around command 0"),
        ((-1, -0.5, -0.1, 0.1, 1), (-0.5, -0.6, 0, 0, 1), "speeds do not rise with the command"),
        ((-1, -0.1, 0.1, 0.5, 1), (-1, 0, 0, 0.7, 0.7), "speeds do not rise with the command"),
        ((-1, -0.1, 0.1, 1), (-0.9, 0, 0, 0.9), NOT_FULL),
        ((-1, -0.1, 0.1, 1), (-1.1, 0, 0, 1), NOT_FULL),
    ],
)
def test_what_is_no_curve_is_refused(
    commands: tuple[float, ...], speeds: tuple[float, ...], says: str
) -> None:
    with pytest.raises(ValueError, match=f"^{says}$"):
        ValveCurve(commands, speeds)


@pytest.mark.parametrize(
    ("commands", "speeds"),
    [
        ((-1, 0, 0.1, 1), (-1, 0, 0, 0.5)),
        ((-1, -0.1, 0, 1), (-0.5, 0, 0, 1)),
        ((-1, -0.5, -0.1, 0.1, 0.5, 1), (-0.8, -0.3, 0, 0, 0.5, 0.999)),
        ((-1, -0.1, 0.1, 1), (-0.999, 0, 0, 0.999)),
    ],
)
def test_a_band_that_ends_at_zero_and_a_rounded_full_speed_make_a_curve(
    commands: tuple[float, ...], speeds: tuple[float, ...]
) -> None:
    curve = ValveCurve(commands, speeds)
    assert [curve.velocity(command) for command in commands] == pytest.approx(speeds)


def driven(command: float, added: float = 0.0) -> ShapedAxis:
    limits = OutputLimits(rise_per_s=50.0, fall_per_s=50.0, curve=CURVE)
    axis = ShapedAxis(0.02, limits, sway=None, shaper=Off(), grid_steps=1000)
    axis.tick(CommandInput())
    for _ in range(5):
        axis.tick(CommandInput(command), added)
    return axis


@pytest.mark.parametrize(
    ("command", "raw"), [(0.35, 400), (1.0, 1000), (-0.3, -500), (-1.0, -1000)]
)
def test_an_axis_sends_the_command_of_its_curve_and_knows_the_speed(
    command: float, raw: int
) -> None:
    axis = driven(command)
    assert axis.output.steps == raw
    assert axis.output.setpoint == pytest.approx(max(command, -0.8))


def test_an_added_velocity_goes_through_the_curve_too() -> None:
    axis = driven(0.0)
    axis.allow_added(0.25, 1.0)
    for command, added in [(0.5, 0.0)] * 5 + [(0.3, 0.05)] * 5:
        axis.tick(CommandInput(command), added)
    assert axis.output.steps == pytest.approx(400, abs=1)
    assert axis.output.setpoint == pytest.approx(0.35, abs=2e-3)


def test_rounding_never_passes_a_bound() -> None:
    """Ten steps: 0.35 needs 4 of them, which is just within; a little less must be 3."""
    assert on_grid(0.35, 0.0, 0.35, 0.0, 10, curve=CURVE) == (4, pytest.approx(0.35))
    raw, sent = on_grid(0.349, 0.0, 0.349, 0.0, 10, curve=CURVE)
    assert (raw, sent) == (3, pytest.approx(CURVE.velocity(0.3)))
    raw, sent = on_grid(-0.29, -0.29, 0.0, 0.0, 10, curve=CURVE)
    assert (raw, sent) == (-4, pytest.approx(CURVE.velocity(-0.4)))
    assert on_grid(-0.3, -0.3, 0.0, 0.0, 10, curve=CURVE) == (-5, pytest.approx(-0.3))
    assert on_grid(0.01, 0.0, 0.01, 0.0, 10, curve=CURVE) == (0, 0.0)
    # One step of ten is 10 % of the command: beyond the dead band, and faster than is allowed.
    assert CURVE.velocity(0.1) > 0.02
    assert on_grid(0.02, 0.0, 0.02, 0.0, 10, curve=CURVE) == (0, 0.0)
    assert on_grid(0.0, -1.0, 1.0, 0.0, 10, curve=CURVE) == (0, 0.0)


def test_a_step_within_the_dead_band_is_none() -> None:
    """The nearest step to the opening may lie before it: it would move nothing, and is not sent."""
    curve = ValveCurve((-1.0, -0.14, 0.14, 1.0), (-1.0, 0.0, 0.0, 1.0))
    assert round(curve.command(0.001) * 10) == 1
    assert on_grid(0.001, -1.0, 1.0, 0.0, 10, curve=curve) == (0, 0.0)
    assert on_grid(-0.001, -1.0, 1.0, 0.0, 10, curve=curve) == (0, 0.0)
