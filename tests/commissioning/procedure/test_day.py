"""A whole day at the desk, on a crane whose pendulum is not known."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.machine.binding import load_deployment

MOST_DECISIONS = 11  # and one for the file, by ``canshaper init``
MOST_LEFT_PCT = 5.0
MOST_REPORT_BYTES = 2_000_000
FOLDER = Path("machine.rehearsal.commission")
QUESTION = re.compile(r"^\w+: accept \(.*\) \[yes\]:", re.MULTILINE)
NAMES = [
    "buses",
    "joysticks",
    "swing",
    "valve",
    "filter",
    "check",
    "dry",
    "motion",
    "drive",
    "report",
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "length_m", [1.55, *(pytest.param(one, marks=pytest.mark.slow) for one in (0.85, 1.9))]
)
def test_from_init_to_the_report(machine: Path, length_m: float) -> None:
    before = machine.read_bytes()
    words = ["commission", "machine.yaml", "--simulated", "--set", f"grapple.l2_m={length_m}"]
    result = CliRunner().invoke(app, words, input="\n" * MOST_DECISIONS)
    assert result.exit_code == 0, result.output
    questions = QUESTION.findall(result.output)
    assert len(questions) == len(NAMES) <= MOST_DECISIONS
    assert machine.read_bytes() == before
    steps = json.loads(Path("machine.rehearsal.commission.json").read_text())["steps"]
    assert {name: one["status"] for name, one in steps.items()} == dict.fromkeys(NAMES, "done")
    assert 0.0 < steps["drive"]["numbers"]["crane"]["residual_left_pct"] < MOST_LEFT_PCT
    assert steps["dry"]["numbers"]["valve_frames"] == 0
    assert steps["motion"]["numbers"]["enable_to_neutral_s"] <= 0.04
    print(steps["filter"]["numbers"])
    axes = load_deployment(Path("machine.rehearsal.yaml")).config.axes
    for name in ("slew", "near_far"):
        sway, limits, designed = axes[name].sway, axes[name].limits, axes[name].filter
        origins = [sway and sway.origin, limits.curve_origin]
        assert [one and one.source for one in origins] == ["simulated"] * 2
        assert designed.kind == steps["filter"]["numbers"]["recommended"]
        assert limits.curve_command_pct
    report = (FOLDER / "report.html").read_text(encoding="utf-8")
    assert len(report) < MOST_REPORT_BYTES
    assert "REHEARSAL" in report
    assert f"grapple.l2_m={length_m}" in report
    first = report.split("<h2>")[0]
    assert re.search(r"[\d.]+ % of the swing is left: [\d.]+ degrees without the filters", first)
    assert first.index("verdict") < first.index("<img ") < first.index(">date<")
    assert "emergency stop pressed in motion" in first
    assert report.count("<img ") == 11
    for name, one in steps.items():
        assert name == "report" or f"<h2>{name}: done</h2>" in report
        assert one["diff"] == "" or one["diff"].splitlines()[3].replace("&", "") in report
    digest = load_deployment(Path("machine.rehearsal.yaml")).identity.lines()[0]
    assert digest in report


@pytest.mark.slow
def test_a_valve_that_was_changed_opens_what_rests_on_it(machine: Path) -> None:
    def run(*words: str) -> None:
        arguments = ["commission", "machine.yaml", "--simulated", "--yes", *words]
        assert CliRunner().invoke(app, arguments).exit_code == 0

    run("--step", "buses")
    run("--step", "filter")
    run("--step", "dry")
    run("--step", "valve")  # changes the file, and what the filter needs
    steps = json.loads(Path("machine.rehearsal.commission.json").read_text())["steps"]
    states = {name: one["status"] for name, one in steps.items()}
    assert states["buses"] == states["valve"] == "done"
    assert states["filter"] == states["dry"] == "open"
    assert steps["filter"]["why"] == "valve has changed the file"


@pytest.mark.slow
def test_the_first_motion_waits_for_reduced_speed(machine: Path) -> None:
    machine.write_text(machine.read_text().replace("max_pct: 40", "max_pct: 100"))
    words = ["commission", "machine.yaml", "--simulated", "--yes", "--step"]
    fast = CliRunner().invoke(app, [*words, "motion"])
    assert fast.exit_code == 1
    assert "expected max_pct up to 40 for the first motion" in fast.output
    checked = CliRunner().invoke(app, [*words, "check"])
    assert checked.exit_code == 0, checked.output
    axes = load_deployment(Path("machine.rehearsal.yaml")).config.axes
    assert {axis.limits.max_pct for axis in axes.values()} == {40.0}
    slow = CliRunner().invoke(app, [*words, "motion"])
    assert slow.exit_code == 0, slow.output


@pytest.mark.slow
def test_a_file_that_got_faster_needs_no_second_first_motion(machine: Path) -> None:
    words = ["commission", "machine.yaml", "--simulated", "--yes", "--step"]
    for name in ("check", "motion"):
        assert CliRunner().invoke(app, [*words, name]).exit_code == 0
    copy = Path("machine.rehearsal.yaml")
    copy.write_text(copy.read_text().replace("max_pct: 40", "max_pct: 60"))
    checked = CliRunner().invoke(app, [*words, "check"])
    assert "It would write" not in checked.output
    steps = json.loads(Path("machine.rehearsal.commission.json").read_text())["steps"]
    done = {name for name, one in steps.items() if one["status"] == "done"}
    assert done == {"check", "motion"}
    assert "max_pct: 60" in copy.read_text()
