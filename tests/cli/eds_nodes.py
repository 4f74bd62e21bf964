"""``canshaper init --eds`` on three nodes: a joystick and two valves."""

from pathlib import Path

from click.testing import Result
from typer.testing import CliRunner

from canshaper.cli.app import app
from tests.commissioning.nodes.eds_files import JOYSTICK, VALVE, Objects, write

LEFT, SLEW, NEAR, TILT = 0x10, 0x20, 0x21, 0x30
ANSWERS = """
joystick.eds: name = left
left: node id = 0x10
slew.dcf: name = slew
near.eds: name = near
near: node id = 33
Messages of the joysticks = left_TPDO1
left_TPDO1: enable switch = Buttons_1
left_TPDO1: switch that resets = Buttons_2
Axis of left_TPDO1.Slew = slew
Slew: its value at full = 32767
slew: valve command = slew_RPDO1.SetPoint
Axis of left_TPDO1.NearFar = near_far
NearFar: its value at full = 32767
near_far: valve command = near_RPDO1.SetPoint
near_far: silence = 250
Node id of canshaper = 1
"""


def init(folder: Path, answers: str, *options: str, near: Objects = VALVE) -> Result:
    """With a joystick that is sent by no timer and two valves, of which slew has a DCF."""
    write(folder / "joystick.eds", JOYSTICK)
    write(folder / "slew.dcf", VALVE, SLEW)
    write(folder / "near.eds", near)
    (folder / "answers.txt").write_text(answers)
    words = ["init", str(folder / "machine.yaml"), "--answers", str(folder / "answers.txt")]
    for name in ("joystick.eds", "slew.dcf", "near.eds"):
        words += ["--eds", str(folder / name)]
    return CliRunner().invoke(app, [*words, *options], input="", prog_name="canshaper")
