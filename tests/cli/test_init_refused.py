"""``canshaper init``: answers and files that will not do, and what is left of them."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.machine.binding import load_deployment
from tests.cli.init_script import DBC, answers, changed_dbc, init, with_answers


def test_a_wrong_answer_is_reported_and_asked_again(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    given = {
        "CAN interface": "can 0\ncan0",
        "Bit rate": "fast\n500000",
        "Messages of the joysticks": "Left\nJoystickLeft JoystickRight",
        "JoystickLeft: e": "Slew\nEnable",
        "JoystickLeft: r": "Enable\nReset",
        "Axis of JoystickLeft.Slew": "big slew\nnull\nturn",
        "Axis of JoystickLeft.NearFar": "turn\nnear_far",
        "slew valve": "Valve\nSlewCommand.Velocity",
        "slew timeout": "50\n300",
        "slew swings": "y",
        "slew turns": "y",
        "slew turn speed": "90\n2",
        "slew radius": "30\n10",
        "Axis that moves the tip": "turn\nnear_far",
        "Measured radius": "Radius\n-",
        "slew ten": "0\n2.1\n179\n20",
        "slew last": "21\n10",
    }
    result = init(file, given)
    assert result.exit_code == 0, result.output
    for reported in (
        "expected a whole number, 10000 to 1000000, got 'fast'",
        "expected some of JoystickLeft, JoystickRight, ",
        "got 'Left'",
        "expected one of Enable, AntiSwayOff, Reset, -, got 'Slew'",
        "expected a name without spaces, such as can0, got 'can 0'",
        "expected one of AntiSwayOff, Reset, -, got 'Enable'",
        "expected a word of letters, digits and _, other than true, false and null, got 'big slew'",
        "expected a word of letters, digits and _, other than true, false and null, got 'null'",
        "expected another one than turn, got 'turn'",
        "expected a number, 2.2 to 178.5, got '2.1'",
        "expected a number, 2.2 to 178.5, got '179'",
        "expected one of SlewCommand.Velocity, ",
        "expected a whole number, 60 to 5000, got '50'",
        "expected a number, 2.2 to 178.5, got '0'",
        "expected a number, 0.02 to 20, got '21'",
        "expected a number, 0.05 to 3, got '90'",
        "expected a number, 0.5 to 20, got '30'",
        "expected one of near_far, -, got 'turn'",
        "expected one of TipPosition.Radius, -, got 'Radius'",
    ):
        assert reported in result.output
    file.write_text(file.read_text().replace("    waits: true\n", ""))
    config = load_deployment(file).config
    assert config.buses["crane"].bitrate == 500_000
    assert config.axes["turn"].valve.timeout_ms == 300
    motion = config.motion["crane"]
    assert (motion.slew, motion.near_far, motion.radius) == ("turn", "near_far", None)


def test_what_is_found_at_the_end_leaves_a_draft_with_the_answers(tmp_path: Path) -> None:
    file, dbc = tmp_path / "machine.yaml", changed_dbc(tmp_path, 50)
    draft = tmp_path / "machine.draft.yaml"
    arguments = ["init", str(file), "--dbc", str(dbc)]
    given = answers({"CAN interface": "can7"})
    result = CliRunner().invoke(app, arguments, input=given)
    assert result.exit_code == 2
    reported = [line for line in result.output.splitlines() if str(tmp_path) in line][1:]
    assert "GenMsgCycleTime: expected a multiple of tick_ms, 20 ms, got 50 ms" in reported[0]
    assert reported[1:] == [f"{draft}: kept with all answers; fix it there and rename it to {file}"]
    assert not file.exists()
    again = CliRunner().invoke(app, arguments, input=given)
    assert (again.exit_code, f"{draft}: is there already" in again.output) == (2, True)
    draft.write_text(draft.read_text(encoding="utf-8").replace("tick_ms: 20", "tick_ms: 10"))
    assert load_deployment(draft).config.buses["crane"].channel == "can7"


def test_a_file_that_is_there_stays(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    file.write_text("mine", encoding="utf-8")
    result = init(file)
    assert (result.exit_code, file.read_text(encoding="utf-8")) == (2, "mine")
    assert "--force" in result.output
    assert init(file, None, "--force").exit_code == 0
    assert load_deployment(file)


@pytest.mark.parametrize("folder", ["none", "file"])
def test_where_nothing_can_be_written_nothing_is_asked(tmp_path: Path, folder: str) -> None:
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    result = init(tmp_path / folder / "machine.yaml")
    assert result.exit_code == 2
    says = f"{tmp_path / folder}: expected a folder that can be written to"
    assert result.output.strip() == says


def test_answers_that_end_early_write_nothing(tmp_path: Path) -> None:
    arguments = ["init", str(tmp_path / "machine.yaml"), "--dbc", str(DBC)]
    result = CliRunner().invoke(app, arguments, input="n\n\n\n")
    assert result.exit_code == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (None, "none.dbc: No such file"),
        ("nonsense", "not a DBC file"),
        ('VERSION ""\nBO_ 1 Status: 8 ECU\n SG_ A : 0|2@1+ (1,0) [0|1] "" ECU\n', "no message has"),
        ('VERSION ""\nBO_ 1 S: 1 E\n SG_ A : 0|9@1+ (1,0) [0|1] "" E\n', "can be used"),
    ],
)
def test_a_dbc_that_will_not_do(tmp_path: Path, content: str | None, why: str) -> None:
    dbc = tmp_path / "none.dbc"
    if content is not None:
        dbc.write_text(content, encoding="utf-8")
    result = CliRunner().invoke(app, ["init", str(tmp_path / "m.yaml"), "--dbc", str(dbc)])
    assert result.exit_code == 2
    assert why in result.output
    assert not (tmp_path / "m.yaml").exists()
    assert "Traceback" not in result.output


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("\nBit rate = fast", "answers.txt:2: Bit rate: expected a whole number"),
        ("slew: does it make = perhaps", "slew: does it make: expected one of yes, no"),
        ("Bit rates = 500000", "answers.txt:1: Bit rates: expected a question of this command"),
        (
            "Bit rate = 500000\nBit rate = 250000",
            "answers.txt:2: Bit rate: expected a question of this command, once",
        ),
        ("\nBit rate = \udcff", "answers.txt:2: expected UTF-8, got the byte 0xFF"),
        ("just words", "answers.txt:1: expected QUESTION = ANSWER, got 'just words'"),
    ],
)
def test_answers_that_are_wrong_are_named_with_their_line_and_nothing_is_written(
    tmp_path: Path, text: str, fault: str
) -> None:
    result = with_answers(tmp_path, text)
    assert result.exit_code == 2
    assert fault in result.output
    assert [path.name for path in tmp_path.iterdir()] == ["answers.txt"]
