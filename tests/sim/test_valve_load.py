"""Valves without pressure compensation: the load, and its direction, change the speed."""

import math
from dataclasses import replace

import pytest

from canshaper.errors import DesignError
from canshaper_sim.axes import LIFT, NEAR_FAR, SLEW
from canshaper_sim.crane import Crane
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.valve import ValveParameters
from tests.sim.drives import TICK_S

FULL = {SLEW: 1.0, NEAR_FAR: 1.0, LIFT: 1.0}


def crane(*changes: str) -> Crane:
    return Crane(changed_parameters(["radius_max_m=30", "height_max_m=30", *changes]))


def opening(of: Crane, axis: str, command: float, seconds: float = 2.0) -> float:
    for _ in range(round(seconds / TICK_S)):
        of.step(TICK_S, {axis: command})
    return of.opening(axis)


@pytest.mark.parametrize(
    ("load", "command", "speed"),
    [(0.36, 1.0, 0.8), (0.36, -1.0, -math.sqrt(1.36)), (-0.44, 1.0, 1.2), (0.0, 1.0, 1.0)],
)
def test_the_speed_is_the_root_of_the_pressure_that_is_left(
    load: float, command: float, speed: float
) -> None:
    assert opening(crane(f"lift.load={load}"), LIFT, command, 1.5) == pytest.approx(speed, abs=1e-5)


def test_the_axis_with_the_heavier_load_is_slower() -> None:
    both = crane("slew.load=0.1", "lift.load=0.5")
    for _ in range(100):
        both.step(TICK_S, FULL)
    got = [both.opening(axis) for axis in (SLEW, NEAR_FAR, LIFT)]
    assert got == pytest.approx([0.9**0.5, 1.0, 0.5**0.5], abs=1e-6)


def test_a_log_in_the_grapple_slows_the_lift() -> None:
    of = crane("lift.load=0.19", "lift.load_per_t=0.34", "log.grip_s=2", "log.mass_kg=500")
    assert opening(of, LIFT, 1.0, 1.9) == pytest.approx(0.9, abs=1e-4)
    assert opening(of, LIFT, 1.0, 1.9) == pytest.approx(0.8, abs=1e-4)
    of.pick_up(replace(of.parameters.grapple, m2_kg=300.0))  # and is put down
    assert opening(of, LIFT, 1.0, 1.9) == pytest.approx(0.9, abs=1e-4)


def test_a_load_that_takes_all_the_pressure_holds_the_axis() -> None:
    of = crane("lift.load=0.8", "lift.load_per_t=0.5", "log.grip_s=0", "log.mass_kg=500")
    assert opening(of, LIFT, 1.0) == pytest.approx(0.0, abs=1e-6)
    assert opening(of, LIFT, -1.0, 1.0) < -1.0


def test_what_it_does_from_the_first_step_on() -> None:
    """A spool that leaves the middle at once meets the load of its direction."""
    jump = ("lift.load=0.5", "lift.rate_limit_1_s=inf", "lift.deadband=0")
    up = opening(crane(*jump), LIFT, 1.0, TICK_S)
    assert up == pytest.approx(0.5**0.5 * -math.expm1(-0.2), abs=1e-12)


def test_the_pump_shares_what_the_loads_let_through() -> None:
    of = crane("pump_flow=1.2", "slew.load=0.36")
    for _ in range(100):
        of.step(TICK_S, {SLEW: 1.0, NEAR_FAR: 1.0})
    part = 1.2 / 1.8
    assert of.opening(SLEW) == pytest.approx(0.8 * part, abs=1e-6)
    assert of.opening(NEAR_FAR) == pytest.approx(part, abs=1e-6)
    assert opening(crane("pump_flow=3", "slew.load=0.36"), SLEW, 1.0) == pytest.approx(0.8)
    starved = crane("pump_flow=1.2", "slew.load=0.36", "pump.shares_flow=0")
    for _ in range(100):
        starved.step(TICK_S, {SLEW: 1.0, NEAR_FAR: 1.0})
    assert starved.opening(NEAR_FAR) == pytest.approx(1.0, abs=1e-6)
    assert starved.opening(SLEW) == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize(("gain", "command", "flow"), [(1.6, -1.0, -1.6), (1.6, -0.5, -0.8)])
def test_a_cylinder_is_faster_towards_its_rod(gain: float, command: float, flow: float) -> None:
    valve = ValveParameters(deadband=0.0, negative_gain=gain)
    assert valve.flow(command) == pytest.approx(flow)
    assert valve.flow(-command) == -command
    assert replace(valve, flow_limit=0.5).flow(-1.0) == pytest.approx(-0.8)


@pytest.mark.parametrize("name", ["load", "load_per_t"])
def test_more_pressure_than_the_supply_has_is_refused(name: str) -> None:
    with pytest.raises(DesignError, match=rf"valve: {name}: expected -0.9 .. 0.9, got 0.95"):
        changed_parameters([f"lift.{name}=0.95"])
