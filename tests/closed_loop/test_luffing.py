"""The shipped telehandler: slew, luffing and telescope on a rope that is measured."""

import math
from dataclasses import replace

import pytest

from canshaper.controller.events import RefusalEvent
from canshaper.design.comparison.ropes import left_deg, works
from canshaper.design.lockstep import Simulation, drive
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.operator import script_for
from canshaper_sim.recording import Recording
from canshaper_sim.strokes import Script, Stroke
from tests.closed_loop.test_tower import OFF, OWN, judged_m, left
from tests.rigs.files import CONFIG, read

FILE = CONFIG / "telehandler.yaml"


def driven(
    *strokes: Stroke, rope_m: float, bypass: bool = False, deployment: Deployment | None = None
) -> Recording:
    """18.5 s from the start on, as the judges look from there on, half a swing."""
    crane = CraneParameters()
    luffing = replace(crane.luffing, rope_m=rope_m)
    script = Script("one", strokes, 18.5 + math.pi * math.sqrt(rope_m / 9.81))
    parameters = replace(crane, luffing=luffing)
    return drive(deployment or read(FILE), script, parameters=parameters, bypass=bypass)


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


UP_AND_DOWN = Stroke("luffing", 0.5, 3.5, 1.0), Stroke("luffing", 4.0, 3.5, -1.0)
ALL_AT_ONCE = (
    Stroke("slew", 0.5, 8.0, 1.0),
    Stroke("luffing", 2.0, 4.0, 1.0),
    Stroke("telescope", 3.0, 5.0, 1.0),
)


@pytest.mark.parametrize(("rope_m", "strokes"), [(4.0, UP_AND_DOWN), (16.0, ALL_AT_ONCE)])
def test_luffing_makes_up_for_its_arc(rope_m: float, strokes: tuple[Stroke, ...]) -> None:
    recording = driven(*strokes, rope_m=rope_m)
    assert left(recording) < 0.22
    without = luffing_alone_knows_nothing()
    assert left(driven(*strokes, rope_m=rope_m, deployment=without)) > 0.5


def luffing_alone_knows_nothing() -> Deployment:
    """The motion without luffing."""
    deployment = read(FILE)
    ((name, bound),) = deployment.motions.items()
    config = bound.config.model_copy(update={"luffing": None, "luffing_rad_s": None})
    return replace(deployment, motions={name: replace(bound, config=config)})


def test_the_gate_lets_all_of_it_pass() -> None:
    """What luffing adds is in the range of its own demands, for which the gate looks as before."""
    script = script_for(read(FILE), "random-45")
    simulation = Simulation(read(FILE), script)
    for _ in simulation.ticks():
        assert not [one for one in simulation.controller.events if isinstance(one, RefusalEvent)]


@pytest.mark.slow
def test_what_is_left_of_every_work() -> None:
    for work in works(read(FILE)):
        own, raw = (left_deg(read(FILE), (one, work)) for one in (OWN, OFF))
        assert own <= 0.1 * raw, work
