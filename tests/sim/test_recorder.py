"""Where tip and grapple are, from the frames of a drive."""

import math

import pytest

from canshaper.machine.binding import load_deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.grapple import Grapple, Sway
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.plant import PlantNode
from canshaper_sim.recorder import Recorder
from canshaper_sim.strokes import Script
from tests.rigs.files import CONFIG


@pytest.mark.parametrize(
    "file", ["forwarder.yaml", "forwarder-joints.yaml", "j1939-forwarder.yaml"]
)
@pytest.mark.parametrize(
    ("sway_deg", "tip_m", "grapple_m"),
    [
        # The boom points along y. Hanging; in slew direction (-x); inwards, towards the pillar.
        ((0.0, 0.0), (0.0, 3.0), (0.0, 3.0)),
        ((30.0, 0.0), (0.0, 3.0), (-1.4 * math.sin(math.radians(30.0)), 3.0)),
        ((0.0, 30.0), (0.0, 3.0), (0.0, 3.0 - 1.2 * math.sin(math.radians(30.0)))),
    ],
)
def test_tip_and_grapple_are_seen_from_above(
    file: str,
    sway_deg: tuple[float, float],
    tip_m: tuple[float, float],
    grapple_m: tuple[float, float],
) -> None:
    deployment = load_deployment(CONFIG / file)
    parameters = CraneParameters(Grapple(l1_m=0.2, l2_m=1.2), start_theta1_rad=0.5 * math.pi)
    sway = Sway(*map(math.radians, sway_deg))
    plant, recorder = PlantNode(deployment, parameters, sway=sway), Recorder(deployment, parameters)
    hand = JoystickNode(deployment, Script("still", (), 1.0))
    for frame in (*hand.frames(0), *plant.feedback()):
        recorder.receive(frame, 0.0)
    crane = recorder.recording().crane
    assert crane is not None
    assert crane.tip_m == [pytest.approx(tip_m, abs=2e-3)]
    assert crane.grapple_m == [pytest.approx(grapple_m, abs=2e-3)]
    assert crane.sway_deg == [pytest.approx(math.hypot(*sway_deg), abs=0.01)]
