"""A script that answers the questions of ``canshaper init``."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from click.testing import Result
from typer.testing import CliRunner

from canshaper.cli.app import app
from tests.rigs.files import ROOT

DBC = ROOT / "dbc" / "forwarder.dbc"
# The questions in their order, with the first words of each.
QUESTIONS = (
    "Is all of it right",
    "CAN interface",
    "Bit rate",
    "Messages of the joysticks",
    *(
        f"{joystick}: {text}"
        for joystick in ("JoystickLeft", "JoystickRight")
        for text in ("e", "r", "a")
    ),
    "Axis of JoystickLeft.Slew",
    "slew valve",
    "slew timeout",
    "slew swings",
    "slew ten",
    "slew first",
    "slew last",
    "slew speed",
    "slew turns",
    "slew turn speed",
    "slew radius",
    "slew sensor",
    "Axis of JoystickLeft.NearFar",
    "near_far valve",
    "near_far timeout",
    "near_far swings",
    "near_far ten",
    "near_far first",
    "near_far last",
    "near_far speed",
    "near_far turns",
    "near_far sensor",
    "Axis of JoystickRight.Lift",
    "lift valve",
    "lift timeout",
    "lift swings",
    "Axis of JoystickRight.Rotate",
    "rotate valve",
    "Axis that moves the tip",
    "Measured radius",
    "log gripped",
    "one response",
)


def answers(given: Mapping[str, str]) -> str:
    """Enter for every question but these; several tries are separated by a line."""
    assert {*given} <= {*QUESTIONS}
    given = {"Is all of it right": "n", **given}
    return "".join(f"{given.get(question, '')}\n" for question in QUESTIONS)


def init(file: Path, given: Mapping[str, str] | None = None, *options: str) -> Result:
    arguments = ["init", str(file), "--dbc", str(DBC), *options]
    return CliRunner().invoke(app, arguments, input=answers(given or {}), prog_name="canshaper")


def changed_dbc(tmp_path: Path, cycle_ms: int) -> Path:
    """The machine's DBC with another cycle of the slew valve."""
    old, new = (f'BA_ "GenMsgCycleTime" BO_ 512 {ms};' for ms in (20, cycle_ms))
    text = DBC.read_text(encoding="utf-8")
    assert old in text
    dbc = tmp_path / "1.dbc"
    dbc.write_text(text.replace(old, new), encoding="utf-8")
    return dbc


def with_answers(folder: Path, text: str) -> Result:
    """Nothing is typed: a question would end it."""
    (folder / "answers.txt").write_text(text, "utf-8", "surrogateescape")
    words = ["init", str(folder / "machine.yaml"), "--dbc", str(DBC)]
    words += ["--answers", str(folder / "answers.txt")]
    return CliRunner().invoke(app, words, input="", prog_name="canshaper")


BARE = """VERSION ""

BU_: A B

BO_ 256 Stick: 4 A
 SG_ X : 0|8@1- (1,0) [0|0] "" B
 SG_ Y : 8|8@1- (1,0) [-100|90] "" B

BO_ 257 Panel: 1 A
 SG_ Enable : 0|1@1+ (1,0) [0|0] "" B

BO_ 512 Boom: 2 B
 SG_ Flow : 0|16@1- (1,0) [0|0] "" A
"""


def of_dbc(folder: Path, dbc: Sequence[Path], answers: str) -> Result:
    (folder / "answers.txt").write_text(answers)
    words = ["init", str(folder / "machine.yaml"), "--answers", str(folder / "answers.txt")]
    words += [word for path in dbc for word in ("--dbc", str(path))]
    return CliRunner().invoke(app, words, input="", prog_name="canshaper")
