"""The comparison on machines whose filters follow the load, or that have sway sensors."""

from pathlib import Path

import pytest

from canshaper.design.comparison.manoeuvres import candidates, manoeuvres, with_candidate
from canshaper.design.comparison.measure import measure
from canshaper.machine.binding import load_deployment
from tests.rigs.files import CONFIG, machine_file, read

LOAD, SENSOR = read(CONFIG / "forwarder-load.yaml"), read(CONFIG / "forwarder-sensor.yaml")
BY_LOAD = "the file's, by load"
ZV, SENSED = "limit-aware ZV", "ZV +sensor"


def test_a_schedule_has_a_row_of_its_own_and_chooses_in_no_other() -> None:
    for one in candidates(LOAD):
        axes = with_candidate(LOAD, one).axes.values()
        schedules = sum(bool(axis.config.gain_schedule) for axis in axes)
        assert schedules == (2 if one.name == BY_LOAD else 0)
    without = read(CONFIG / "forwarder-robust.yaml")
    assert BY_LOAD not in [one.name for one in candidates(without)]


@pytest.mark.slow
def test_the_load_that_it_knows_leaves_little() -> None:
    every = {one.name: one for one in candidates(LOAD)}
    loads = [one for one in manoeuvres() if one.load_s is not None]
    by_load, zv = (
        max(measure(LOAD, every[name], one, 0).residual_deg for one in loads)
        for name in (BY_LOAD, "ZV")
    )
    print(f"{by_load:.2f} degrees, ZV of the middle {zv:.2f}")
    assert by_load < min(2.0, 0.7 * zv)


def test_a_sensor_that_damps_has_rows_of_its_own() -> None:
    every = {one.name: one for one in candidates(SENSOR)}
    sensed = [name for name, one in every.items() if one.sensor]
    assert sensed[0] == SENSED
    assert len(sensed) == 4
    for name, sensors in ((ZV, 0), (SENSED, 2)):
        axes = with_candidate(SENSOR, every[name]).axes.values()
        assert sum(axis.sway_sensor is not None for axis in axes) == sensors


def test_a_sensor_that_only_watches_has_none(tmp_path: Path) -> None:
    watched = "invert: true, use: damp", "invert: true, use: watch"
    path = machine_file(tmp_path, "forwarder-sensor", watched)
    assert not [one for one in candidates(load_deployment(path)) if one.sensor]


@pytest.mark.slow
@pytest.mark.parametrize("length_pct", [-30, 30])
def test_with_it_a_wrong_length_leaves_little(length_pct: int) -> None:
    every = {one.name: one for one in candidates(SENSOR)}
    pulse = next(one for one in manoeuvres() if one.name == "pulse near-far")
    without, with_it = (
        measure(SENSOR, every[name], pulse, length_pct).residual_deg for name in (ZV, SENSED)
    )
    assert without > 2.0
    assert with_it < 0.8
