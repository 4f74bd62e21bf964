"""``canshaper init``: questions answered by a script, and the file that comes of it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.machine.binding import load_deployment

ROOT = Path(__file__).parents[2]
DBC = ROOT / "dbc" / "forwarder.dbc"
# The questions in their order, with the first words of each.
QUESTIONS = (
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
    "Axis of JoystickLeft.NearFar",
    "near_far valve",
    "near_far timeout",
    "near_far swings",
    "near_far ten",
    "near_far first",
    "near_far last",
    "near_far speed",
    "near_far turns",
    "Axis of JoystickRight.Lift",
    "lift valve",
    "lift timeout",
    "lift swings",
    "Axis of JoystickRight.Rotate",
    "rotate valve",
    "Axis that moves the tip",
    "Measured radius",
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
    assert (slew.command.signal, slew.valve.message) == ("Slew", "SlewCommand")
    assert slew.status is not None
    assert slew.status.message == "SlewStatus"
    assert slew.limits.max_pct == 40
    assert config.axes["lift"].filter.kind == "off"
    left = config.joysticks["joystick_left"]
    assert (left.enable, left.reset, left.anti_sway_off) == ("Enable", "Reset", "AntiSwayOff")
    assert (left.timeout_ms, left.alive_counter) == (100, "AliveCounter")
    assert config.status is not None
    assert f"canshaper check {file}" in result.output


def test_messages_that_cannot_be_used_are_shown_and_left_out(tmp_path: Path) -> None:
    other = tmp_path / "other.dbc"
    signal = 'SG_ S : 0|9@1+ (1,0) [0|0] "" A'
    other.write_text(f'VERSION ""\n\nBO_ 5 Other: 1 A\n {signal}\n', encoding="cp1252")
    file = tmp_path / "machine.yaml"
    shown = init(file, None, "--dbc", str(other))
    assert shown.exit_code == 0, shown.output
    assert "  1 WARNING in messages that are left out:\n" in shown.output
    assert f"    {other}:3: Other: has 1 bytes, and the signal S is not" in shown.output
    load_deployment(file)


def test_the_stopwatch_becomes_sway_data_and_a_filter(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    given = {"slew ten": "30", "slew first": "20", "slew last": "5", "slew speed": "2.5"}
    assert init(file, given).exit_code == 0
    sway = axis(file, "slew").sway
    assert sway.period_s == pytest.approx(3.0)
    assert (1 - sway.decay_per_swing) ** 10 == pytest.approx(0.25, rel=0.01)
    assert sway.full_speed_m_s == 2.5
    assert axis(file, "slew").filter.kind == "robust"
    assert load_deployment(file).config.control is not None


def test_without_the_tools_the_filter_is_one_to_begin_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(*_arguments: object, **_options: object) -> None:
        raise ModuleNotFoundError("No module named 'scipy.optimize'", name="scipy.optimize")

    monkeypatch.setattr("canshaper.cli.verbs.robust.design", missing)
    file = tmp_path / "machine.yaml"
    result = init(file, {"slew ten": "30"})
    assert result.exit_code == 0, result.output
    assert "no robust shaper yet, scipy is missing: pip install" in result.output
    assert f"canshaper robust {file} --axis near_far --write" in result.output
    poles = axis(file, "slew").filter.parameters()["poles_rad_s"]
    # The first step of the filter, 1 / (a2 w^2), is no more than what was asked.
    assert poles[0] * poles[1] / (2 * 3.14159265 / 3.0) ** 2 <= 1.0
    assert load_deployment(file).config.control is not None


def test_a_first_deployment_is_of_the_kind_that_is_recommended(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    assert init(file).exit_code == 0
    config = load_deployment(file).config
    shipped = load_deployment(ROOT / "config" / "forwarder-robust.yaml").config
    for name in ("slew", "near_far", "lift"):
        ours, theirs = config.axes[name], shipped.axes[name]
        assert ours.filter.kind == theirs.filter.kind
        assert ours.limits.reversal == theirs.limits.reversal
        assert (ours.slewing is None) == (theirs.slewing is None)
    assert config.motion == shipped.motion


def test_a_crane_that_no_axis_turns_has_no_motion(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    lines = answers({"slew turns": "n"}).splitlines()
    turned = QUESTIONS.index("slew turn speed")
    given = "\n".join(lines[:turned] + lines[turned + 2 : -2]) + "\n"
    result = CliRunner().invoke(app, ["init", str(file), "--dbc", str(DBC)], input=given)
    assert result.exit_code == 0, result.output
    config = load_deployment(file).config
    assert (config.axes["slew"].slewing, config.motion) == (None, {})


def test_a_wrong_answer_is_told_and_asked_again(tmp_path: Path) -> None:
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
        "slew ten": "0\n2.1\n86\n20",
        "slew last": "21\n10",
    }
    result = init(file, given)
    assert result.exit_code == 0, result.output
    for told in (
        "expected a whole number, 10000 to 1000000, got 'fast'",
        "expected some of JoystickLeft, JoystickRight, got 'Left'",
        "expected one of Enable, AntiSwayOff, Reset, got 'Slew'",
        "expected a name without spaces, such as can0, got 'can 0'",
        "expected one of AntiSwayOff, Reset, -, got 'Enable'",
        "expected a word of letters, digits and _, other than true, false and null, got 'big slew'",
        "expected a word of letters, digits and _, other than true, false and null, got 'null'",
        "expected another one than turn, got 'turn'",
        "expected a number, 2.2 to 85.7, got '2.1'",
        "expected a number, 2.2 to 85.7, got '86'",
        "expected one of SlewCommand.Velocity, ",
        "expected a whole number, 60 to 5000, got '50'",
        "expected a number, 2.2 to 85.7, got '0'",
        "expected a number, 0.02 to 20, got '21'",
        "expected a number, 0.05 to 3, got '90'",
        "expected a number, 0.5 to 20, got '30'",
        "expected one of near_far, -, got 'turn'",
        "expected one of TipPosition.Radius, -, got 'Radius'",
    ):
        assert told in result.output
    config = load_deployment(file).config
    assert config.buses["crane"].bitrate == 500_000
    assert config.axes["turn"].valve.timeout_ms == 300
    motion = config.motion["crane"]
    assert (motion.slew, motion.near_far, motion.radius) == ("turn", "near_far", None)


@pytest.mark.parametrize("seconds", ["2.2", "85.7"])
@pytest.mark.parametrize("channel", ["5", "true", "x'y", "a:b", "1e3", "größe"])
def test_every_answer_that_is_taken_makes_a_good_file(
    tmp_path: Path, channel: str, seconds: str
) -> None:
    file = tmp_path / "machine.yaml"
    given = {"CAN interface": channel, "slew ten": seconds, "near_far ten": seconds}
    given |= {"slew turn speed": "3", "slew radius": "13.3"}
    result = init(file, given | {"near_far last": "20", "slew last": "0.02"})
    assert result.exit_code == 0, result.output
    assert load_deployment(file).config.buses["crane"].channel == channel
    assert axis(file, "slew").sway.period_s == pytest.approx(float(seconds) / 10)


def changed_dbc(tmp_path: Path, cycle_ms: int) -> Path:
    """The machine's DBC with another cycle of the slew valve."""
    old, new = (f'BA_ "GenMsgCycleTime" BO_ 512 {ms};' for ms in (20, cycle_ms))
    text = DBC.read_text(encoding="utf-8")
    assert old in text
    dbc = tmp_path / "1.dbc"
    dbc.write_text(text.replace(old, new), encoding="utf-8")
    return dbc


