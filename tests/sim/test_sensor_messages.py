"""The simulated sway sensors send the swing of the plane that their axis moves."""

from pathlib import Path

from canshaper.machine.binding import load_deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.grapple import Sway
from canshaper_sim.plant import PlantNode
from canshaper_sim.sway_sensor import SwaySensorParameters
from tests.rigs.files import machine_file

ACROSS_ALONG = 0x410
QUIET = CraneParameters(sway_sensor=SwaySensorParameters(noise_deg=0.0))


def sent(file: Path) -> list[bytes]:
    """Data of the first message of the sensors, of a grapple that swings in both planes."""
    plant = PlantNode(load_deployment(file), QUIET, sway=Sway(0.1, -0.05))
    plant.advance(0.02)
    return [frame.data for frame in plant.feedback() if frame.can_id == ACROSS_ALONG]


def test_an_axis_that_slews_under_another_name_shows_the_swing_across(tmp_path: Path) -> None:
    before = sent(machine_file(tmp_path, "forwarder-sensor"))
    crane = "crane: { kind: cylindrical, slew: turn, near_far: near_far, lift: lift }\n\naxes:\n"
    names = ("  slew:\n", "  turn:\n"), ("slew: slew\n", "slew: turn\n"), ("axes:\n", crane)
    (data,) = before
    assert data[:2] != data[2:4]
    assert sent(machine_file(tmp_path, "forwarder-sensor", *names)) == before
