"""The crane of forwarder.yaml damps as much behind a gateway, twice in one machine, with others.

Joysticks and valves may be nodes of J1939, or of CANopen, which follow in ACTIVE only.
"""

from functools import cache
from pathlib import Path

import pytest

from canshaper.design.lockstep import drive
from canshaper.errors import DriveError
from canshaper.machine.binding import load_deployment
from canshaper.report.metrics import compare
from canshaper_sim.cranes import cranes, one_crane
from canshaper_sim.operator import SCRIPTS
from tests.rigs.files import CONFIG, machine_file


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
@pytest.mark.parametrize(
    ("file", "crane"),
    [
        ("gateway-forwarder.yaml", None),  # the joystick's own frames, a cycle later
        ("two-cranes.yaml", "front"),
        ("two-cranes.yaml", "rear"),
        ("canopen-forwarder.yaml", None),
        ("j1939-forwarder.yaml", None),
    ],
)
def test_it_damps_as_much(file: str, crane: str | None) -> None:
    reductions = residual_reduction_pct(file, crane)
    assert reductions == pytest.approx(residual_reduction_pct("forwarder.yaml"), abs=1.0)
    assert min(reductions.values()) > 90.0


def test_a_crane_is_the_first_part_of_the_names_of_its_axes() -> None:
    deployment = load_deployment(CONFIG / "two-cranes.yaml")
    assert cranes(deployment) == ["front", "rear"]
    rear = one_crane(deployment, "rear")
    assert list(rear.axes) == ["slew", "near_far", "lift", "rotator"]
    assert list(rear.config.buses) == ["rear"]
    assert list(rear.joysticks) == ["rear_left", "rear_right", "rear_rocker"]


def test_a_crane_may_have_a_name_that_another_begins_with(tmp_path: Path) -> None:
    file = machine_file(tmp_path, "two-cranes", ("rear_", "front_left_"))
    deployment = load_deployment(file)
    for crane in ("front", "front_left"):
        assert list(one_crane(deployment, crane).axes) == ["slew", "near_far", "lift", "rotator"]


@pytest.mark.parametrize("file", ["forwarder.yaml", "forwarder-joints.yaml"])
def test_the_axes_of_one_crane_are_no_names_of_several(file: str) -> None:
    deployment = load_deployment(CONFIG / file)
    assert cranes(deployment) == []
    with pytest.raises(DriveError, match="expected none, there is one, got"):
        drive(deployment, SCRIPTS["one-by-one"], crane="front")
