"""A pump that delivers less than two axes ask for: with a flow budget the swing is cancelled.

``pytest -s tests/closed_loop/test_pump.py`` prints the figures: swing left, mean and worst, degrees
of total tilt.
"""

import statistics
from collections.abc import Iterable

import pytest

from canshaper.design.lockstep import drive
from canshaper.machine.deployment import Deployment
from canshaper_sim.operator import SCRIPTS
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.strokes import Script
from tests.closed_loop.test_motion import tilt_deg
from tests.closed_loop.test_twin import OPERATORS, TIMINGS
from tests.rigs.files import ROOT, read

PROPORTIONAL, STARVING = (), ("pump.shares_flow=0",)


def shipped(name: str) -> Deployment:
    return read(ROOT / "config" / f"{name}.yaml")


def left_deg(
    deployment: Deployment, scripts: Iterable[Script], *changes: str
) -> tuple[float, float]:
    """Swing left in the last three seconds of each drive: mean and worst."""
    crane = changed_parameters(["radius_max_m=12", *changes])
    drives = (drive(deployment, script, parameters=crane) for script in scripts)
    residuals = [max(tilt_deg(recording)[-150:]) for recording in drives]
    mean, worst = statistics.mean(residuals), max(residuals)
    print(f"{deployment.path.stem} {' '.join(changes)}: {mean:.2f} in the mean, {worst:.2f} worst")
    return mean, worst


@pytest.mark.slow
@pytest.mark.parametrize("flow", [1.2, 1.5, 1.8])
def test_the_demo_leaves_little_swing(flow: float) -> None:
    assert left_deg(shipped("forwarder-pump"), [SCRIPTS["demo"]], f"pump_flow={flow}")[1] <= 0.6


@pytest.mark.slow
def test_without_a_budget_it_leaves_much() -> None:
    assert left_deg(shipped("forwarder-robust"), [SCRIPTS["demo"]], "pump_flow=1.2")[1] > 2.0


@pytest.mark.slow
@pytest.mark.parametrize("sharing", [PROPORTIONAL, STARVING], ids=["proportional", "starving"])
@pytest.mark.parametrize("flow", [1.2, 1.3])
def test_both_joysticks_at_any_timing(flow: float, sharing: tuple[str, ...]) -> None:
    mean, worst = left_deg(shipped("forwarder-pump"), TIMINGS, f"pump_flow={flow}", *sharing)
    assert mean <= 0.3
    assert worst <= 0.6


@pytest.mark.slow
@pytest.mark.parametrize("sharing", [PROPORTIONAL, STARVING], ids=["proportional", "starving"])
def test_twenty_operators(sharing: tuple[str, ...]) -> None:
    mean, worst = left_deg(shipped("forwarder-pump"), OPERATORS, "pump_flow=1.2", *sharing)
    assert mean <= 0.4
    assert worst <= 1.1


@pytest.mark.slow
def test_a_budget_that_is_a_fifth_too_large_costs_little() -> None:
    mean, worst = left_deg(shipped("forwarder-pump"), OPERATORS, "pump_flow=1.0")
    assert mean <= 1.0
    assert worst <= 2.0
