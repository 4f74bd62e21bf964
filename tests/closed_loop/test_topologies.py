"""The crane of forwarder.yaml behind a gateway, and twice in one machine, damps as much."""

from functools import cache
from pathlib import Path

import pytest

from canshaper.design.lockstep import drive
from canshaper.errors import DriveError
from canshaper.machine.binding import load_deployment
from canshaper.report.metrics import compare
from canshaper_sim.cranes import cranes, one_crane
from canshaper_sim.operator import SCRIPTS

CONFIG = Path(__file__).resolve().parents[2] / "config"


@cache
def residual_reduction_pct(file: str, crane: str | None = None) -> dict[str, float]:
    deployment = load_deployment(CONFIG / file)
    script = SCRIPTS["one-by-one"]
    raw = drive(deployment, script, bypass=True, crane=crane)
    report = compare(raw, drive(deployment, script, crane=crane))
    reductions = {name: report[name].residual_reduction_pct for name in ("slew", "near_far")}
    print(file, crane, reductions)
    return {name: value for name, value in reductions.items() if value is not None}


@pytest.mark.slow
def test_a_gateway_in_the_line_damps_as_much() -> None:
    """By the joystick's own frames with our velocities in them, a cycle later."""
    reductions = residual_reduction_pct("gateway-forwarder.yaml")
    assert reductions == pytest.approx(residual_reduction_pct("forwarder.yaml"), abs=1.0)
    assert min(reductions.values()) > 90.0


@pytest.mark.slow
@pytest.mark.parametrize("crane", ["front", "rear"])
def test_each_of_two_cranes_damps_as_much(crane: str) -> None:
    reductions = residual_reduction_pct("two-cranes.yaml", crane)
    assert reductions == pytest.approx(residual_reduction_pct("forwarder.yaml"), abs=1.0)
    assert min(reductions.values()) > 90.0


def test_a_crane_is_the_first_part_of_the_names_of_its_axes() -> None:
    deployment = load_deployment(CONFIG / "two-cranes.yaml")
    assert cranes(deployment) == ["front", "rear"]
    rear = one_crane(deployment, "rear")
    assert list(rear.axes) == ["slew", "near_far", "lift", "rotator"]
    assert list(rear.config.buses) == ["rear"]
    assert list(rear.joysticks) == ["rear_left", "rear_right", "rear_rocker"]


@pytest.mark.parametrize("file", ["forwarder.yaml", "forwarder-joints.yaml"])
def test_the_axes_of_one_crane_are_no_names_of_several(file: str) -> None:
    deployment = load_deployment(CONFIG / file)
    assert cranes(deployment) == []
    with pytest.raises(DriveError, match="expected none, there is one, got"):
        drive(deployment, SCRIPTS["one-by-one"], crane="front")