def test_a_slow_valve_takes_slow_swings_only(tmp_path: Path) -> None:
    file, dbc = tmp_path / "machine.yaml", changed_dbc(tmp_path, 200)
    given = answers({"slew ten": "19.7\n19.8", "slew timeout": "600"})
    result = CliRunner().invoke(app, ["init", str(file), "--dbc", str(dbc)], input=given)
    assert "expected a number, 19.8 to 85.7, got '19.7'" in result.output
    assert result.exit_code == 0, result.output
    assert axis(file, "slew").sway.period_s == 1.98
    # Adjusted as far as is written, a robust shaper could not run at this tick.
    assert "axis slew: no robust shaper yet:" in result.output
    assert (axis(file, "slew").filter.kind, axis(file, "near_far").filter.kind) == ("gff", "robust")


def test_what_is_found_at_the_end_leaves_a_draft_with_the_answers(tmp_path: Path) -> None:
    file, dbc = tmp_path / "machine.yaml", changed_dbc(tmp_path, 50)
    draft = tmp_path / "machine.draft.yaml"
    arguments = ["init", str(file), "--dbc", str(dbc)]
    given = answers({"CAN interface": "can7"})
    result = CliRunner().invoke(app, arguments, input=given)
    assert result.exit_code == 2
    told = [line for line in result.output.splitlines() if str(tmp_path) in line][1:]
    assert "GenMsgCycleTime: expected a multiple of tick_ms, 20 ms, got 50 ms" in told[0]
    assert told[1:] == [f"{draft}: kept with all answers; fix it there and rename it to {file}"]
    assert not file.exists()
    again = CliRunner().invoke(app, arguments, input=given)
    assert (again.exit_code, f"{draft}: is there already" in again.output) == (2, True)
    draft.write_text(draft.read_text(encoding="utf-8").replace("tick_ms: 20", "tick_ms: 10"))
    assert load_deployment(draft).config.buses["crane"].channel == "can7"


def test_axes_and_switches_can_be_left_out(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    text = answers({"JoystickLeft: r": "-", "Axis of JoystickLeft.NearFar": "-"}).splitlines()
    dropped = QUESTIONS.index("near_far valve")
    lines = text[:dropped] + text[dropped + 8 :]
    arguments = ["init", str(file), "--dbc", str(DBC)]
    result = CliRunner().invoke(app, arguments, input="\n".join(lines) + "\n")
    assert result.exit_code == 0, result.output
    config = load_deployment(file).config
    assert list(config.axes) == ["slew", "lift"]
    assert not config.motion  # of one axis there is none
    assert config.joysticks["joystick_left"].reset is None


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
