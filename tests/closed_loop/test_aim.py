"""The aim point against the simulated crane: where it then really stops.

``pytest -s tests/closed_loop/test_aim.py`` prints the worst error.
"""

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass

import pytest

from canshaper.controller.status_messages import AimPoint
from canshaper.design.lockstep import Simulation
from canshaper.machine.deployment import Deployment
from canshaper_sim.operator import AXES, SCRIPTS, random_script
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.strokes import Script
from tests.rigs.files import ROOT, read

REST_S = 8.0


@dataclass(frozen=True)
class Released(Script):
    """A script whose joysticks are let go at once at some time."""

    released_s: float = 0.0

    def command(self, axis: str, time_s: float) -> float:
        return 0.0 if time_s >= self.released_s else super().command(axis, time_s)


def errors(
    deployment: Deployment, script: Script, released_s: float, *changes: str
) -> tuple[float, float] | None:
    """Aim less where it stops, degrees and cm; None where it was not known."""
    played = Released(script.name, script.strokes, script.duration_s, released_s)
    simulation = Simulation(
        deployment,
        played,
        lambda *_: None,
        parameters=changed_parameters(["radius_max_m=12", *changes]),
    )
    (aim,) = simulation.controller.status.aims
    said: tuple[float, float] | None = None
    state = simulation.plant.crane.state
    for time_ms in simulation.ticks():
        state = simulation.plant.crane.state
        if time_ms == round(1000 * released_s) - 20:  # of the last command
            said = _aimed(aim, math.degrees(state.theta1_rad), state.radius_m)
            if said is None:
                return None
    assert said is not None
    return said[0] - math.degrees(state.theta1_rad), 100.0 * (said[1] - state.radius_m)


def _aimed(aim: AimPoint, slewed_deg: float, radius_m: float) -> tuple[float, float] | None:
    aim.update()
    return (slewed_deg + aim.slew_deg, radius_m + aim.radius_m) if aim.known else None


def share_within(results: Sequence[tuple[float, float]]) -> float:
    """Share of releases that stop within 1 degree and 5 cm of the aim."""
    worst = [max(abs(one[k]) for one in results) for k in (0, 1)]
    print(f"{len(results)} releases, worst {worst[0]:.2f} deg, {worst[1]:.1f} cm")
    return sum(abs(deg) <= 1.0 and abs(cm) <= 5.0 for deg, cm in results) / len(results)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "changes"), [("robust", ()), ("pump", ("pump_flow=1.2",))], ids=["free", "pump"]
)
def test_19_of_20_releases_stop_where_it_says(name: str, changes: tuple[str, ...]) -> None:
    deployment, results = read(ROOT / "config" / f"forwarder-{name}.yaml"), []
    for seed in range(60):
        script, rng = random_script(seed, 20.0, AXES), random.Random(seed)
        script = Script(script.name, script.strokes, 20.0 + REST_S)
        results.append(errors(deployment, script, 0.02 * rng.randint(100, 900), *changes))
    known = [one for one in results if one is not None]
    print(f"{percent(known, results)} of the releases are known")
    assert share_within(known) >= 0.95


def percent(known: Sequence[object], results: Sequence[object]) -> str:
    return f"{100 * len(known) / len(results):.0f} %"


@pytest.mark.slow
def test_in_a_loading_cycle_too() -> None:
    deployment = read(ROOT / "config" / "forwarder-robust.yaml")
    script = SCRIPTS["loading"]
    script = Script(script.name, script.strokes, script.duration_s + REST_S)
    times = {stroke.end_s - before_s for stroke in script.strokes for before_s in (0.1, 0.4, 0.7)}
    results = [errors(deployment, script, 0.02 * round(time / 0.02)) for time in sorted(times)]
    known = [one for one in results if one is not None]
    print(f"{percent(known, results)} of the releases are known")
    assert len(known) > 0.5 * len(results)
    assert share_within(known) >= 0.95
