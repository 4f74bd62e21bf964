"""``canshaper init``: questions answered by a script, and the file that comes of it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from typer.testing import CliRunner

from canshaper.can.binding import load_deployment
from canshaper.cli.app import app

ROOT = Path(__file__).parents[2]
DBC = ROOT / "dbc" / "forwarder.dbc"
# The questions in their order, with the first words of each.
QUESTIONS = (
    "CAN interface",
    "Bit rate",
    "Messages of the levers",
    *(f"{lever}: {text}" for lever in ("LeverLeft", "LeverRight") for text in ("e", "r", "a")),
    "Axis of LeverLeft.Slew",
    "slew valve",
    "slew timeout",
    "slew swings",
    "slew ten",
    "slew first",
    "slew last",
    "slew speed",
    "Axis of LeverLeft.NearFar",
    "near_far valve",
    "near_far timeout",
    "near_far swings",
    "near_far ten",
    "near_far first",
    "near_far last",
    "near_far speed",
    "Axis of LeverRight.Lift",
    "lift valve",
    "lift timeout",
    "lift swings",
    "Axis of LeverRight.Rotate",
    "rotate valve",
)


def answers(given: Mapping[str, str]) -> str:
    """Enter for every question but these; several tries are separated by a line."""
    assert {*given} <= {*QUESTIONS}
    return "".join(f"{given.get(question, '')}\n" for question in QUESTIONS)


def init(file: Path, given: Mapping[str, str] | None = None, *options: str) -> Result:
    arguments = ["init", str(file), "--dbc", str(DBC), *options]
    return CliRunner().invoke(app, arguments, input=answers(given or {}), prog_name="canshaper")


def axis(file: Path, name: str) -> Any:
    return load_deployment(file).config.axes[name]


def test_enter_throughout_gives_a_machine_with_what_was_found(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    result = init(file)
    assert result.exit_code == 0, result.output
    config = load_deployment(file).config
    assert list(config.axes) == ["slew", "near_far", "lift"]
    slew = config.axes["slew"]
    assert (slew.stick.signal, slew.valve.message) == ("Slew", "SlewCommand")
    assert slew.status is not None
    assert slew.status.message == "SlewStatus"
    assert slew.limits.max_pct == 40
    assert config.axes["lift"].filter.kind == "off"
    left = config.levers["lever_left"]
    assert (left.enable, left.reset, left.anti_sway_off) == ("Enable", "Reset", "AntiSwayOff")
    assert (left.timeout_ms, left.alive_counter) == (100, "AliveCounter")
    assert config.status is not None
    assert f"canshaper check {file}" in result.output


def test_the_stopwatch_becomes_sway_data_and_a_filter(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    given = {"slew ten": "30", "slew first": "20", "slew last": "5", "slew speed": "2.5"}
    assert init(file, given).exit_code == 0
    sway = axis(file, "slew").sway
    assert sway.period_s == pytest.approx(3.0)
    assert (1 - sway.decay_per_swing) ** 10 == pytest.approx(0.25, rel=0.01)
    assert sway.full_speed_m_s == 2.5
    poles = axis(file, "slew").filter.poles_rad_s
    # The first step of the filter, 1 / (a2 w^2), is no more than what was asked.
    assert poles[0] * poles[1] / (2 * 3.14159265 / 3.0) ** 2 <= 1.0
    assert load_deployment(file).config.control is not None


def test_a_wrong_answer_is_told_and_asked_again(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    given = {
        "Bit rate": "fast\n500000",
        "Messages of the levers": "Left\nLeverLeft LeverRight",
        "LeverLeft: e": "Slew\nEnable",
        "Axis of LeverLeft.Slew": "big slew\nturn",
        "slew valve": "Valve\nSlewCommand.Velocity",
        "slew timeout": "50\n300",
        "slew swings": "y",
        "slew ten": "0\n20",
        "slew last": "21\n10",
    }
    result = init(file, given)
    assert result.exit_code == 0, result.output
    for told in (
        "found 'fast', allowed is a whole number, 10000 to 1000000",
        "found 'Left', allowed are some of LeverLeft, LeverRight",
        "found 'Slew', allowed is one of Enable, AntiSwayOff, Reset",
        "found 'big slew', allowed is a word",
        "found 'Valve', allowed is one of SlewCommand.Velocity",
        "found '50', allowed is a whole number, 60 to 5000",
        "found '0', allowed is a number, 1.5 to 120",
        "found '21', allowed is a number, 0.02 to 20",
    ):
        assert told in result.output
    config = load_deployment(file).config
    assert config.buses["crane"].bitrate == 500_000
    assert config.axes["turn"].valve.timeout_ms == 300


def test_axes_and_switches_can_be_left_out(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    text = answers({"LeverLeft: r": "-", "Axis of LeverLeft.NearFar": "-"}).splitlines()
    dropped = QUESTIONS.index("near_far valve")
    lines = text[:dropped] + text[dropped + 7 :]
    arguments = ["init", str(file), "--dbc", str(DBC)]
    result = CliRunner().invoke(app, arguments, input="\n".join(lines) + "\n")
    assert result.exit_code == 0, result.output
    config = load_deployment(file).config
    assert list(config.axes) == ["slew", "lift"]
    assert config.levers["lever_left"].reset is None


def test_a_file_that_is_there_stays(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    file.write_text("mine", encoding="utf-8")
    result = init(file)
    assert (result.exit_code, file.read_text(encoding="utf-8")) == (2, "mine")
    assert "--force" in result.output
    assert init(file, None, "--force").exit_code == 0
    assert load_deployment(file)


def test_answers_that_end_early_write_nothing(tmp_path: Path) -> None:
    arguments = ["init", str(tmp_path / "machine.yaml"), "--dbc", str(DBC)]
    result = CliRunner().invoke(app, arguments, input="\n\n\n")
    assert result.exit_code == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (None, "none.dbc: No such file"),
        ("nonsense", "not a DBC file"),
        ('VERSION ""\nBO_ 1 Status: 8 ECU\n SG_ A : 0|8@1+ (1,0) [0|1] "" ECU\n', "no message has"),
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
