"""EDS files that ``canshaper init --eds`` refuses, in one line each and with nothing written."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from tests.cli.eds_nodes import ANSWERS, init
from tests.commissioning.nodes.eds_files import JOYSTICK, VALVE, mapping, pdo, write


@pytest.mark.parametrize(
    ("answers", "fault"),
    [
        ("left: node id = 128", "left: node id: expected a node id, 1 to 127, got '128'"),
        ("near: node id = 32", "near: node id: expected a node id, 1 to 127 other than 16, 32"),
        ("Node id of canshaper = 0x10", "expected a node id, 1 to 127 other than 16, 32, 33"),
        ("near.eds: name = left", "expected another one than left, slew, got 'left'"),
        ("near.eds: name = größe", "expected a word of letters, digits and _, 20 at most"),
        ("left: objects = Slew", "left: objects: expected some of Buttons, -, got 'Slew'"),
    ],
)
def test_answers_that_cannot_be_write_nothing(answers: str, fault: str, tmp_path: Path) -> None:
    key = answers.partition(" =")[0]
    others = "\n".join(line for line in ANSWERS.splitlines() if not line.startswith(key))
    result = init(tmp_path, f"{answers}\n{others}\n")
    assert result.exit_code == 2
    assert fault in result.output
    assert not list(tmp_path.glob("machine*"))


def test_a_file_that_is_no_eds_is_one_line_and_a_bad_pdo_a_warning(tmp_path: Path) -> None:
    words = ["init", str(tmp_path / "machine.yaml"), "--eds", str(tmp_path / "stick.eds")]
    (tmp_path / "stick.eds").write_text("VERSION\n")
    result = CliRunner().invoke(app, words, input="", prog_name="canshaper")
    assert (result.exit_code, result.output.count("\n")) == (2, 1)
    assert f"{tmp_path / 'stick.eds'}:1: expected sections of KEY=VALUE" in result.output
    long = {0x1801: pdo("T", "0x290", "20"), 0x1A01: mapping(*[(0x6401, 1, 16)] * 5)}
    write(tmp_path / "stick.eds", JOYSTICK | long)
    (tmp_path / "a.txt").write_text("")
    words += ["--answers", str(tmp_path / "a.txt")]
    result = CliRunner().invoke(app, words, input="", prog_name="canshaper")
    assert "[1A01sub5]: expected a mapping of 8 bytes at most, got 80 bits" in result.output
    assert "TPDO1 0x190, event timer 0 ms: Slew, NearFar, Buttons" in result.output


def test_a_node_without_pdo_is_said_before_any_question(tmp_path: Path) -> None:
    result = init(tmp_path, "", near={key: VALVE[key] for key in (0x1000, 0x6040)})
    assert result.exit_code == 2
    assert result.output == (
        f"{tmp_path}/near.eds: expected a PDO with objects, got none; map some, and export the"
        " DCF\n"
    )


def test_a_dbc_that_is_there_stays(tmp_path: Path) -> None:
    (tmp_path / "machine-canopen.dbc").write_text("mine")
    result = init(tmp_path, ANSWERS)
    assert result.exit_code == 2
    assert "machine-canopen.dbc: is there already; --force replaces it" in result.output
    assert (tmp_path / "machine-canopen.dbc").read_text() == "mine"
