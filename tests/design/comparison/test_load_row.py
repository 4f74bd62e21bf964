"""The comparison on a machine whose filters follow the load."""

from pathlib import Path

import pytest

from canshaper.design.comparison.manoeuvres import candidates, manoeuvres, with_candidate
from canshaper.design.comparison.measure import measure
from canshaper.machine.binding import load_deployment

FILE = Path(__file__).parents[3] / "config" / "forwarder-load.yaml"
BY_LOAD = "the file's, by load"


def test_a_schedule_has_a_row_of_its_own_and_chooses_in_no_other() -> None:
    deployment = load_deployment(FILE)
    for one in candidates(deployment):
        axes = with_candidate(deployment, one).axes.values()
        schedules = sum(bool(axis.config.gain_schedule) for axis in axes)
        assert schedules == (2 if one.name == BY_LOAD else 0)
    without = load_deployment(FILE.with_name("forwarder-robust.yaml"))
    assert BY_LOAD not in [one.name for one in candidates(without)]


@pytest.mark.slow
def test_the_load_that_it_knows_leaves_little() -> None:
    deployment = load_deployment(FILE)
    every = {one.name: one for one in candidates(deployment)}
    loads = [one for one in manoeuvres() if one.load_s is not None]
    by_load, zv = (
        max(measure(deployment, every[name], one, 0).residual_deg for one in loads)
        for name in (BY_LOAD, "ZV")
    )
    print(f"{by_load:.2f} degrees, ZV of the middle {zv:.2f}")
    assert by_load < min(2.0, 0.7 * zv)
