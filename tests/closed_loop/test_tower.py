"""The shipped tower crane: slew and trolley as one motion, with a rope that is measured.

Two judges: the simulated crane, and a load in a frame at rest that knows of the trolley's path
only, x'' = w^2 (X - x), a straight line in x for a swing of a few degrees.
"""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from canshaper.design.comparison.ropes import RopeFilter, left_deg, works
from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.recording import Recording
from canshaper_sim.strokes import Script, Stroke
from tests.rigs.files import CONFIG, machine_file, read
from tests.rigs.swing import crane_of, swing_from

FILE = CONFIG / "tower-crane.yaml"
OWN, OFF = RopeFilter("the file's", {}), RopeFilter("off", {}, bypass=True)
BOTH = (Stroke("slew", 0.5, 6.0, 1.0), Stroke("trolley", 1.5, 5.0, 1.0))
END_S = 6.5 + 12.0


def driven(deployment: Deployment, radius_m: float, rope_m: float = 30.0) -> Recording:
    """Slew and trolley at once, and half a swing of rest."""
    crane = CraneParameters()
    tower = replace(crane.tower, start_radius_m=radius_m, rope_m=rope_m)
    script = Script("both", BOTH, END_S + 5.6)
    return drive(deployment, script, parameters=replace(crane, tower=tower))


def judged_m(recording: Recording, rope_m: float) -> float:
    """How far the load of the straight line is from the trolley at most, from END_S on, m."""
    omega_2, steps = 9.81 / rope_m, 4
    path = list(zip(recording.t_s, crane_of(recording).tip_m, strict=True))
    x, v, most = complex(*path[0][1]), 0j, 0.0
    for (before_s, a), (now_s, b) in pairwise(path):
        step_s = (now_s - before_s) / steps
        for k in range(steps):
            hook = complex(*a) + (k + 0.5) / steps * (complex(*b) - complex(*a))
            v += step_s * omega_2 * (hook - x)
            x += step_s * v
        most = max(most, abs(x - complex(*b))) if now_s >= END_S else most
    return most


def left(recording: Recording) -> float:
    return swing_from(recording, END_S)


def test_slew_and_trolley_are_one_motion_of_the_measured_rope() -> None:
    recording = driven(read(FILE), 40.0)
    assert left(recording) < 0.05
    assert math.degrees(judged_m(recording, 30.0) / 30.0) < 0.15


def test_without_the_motion_more_is_left() -> None:
    text = FILE.read_text(encoding="utf-8")
    assert "\nmotion:" in text
    deployment = read(FILE)
    config = deployment.config.model_copy(update={"motion": {}})
    apart = driven(replace(deployment, config=config, motions={}), 40.0)
    assert left(apart) > 1.0
    assert math.degrees(judged_m(apart, 30.0) / 30.0) == pytest.approx(left(apart), abs=0.3)


@pytest.mark.slow
def test_what_is_left_of_every_work() -> None:
    """Still ropes at most 5 % of the raw swing, and a part of a degree however it is hoisted."""
    for work in works(read(FILE)):
        own = left_deg(read(FILE), (OWN, work))
        assert own < (0.5 if "hoisted" in work.name else 0.25)
        assert own <= 0.05 * left_deg(read(FILE), (OFF, work)), work


@pytest.mark.slow
@pytest.mark.parametrize("error_pct", [-5.0, 5.0])
def test_with_a_length_signal_that_is_wrong(error_pct: float) -> None:
    for work in works(read(FILE)):
        tower = replace(
            CraneParameters().tower,
            rope_m=work.rope_m,
            rope_error_pct=error_pct,
            start_radius_m=work.radius_m or 0.0,
        )
        end_s = max(one.end_s for one in work.strokes) + 12.0
        axes = read(FILE).by_coordinate
        script = Script("wrong", work.strokes, end_s + 8.0).moving(axes)
        recording = drive(read(FILE), script, parameters=CraneParameters(tower=tower))
        assert swing_from(recording, end_s) < 2.0


def test_a_motion_may_have_one_axis_with_a_rope(tmp_path: Path) -> None:
    text = FILE.read_text(encoding="utf-8")
    radius = text[text.index("    radius: {") : text.index("    max_pct: 50")]
    path = machine_file(tmp_path, FILE, ("    near_far: trolley\n", ""), (radius, ""))
    assert 0.2 < left(driven(load_deployment(path), 40.0)) < 2.5
