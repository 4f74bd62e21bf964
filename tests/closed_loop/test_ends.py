"""End stops: the tip comes to rest ahead of them, by the filter.

``pytest -s tests/closed_loop/test_ends.py`` prints the figures: swing left, mean and worst, degrees
of total tilt.
"""

import math
import statistics
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml

from canshaper.design.lockstep import Simulation, drive
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import State
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script, Stroke
from tests.closed_loop.test_motion import tilt_deg
from tests.closed_loop.test_pump import shipped
from tests.closed_loop.test_twin import OPERATORS
from tests.rigs.files import text_of
from tests.rigs.swing import crane_of

RADII_M = [round(5.1 + 0.2 * i, 1) for i in range(11)]
PULSE = Script("pulse", (Stroke("near_far", 0.5, 3.0, 1.0, 0.1),), 9.5)
BETWEEN_STOPS = ("start_radius_m=4.4", "radius_min_m=3.6", "radius_max_m=6.2", "pump_flow=1.3")


def machine(tmp_path: Path, axis: str, flow: float, **ends: object) -> Deployment:
    """The shipped machine with a pump, with other ends of an axis."""
    data = yaml.safe_load(text_of("forwarder-pump"))
    data["hydraulics"]["flow"] = flow
    tip = data["axes"]["near_far"]["limits"]["ends"]
    data["axes"][axis]["limits"]["ends"] = tip | ends
    file = tmp_path / "machine.yaml"
    file.write_text(yaml.safe_dump(data), encoding="utf-8")
    return load_deployment(file)


def left_deg(
    deployment: Deployment, drives: Sequence[tuple[Script, Sequence[str]]]
) -> tuple[float, float]:
    """Swing left in the last three seconds of each drive: mean and worst."""
    recordings = [
        drive(deployment, script, parameters=changed_parameters(crane)) for script, crane in drives
    ]
    residuals = [max(tilt_deg(recording)[-150:]) for recording in recordings]
    mean, worst = statistics.mean(residuals), max(residuals)
    print(f"{deployment.path.stem}: {mean:.2f} in the mean, {worst:.2f} worst")
    return mean, worst


def pulses() -> list[tuple[Script, Sequence[str]]]:
    return [(PULSE, [f"start_radius_m={radius_m}"]) for radius_m in RADII_M]


@pytest.fixture(params=[0.05, -0.05], ids=["too far", "too near"])
def late_and_wrong(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The radius that is sent is 100 ms old and 5 cm wrong."""
    sent = PlantNode._values
    waiting: deque[tuple[float, ...]] = deque(maxlen=6)

    def values(plant: PlantNode, name: str, state: Any) -> tuple[float, ...]:
        now = sent(plant, name, state)
        if name != "TipPosition":
            return now
        waiting.append(now)
        slew, radius_m, height_m = waiting[0]
        return slew, radius_m + request.param, height_m

    monkeypatch.setattr(PlantNode, "_values", values)


@pytest.mark.slow
def test_a_pulse_that_would_meet_the_stop() -> None:
    mean, worst = left_deg(shipped("forwarder-pump"), pulses())
    assert mean <= 0.1
    assert worst <= 0.2


@pytest.mark.slow
def test_without_ends_it_meets_the_stop() -> None:
    assert left_deg(shipped("forwarder-robust"), pulses())[0] > 5.0


@pytest.mark.slow
def test_with_a_radius_that_is_late_and_wrong(tmp_path: Path, late_and_wrong: None) -> None:
    mean, worst = left_deg(machine(tmp_path, "near_far", 1.2, margin=0.1), pulses())
    assert mean <= 0.1
    assert worst <= 0.2


@pytest.mark.slow
def test_the_ends_of_slew(tmp_path: Path) -> None:
    ends = {"signal": "SlewAngle", "lowest": -20.0, "highest": 40.0, "full_speed": 28.65}
    deployment = machine(tmp_path, "slew", 1.2, margin=0.5, **ends)
    strokes = [(Script("pulse", (Stroke("slew", 0.5, s, 1.0),), 9.5), []) for s in (1.0, 2.0, 3.0)]
    mean, worst = left_deg(deployment, strokes)
    assert mean <= 0.15  # far from its ends: 0.05 to 0.15
    assert worst <= 0.2
    x_m, y_m = crane_of(drive(deployment, strokes[2][0])).tip_m[-1]
    assert 38.5 < math.degrees(math.atan2(y_m, x_m)) <= 40.0


@pytest.mark.slow
def test_twenty_operators_with_stops_in_their_way(tmp_path: Path) -> None:
    deployment = machine(tmp_path, "near_far", 1.3, lowest=3.6, highest=6.2)
    mean, worst = left_deg(deployment, [(one, BETWEEN_STOPS) for one in OPERATORS])
    assert mean <= 0.4
    assert worst <= 1.2


def test_a_joystick_that_is_held_against_the_stop_trips_nothing(tmp_path: Path) -> None:
    """The motion moves the tip, but never against the joystick: the gate would refuse that."""
    deployment = machine(tmp_path, "near_far", 1.3, lowest=3.6, highest=6.2)
    strokes = (Stroke("near_far", 0.5, 7.5, 1.0), Stroke("slew", 2.5, 3.0, 1.0))
    simulation = Simulation(
        deployment, Script("held", strokes, 12.0), parameters=changed_parameters(BETWEEN_STOPS)
    )
    for _ in simulation.ticks():
        pass
    assert simulation.controller.axes["near_far"].axis.state is State.READY
