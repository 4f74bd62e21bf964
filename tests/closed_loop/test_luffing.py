"""The shipped telehandler: slew, luffing and telescope on a rope that is measured."""

import math
from dataclasses import replace

import pytest

from canshaper.design.comparison.ropes import left_deg, works
from canshaper.design.lockstep import drive
from canshaper_sim.crane import CraneParameters
from canshaper_sim.recording import Recording
from canshaper_sim.strokes import Script, Stroke
from tests.closed_loop.test_tower import OFF, OWN, judged_m, left
from tests.rigs.files import CONFIG, read

FILE = CONFIG / "telehandler.yaml"


def driven(*strokes: Stroke, rope_m: float, bypass: bool = False) -> Recording:
    """18.5 s from the start on, as the judges look from there on, half a swing."""
    crane = CraneParameters()
    luffing = replace(crane.luffing, rope_m=rope_m)
    script = Script("one", strokes, 18.5 + math.pi * math.sqrt(rope_m / 9.81))
    parameters = replace(crane, luffing=luffing)
    return drive(read(FILE), script, parameters=parameters, bypass=bypass)


def test_slewing_leaves_a_tenth_and_the_telescope_holds_the_circle() -> None:
    slew = Stroke("slew", 0.5, 8.0, 1.0)
    recording = driven(slew, rope_m=8.0)
    assert left(recording) < 0.1
    assert math.degrees(judged_m(recording, 8.0) / 8.0) < 0.2
    assert max(map(abs, recording.axes["telescope"].speed)) > 0.05
    assert left(driven(slew, rope_m=8.0, bypass=True)) > 5.0


def test_luffing_leaves_a_tenth() -> None:
    recording = driven(Stroke("luffing", 0.5, 5.0, 1.0), rope_m=8.0)
    assert left(recording) < 0.3
    assert math.degrees(judged_m(recording, 8.0) / 8.0) == pytest.approx(left(recording), abs=0.15)
    assert max(recording.axes["luffing"].speed) == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_what_is_left_of_every_work() -> None:
    """Each kind of work with each rope leaves at most a tenth of its largest raw swing."""
    worst: dict[str, list[float]] = {}
    for work in works(read(FILE)):
        row = worst.setdefault(work.name, [0.0, 0.0])
        for k, one in enumerate((OWN, OFF)):
            row[k] = max(row[k], left_deg(read(FILE), (one, work)))
    for name, (own, raw) in worst.items():
        if not name.endswith("all"):
            assert own <= 0.1 * raw, name
        assert own < 1.2, name
