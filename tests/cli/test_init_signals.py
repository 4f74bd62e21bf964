"""``canshaper init``: which signals and steps it proposes for a command and a valve."""

from pathlib import Path

import pytest
from cantools.database import load_string
from cantools.database.can import Signal
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.commissioning import suggest
from canshaper.machine.binding import load_deployment
from tests.cli.init_script import BARE, DBC, init, of_dbc

FLAGS = """VERSION ""

BU_: A B

BO_ 256 Stick: 4 A
 SG_ XNeutral : 0|2@1+ (1,0) [0|3] "" B
 SG_ XLeft : 2|2@1+ (1,0) [0|3] "" B
 SG_ XRight : 4|2@1+ (1,0) [0|3] "" B
 SG_ X : 6|10@1+ (0.1,0) [0|100] "%" B
 SG_ Enable : 16|2@1+ (1,0) [0|3] "" B
 SG_ In : 18|6@1+ (1,0) [0|0] "" B
 SG_ Out : 24|6@1+ (1,0) [0|0] "" B

BO_ 512 Boom: 2 B
 SG_ Flow : 0|16@1- (1,0) [-1000|1000] "" A

BO_ 513 Arm: 2 B
 SG_ Flow : 0|16@1- (1,0) [-1000|1000] "" A

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 20;
"""
WITH_FLAGS = """
Messages of the joysticks = Stick
Stick: enable switch = Enable
Axis of Stick.X = boom
boom: valve command = Boom.Flow
Axis of Stick.In = arm
In: direction = second
In: the signal of the other direction = Out
In: its value at full = 60
arm: valve command = Arm.Flow
"""


def test_a_magnitude_with_flags_and_a_rocker_of_two_signals(tmp_path: Path) -> None:
    dbc = tmp_path / "flags.dbc"
    dbc.write_text(FLAGS, encoding="cp1252")
    result = of_dbc(tmp_path, [dbc], WITH_FLAGS)
    assert result.exit_code == 0, result.output
    boom, arm = (load_deployment(tmp_path / "machine.yaml").config.axes[n] for n in ("boom", "arm"))
    assert boom.command.flags is not None
    assert boom.command.flags.model_dump() == {
        "neutral": "XNeutral",
        "negative": "XLeft",
        "positive": "XRight",
    }
    assert (arm.command.negative, arm.command.full, boom.command.full) == ("Out", 60, None)


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        ("X: flags = XNeutral XLeft XLeft", "X: flags: expected three of XNeutral, XLeft, XRight,"),
        ("X: direction = flag", "X: direction: expected one of middle, flags, second, got 'flag'"),
        ("In: the signal = In", "In: the signal: expected one of X, Out, got 'In'"),
    ],
)
def test_wrong_directions_are_named(answer: str, fault: str, tmp_path: Path) -> None:
    dbc = tmp_path / "flags.dbc"
    dbc.write_text(FLAGS, encoding="cp1252")
    key = answer.partition(" =")[0]
    others = "\n".join(line for line in WITH_FLAGS.splitlines() if not line.startswith(key))
    result = of_dbc(tmp_path, [dbc], f"{answer}\n{others}")
    assert result.exit_code == 2
    assert fault in result.output


@pytest.mark.parametrize(
    "bits", ["0|8@1- (1,0) [0|0]", "0|8@1- (0.5,0) [-3|120]", "0|9@1+ (1,-9) [-9|9]"]
)
@pytest.mark.parametrize("cycle", [0, 5000])
def test_every_two_sided_signal_is_a_candidate(bits: str, cycle: int, tmp_path: Path) -> None:
    """Whatever its range or cycle, and next to messages that the DBC describes well."""
    from canshaper.machine.database import load_dbc

    dbc = tmp_path / "one.dbc"
    dbc.write_text(
        FLAGS.replace('DEF_DEF_ "GenMsgCycleTime" 20', f'DEF_DEF_ "GenMsgCycleTime" {cycle}')
        + f'\nBO_ 700 Other: 8 A\n SG_ Odd : {bits} "" B\n'
    )
    file, problems = load_dbc(dbc)
    assert file is not None
    assert not problems
    assert "Other" in [m.name for m in suggest.joysticks(file.messages)]
    (other,) = (m for m in file.messages if m.name == "Other")
    assert [s.name for s in suggest.velocities(other)] == ["Odd"]


def signal_of(text: str) -> Signal:
    dbc = f'VERSION ""\n\nBO_ 1 M: 8 A\n SG_ S : {text} "" A\n'
    return load_string(dbc).messages[0].signals[0]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("text", "full", "middle"),
    [
        ("0|8@1- (1,0) [0|0]", 127.0, None),
        ("0|12@1- (0.03125,0) [-1024|1023]", 63.96875, None),  # a range beyond the bits
        ("0|8@1+ (0.75,-48) [-48|143]", 48.0, None),
        ("0|8@1- (0.5,0) [-3|120]", 3.0, None),
        ("0|11@1+ (1,0) [0|0]", 1023.0, 1024.0),
        ("0|8@1+ (0.4,0) [0|100]", 50.0, 50.0),
        ("0|4@1+ (1,0) [-7|7]", 3.0, 4.0),  # its bits go one way only
        ("0|32@1- (0.1,0) [0|0]", 214748364.7, None),
    ],
)
def test_what_is_proposed_is_within_the_bits(text: str, full: float, middle: float | None) -> None:
    signal = signal_of(text)
    assert suggest.two_sided(signal) == (middle is None)
    assert suggest.likely_full(signal, middle or 0.0) == pytest.approx(full, rel=1e-12)
    if middle is not None:
        assert suggest.likely_middle(signal) == pytest.approx(middle)


def test_a_message_with_too_few_steps_or_the_switch_of_a_joystick_is_no_valve(
    tmp_path: Path,
) -> None:
    dbc = tmp_path / "bare.dbc"
    coarse = '\nBO_ 513 Coarse: 1 B\n SG_ Step : 0|4@1- (1,0) [0|0] "" A\n'
    panel = ' SG_ Enable : 0|1@1+ (1,0) [0|0] "" B\n SG_ Lamp : 1|7@1- (1,0) [0|0] "" B\n'
    text = BARE.replace(BARE[BARE.index(" SG_ Enable") : BARE.index("\nBO_ 512")], panel)
    dbc.write_text(text + coarse, encoding="cp1252")
    answers = "Messages of the joysticks = Stick\nAxis of Stick.X = boom\nboom: valve command = "
    result = of_dbc(tmp_path, [dbc], f"{answers}Coarse.Step\n")
    assert "boom: valve command: expected one of Boom.Flow, -, got 'Coarse.Step'" in result.output
    result = of_dbc(tmp_path, [dbc], f"{answers}Boom.Flow\nAxis of Stick.Y = -\n")
    assert result.exit_code == 0, result.output


@pytest.mark.slow
def test_one_enter_takes_the_whole_proposal(tmp_path: Path) -> None:
    """It is shown first, and gives the machine of Enter for each question."""
    whole, each = tmp_path / "whole.yaml", tmp_path / "each.yaml"
    result = CliRunner().invoke(app, ["init", str(whole), "--dbc", str(DBC)], input="\n")
    assert result.exit_code == 0, result.output
    shown = [" ".join(line.split()) for line in result.output.splitlines()]
    for row in (
        "JoystickLeft: enable switch Enable",
        "Axis of JoystickLeft.Slew slew",
        "time of ten full swings, s 23.6",
        "rotate: valve command none",
        "Measured radius of the tip TipPosition.Radius",
    ):
        assert row in shown
    assert init(each).exit_code == 0
    assert whole.read_text() == each.read_text()
