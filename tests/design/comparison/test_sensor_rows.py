"""The comparison of filters on a machine with sway sensors."""

from pathlib import Path

import pytest

from canshaper.design.comparison.manoeuvres import candidates, manoeuvres, with_candidate
from canshaper.design.comparison.measure import measure
from canshaper.machine.binding import load_deployment
from tests.rigs.files import machine_file

FILE = Path(__file__).parents[3] / "config" / "forwarder-sensor.yaml"
ZV, SENSED = "limit-aware ZV", "ZV +sensor"


def test_a_sensor_that_damps_has_rows_of_its_own() -> None:
    deployment = load_deployment(FILE)
    every = {one.name: one for one in candidates(deployment)}
    sensed = [name for name, one in every.items() if one.sensor]
    assert sensed[0] == SENSED
    assert len(sensed) == 4
    for name, sensors in ((ZV, 0), (SENSED, 2)):
        axes = with_candidate(deployment, every[name]).axes.values()
        assert sum(axis.sway_sensor is not None for axis in axes) == sensors


def test_a_sensor_that_only_watches_has_none(tmp_path: Path) -> None:
    path = machine_file(tmp_path, FILE, ("invert: true, use: damp", "invert: true, use: watch"))
    assert not [one for one in candidates(load_deployment(path)) if one.sensor]


@pytest.mark.slow
@pytest.mark.parametrize("length_pct", [-30, 30])
def test_with_it_a_wrong_length_leaves_little(length_pct: int) -> None:
    deployment = load_deployment(FILE)
    every = {one.name: one for one in candidates(deployment)}
    pulse = next(one for one in manoeuvres() if one.name == "pulse near-far")
    without, with_it = (
        measure(deployment, every[name], pulse, length_pct).residual_deg for name in (ZV, SENSED)
    )
    assert without > 2.0
    assert with_it < 0.8
