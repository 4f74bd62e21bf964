"""Commands with the shipped bridge crane."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.machine.binding import load_deployment
from tests.rigs.overhead import FILE, changed


def run(*words: str, code: int = 0) -> str:
    done = CliRunner().invoke(app, [*words])
    assert done.exit_code == code, done.output
    return " ".join(done.output.split())


def test_the_first_file_takes_a_hoist_for_an_axis_that_makes_nothing_swing(tmp_path: Path) -> None:
    answers, file = tmp_path / "answers.txt", tmp_path / "own.yaml"
    answers.write_text("")
    dbc = str(FILE.parents[1] / "dbc" / "bridge-crane.dbc")
    run("init", str(file), "--dbc", dbc, "--answers", str(answers))
    hoist = file.read_text().partition("\n  hoist:\n")[2].split("\n\n")[0]
    assert "filter: { kind: off }" in hoist


def test_the_first_file_knows_a_winch_a_switch_by_other_words_and_a_valve_message_of_all(
    tmp_path: Path,
) -> None:
    names = ("bridge", "trolley", "winch")
    signals = "".join(
        f' SG_ {name}Hz : {16 * k}|16@1- (0.01,0) [-100|100] "" DRIVES\n'
        for k, name in enumerate(names)
    )
    text = (FILE.parents[1] / "dbc" / "bridge-crane.dbc").read_text()
    text = text.replace("BO_ 529 ", f"BO_ 531 Drives: 8 SHAPER\n{signals}\nBO_ 529 ", 1)
    text = text.replace("AntiSwayOff", "SwayControlOff").replace("SG_ Hoist :", "SG_ Winch :")
    text = text.replace("VAL_ 289 Hoist", "VAL_ 289 Winch")
    cycle = 'BA_ "GenMsgCycleTime" BO_ 528 20;\n'
    text = text.replace(cycle, cycle + cycle.replace("528", "531"))
    dbc, answers, file = (tmp_path / name for name in ("own.dbc", "answers.txt", "own.yaml"))
    dbc.write_text(text)
    lines = (f"{name}: valve command = Drives.{name}Hz\n" for name in names)
    answers.write_text("".join(lines))
    run("init", str(file), "--dbc", str(dbc), "--answers", str(answers))
    config = load_deployment(file).config
    assert {one.anti_sway_off for one in config.joysticks.values()} == {"SwayControlOff"}
    assert {one.valve.signal for one in config.axes.values()} == {f"{name}Hz" for name in names}
    assert config.axes["winch"].sway is None


@pytest.mark.slow
def test_demo_shows_what_the_filters_do(tmp_path: Path) -> None:
    run("demo", str(FILE), "--lockstep", "--out", str(tmp_path))
    crane = json.loads((tmp_path / "report.json").read_text())["crane"]
    assert crane["raw"]["residual_deg"] > 10.0
    assert crane["shaped"]["residual_deg"] < 0.5
    assert (tmp_path / "demo.png").exists()


def test_a_script_that_moves_nothing_of_it_is_refused() -> None:
    for verb in (["operator", str(FILE)], ["demo", str(FILE), "--lockstep"]):
        said = run(*verb, "--script", "pulse-slew", code=2)
        assert "script pulse-slew moves slew; the crane has bridge, trolley, hoist" in said


def test_compare_has_no_work_with_a_rope() -> None:
    said = run("compare", str(FILE), "--work", code=2)
    assert "--work, --fleet: expected slew and near-far, got a rope" in said


def test_a_parameter_is_judged_by_the_crane_of_the_file(tmp_path: Path) -> None:
    kind = "kind: cartesian,"
    file = changed(tmp_path, (kind, f"{kind} simulated: {{ overhead.rope_max_m: 50 }},"))
    for verb in ("campaign", "studio"):
        said = run(verb, str(file), "--set", "overhead.rope_m=60", code=2)
        assert "overhead: rope_m: expected 1.5 .. 50.0, got 60.0" in said
    said = run("campaign", str(FILE), "--against", str(file), "--out", str(tmp_path), code=2)
    assert "expected the crane.simulated of bridge-crane.yaml, got another crane" in said


def test_a_crane_that_moves_nothing_is_no_campaign(tmp_path: Path) -> None:
    crane = "crane: { kind: cartesian, bridge: bridge, trolley: trolley, hoist: hoist }"
    file = changed(tmp_path, (crane, ""))
    said = run("campaign", str(file), "--out", str(tmp_path / "out"), code=2)
    assert "expected an axis that moves the crane, got none" in said
