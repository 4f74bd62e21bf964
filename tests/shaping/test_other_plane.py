"""Swing that another axis makes, damped by an axis whose joystick no one touches."""

import math
from unittest.mock import Mock

import pytest

from canshaper.shaping.states import CommandInput, State, Trust
from tests.shaping.sensed_rig import SCALE, TICK_S, Rig

LARGEST, TIME_S = 0.25, 4.0


def swinging(rig: Rig, push: float = 0.3) -> Rig:
    """At rest after a drive that has proved the sensor; then the other axis makes it swing."""
    rig.axis.allow_added(LARGEST, TIME_S)
    rig.trusted()
    for command in (0.8, 0.5, 0.2, 0.0):
        rig.command = command
        rig.run(3.0)
    assert not rig.axis.output.commanded
    assert rig.sensed.state is Trust.TRUSTED
    rig.push = push
    rig.run(1.1)
    rig.push = 0.0
    return rig


def swing_deg(rig: Rig) -> float:
    """Amplitude of the grapple's swing."""
    omega = rig.real.mode.omega_rad_s
    return SCALE * math.degrees(math.hypot(rig.real.angle, rig.real.rate / omega))


def test_it_is_damped_within_the_bound_of_what_may_be_added() -> None:
    rig, seen = swinging(Rig()), 0.0
    assert swing_deg(rig) > 3.0
    for _ in range(round(2.5 / TICK_S)):
        rig.run(TICK_S, damps=True)
        seen = max(seen, abs(rig.axis.output.setpoint))
        assert rig.axis.output.applied == rig.axis.output.setpoint
    assert 0.1 < seen <= LARGEST
    assert swing_deg(rig) < 1.0
    assert rig.sensed.state is Trust.TRUSTED
    rig.run(1.0)
    assert (rig.axis.state, rig.axis.output.steps) == (State.READY, 0)


def test_it_is_not_damped_into_an_end_stop_nor_without_bounds_by_ends_that_are_far() -> None:
    for bounds in ((-0.06, 0.04), (0.0, 0.04), (-0.06, 0.0), (-1.0, 1.0)):
        rig = swinging(Rig())
        rig.axis.bounds = bounds
        seen = []
        for _ in range(round(2.5 / TICK_S)):
            rig.run(TICK_S, damps=True)
            seen.append(rig.axis.output.setpoint)
        step = 1.0 / 125
        assert max(-LARGEST, bounds[0]) - step <= min(seen)
        assert max(seen) <= min(LARGEST, bounds[1]) + step
        assert min(seen) < 0.0 or not bounds[0]
        assert max(seen) > 0.0 or not bounds[1]


@pytest.mark.parametrize("damps", [False, True])
def test_not_by_a_sensor_that_is_only_watched_and_not_where_no_other_axis_makes_it(
    damps: bool,
) -> None:
    rig = swinging(Rig(damps=not damps))
    for _ in range(50):
        rig.run(TICK_S, damps=damps)
        assert (rig.axis.state, rig.axis.output.steps) == (State.READY, 0)


def test_not_by_an_axis_that_has_no_sensor_or_may_not_be_added_to() -> None:
    rig = swinging(Rig())
    rig.axis.allow_added(0.0, TIME_S)
    rig.run(1.0, damps=True)
    assert rig.axis.output.steps == 0
    rig.axis.allow_added(LARGEST, TIME_S)
    rig.axis.sensed = None
    for _ in range(20):
        rig.axis.command(CommandInput(enabled=True), 0.0, damps=True)
        rig.axis.propagate()
        assert rig.axis.output.steps == 0


def test_for_no_longer_than_may_be_added() -> None:
    rig = swinging(Rig())
    rig.axis.allow_added(LARGEST, 0.5)
    rig.run(0.46, damps=True)
    assert rig.axis.output.steps != 0
    rig.run(0.3, damps=True)
    assert rig.axis.output.steps == 0


def test_a_held_joystick_counts_alone() -> None:
    rig, twin = swinging(Rig()), swinging(Rig())
    rig.command = twin.command = -0.3
    for _ in range(round(1.5 / TICK_S)):
        rig.run(TICK_S, damps=True)
        twin.run(TICK_S)
        assert rig.axis.output.steps == twin.axis.output.steps


def test_a_grapple_that_leans_on_something_does_not_drive_it_away() -> None:
    rig = swinging(Rig(), push=0.0)
    way = 0.0
    for _ in range(round(TIME_S / TICK_S)):
        rig.run(TICK_S, math.radians(6.0), damps=True)
        way += TICK_S * rig.axis.output.setpoint
    assert rig.sensed.state in (Trust.JUMP, Trust.CONTACT, Trust.STUCK)
    assert abs(way) < 0.1


def test_what_it_does_for_another_axis_is_no_restlessness() -> None:
    rig = swinging(Rig())
    for _ in range(4):
        rig.push = 0.3
        rig.run(0.6, damps=True)
        rig.push = -0.3
        rig.run(0.6, damps=True)
        assert rig.sensed.state is Trust.TRUSTED


def test_unasked_for_nothing_is_damped() -> None:
    rig = swinging(Rig())
    rig.axis.tick(CommandInput(enabled=True))
    assert rig.axis.output.steps == 0


def test_the_path_of_the_other_axis_is_run_besides() -> None:
    rig = swinging(Rig(), push=0.0)
    for tick in range(100):  # the tip leads the grapple by the path
        angle = rig.angle + SCALE * 0.1 * TICK_S * tick
        rig.sensed.measure(angle, SCALE, commanded=False, damps=True)
        rig.axis.command(CommandInput(enabled=True), 0.1, damps=True)
        rig.axis.propagate()
        rig.real.step(rig.axis.output.applied)
    assert rig.axis.output.setpoint == pytest.approx(0.1, abs=0.03)
    assert rig.axis.output.applied == pytest.approx(rig.axis.output.setpoint - 0.1)


def test_with_a_path_at_full_speed_it_is_no_error() -> None:
    rig = swinging(Rig())
    for sign in [1.0] * 30 + [-1.0] * 30:
        rig.sensed.measure(rig.angle, SCALE, commanded=False, damps=True)
        rig.axis.command(CommandInput(enabled=True), sign, damps=True)
        rig.axis.propagate()
        rig.real.step(rig.axis.output.applied)
        assert rig.axis.state is State.ACTIVE
        assert abs(rig.axis.output.setpoint) <= LARGEST
    rig.axis.command(CommandInput(enabled=True), -1.1, damps=True)
    assert rig.axis.state is State.TRIPPED


def test_a_filter_that_gives_no_number_while_the_axis_damps_is_named() -> None:
    rig = swinging(Rig())
    rig.run(0.1, damps=True)
    assert rig.axis.output.damping
    rig.axis.transfer.shaper = Mock(step=Mock(return_value=math.nan))
    tripped = rig.axis.command(CommandInput(enabled=True), 0.0, damps=True)
    assert tripped is not None
    assert tripped.error.startswith("ValueError: filter output is nan (")
