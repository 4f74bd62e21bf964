"""The plant sends its load: the weight, or whether there is one."""

from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode
from tests.rigs.files import machine_file

LOG = ["log.grip_s=0.25", "log.mass_kg=600"]


def said(tmp_path: Path, signal: str, most: int) -> list[int]:
    """Raw values in half a second."""
    changes = {"signal: Weight": f"signal: {signal}", "breakpoint: 600": f"breakpoint: {most}"}
    file = machine_file(tmp_path, "forwarder-load", *changes.items())
    plant = PlantNode(load_deployment(file), changed_parameters(LOG), listeners=False)
    raw = []
    for _ in range(25):
        plant.advance(0.02)
        raw += [frame.data for frame in plant.feedback() if frame.can_id == 0x414]
    return [int.from_bytes(data[:2], "little") or data[2] for data in raw]


@pytest.mark.parametrize(("signal", "most"), [("Weight", 600), ("Gripped", 1)])
def test_it_comes_every_tenth_of_a_second(tmp_path: Path, signal: str, most: int) -> None:
    assert said(tmp_path, signal, most) == [0] * 3 + [most] * 3
