"""A whole day at the desk, on a crane whose pendulum is not known."""

import re
from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from tests.commissioning.procedure.rehearsal import COPY, FOLDER, commission, steps

MOST_DECISIONS = 11  # and one for the file, by ``canshaper init``
MOST_LEFT_PCT = 5.0
MOST_REPORT_BYTES = 2_000_000
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
    shown = commission("--set", f"grapple.l2_m={length_m}", answers="\n" * MOST_DECISIONS)
    questions = QUESTION.findall(shown)
    assert len(questions) == len(NAMES) <= MOST_DECISIONS
    assert machine.read_bytes() == before
    done = steps()
    assert {name: one["status"] for name, one in done.items()} == dict.fromkeys(NAMES, "done")
    assert 0.0 < done["drive"]["numbers"]["crane"]["residual_left_pct"] < MOST_LEFT_PCT
    assert done["dry"]["numbers"]["valve_frames"] == 0
    assert done["motion"]["numbers"]["enable_to_neutral_s"] <= 0.04
    print(done["filter"]["numbers"])
    axes = load_deployment(COPY).config.axes
    for name in ("slew", "near_far"):
        sway, limits, designed = axes[name].sway, axes[name].limits, axes[name].filter
        origins = [sway and sway.origin, limits.curve_origin]
        assert [one and one.source for one in origins] == ["simulated"] * 2
        assert designed.kind == done["filter"]["numbers"]["recommended"]
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
    for name, one in done.items():
        assert name == "report" or f"<h2>{name}: done</h2>" in report
        assert one["diff"] == "" or one["diff"].splitlines()[3].replace("&", "") in report
    digest = load_deployment(COPY).identity.lines()[0]
    assert digest in report


@pytest.mark.slow
def test_a_valve_that_was_changed_opens_what_rests_on_it(machine: Path) -> None:
    for name in ("buses", "filter", "dry", "valve"):  # the last changes what the filter needs
        commission("--yes", "--step", name)
    now = steps()
    states = {name: one["status"] for name, one in now.items()}
    assert states["buses"] == states["valve"] == "done"
    assert states["filter"] == states["dry"] == "open"
    assert now["filter"]["why"] == "valve has changed the file"


@pytest.mark.slow
def test_the_first_motion_waits_for_reduced_speed(machine: Path) -> None:
    machine.write_text(machine.read_text().replace("max_pct: 40", "max_pct: 100"))
    fast = commission("--yes", "--step", "motion", code=1)
    assert "expected max_pct up to 40 for the first motion" in fast
    commission("--yes", "--step", "check")
    axes = load_deployment(COPY).config.axes
    assert {axis.limits.max_pct for axis in axes.values()} == {40.0}
    commission("--yes", "--step", "motion")


@pytest.mark.slow
def test_a_file_that_got_faster_needs_no_second_first_motion(machine: Path) -> None:
    for name in ("check", "motion"):
        commission("--yes", "--step", name)
    COPY.write_text(COPY.read_text().replace("max_pct: 40", "max_pct: 60"))
    assert "It would write" not in commission("--yes", "--step", "check")
    assert {name for name, one in steps().items() if one["status"] == "done"} == {"check", "motion"}
    assert "max_pct: 60" in COPY.read_text()
