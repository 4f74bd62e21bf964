"""The plant sends its load: the weight, or whether there is one."""

from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode
from tests.rigs.files import ROOT, machine_file

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


def test_the_rope_is_sent_in_the_message_of_the_file(tmp_path: Path) -> None:
    dbc = (ROOT / "dbc" / "bridge-crane.dbc").read_text(encoding="utf-8")
    own = 'BO_ 1100 Winch: 2 PLANT\n SG_ Out : 7|16@0+ (0.01,0) [0.3|200] "m" SHAPER\n\nBO_ 1041 '
    cycle = 'BA_ "GenMsgCycleTime" BO_ 1100 100;\nBA_ "GenMsgCycleTime" BO_ 1041 '
    dbc = dbc.replace("BO_ 1041 ", own, 1).replace('BA_ "GenMsgCycleTime" BO_ 1041 ', cycle)
    (tmp_path / "own.dbc").write_text(dbc, encoding="utf-8")
    changes = (
        (str(ROOT / "dbc" / "bridge-crane.dbc"), "own.dbc"),
        ("message: CranePosition, signal: RopeLength", "message: Winch, signal: Out"),
        ("lowest_m: 1.5,", "offset_m: 1, lowest_m: 1.5,"),
    )
    file = machine_file(tmp_path, "bridge-crane", *changes)
    plant = PlantNode(load_deployment(file), listeners=False)
    sent = []
    for _ in range(9):
        plant.advance(0.02)
        sent += [frame.data for frame in plant.feedback() if frame.can_id == 1100]
    assert sent == [(700).to_bytes(2, "big")] * 2  # of 8 m, less the hook's
