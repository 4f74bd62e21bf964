"""Commands with the shipped tower crane."""

import json
from pathlib import Path

import pytest

from canshaper.campaign.draw import draw_drive
from tests.cli.test_overhead import run
from tests.rigs.files import CONFIG, ROOT, read

FILE = CONFIG / "tower-crane.yaml"


@pytest.mark.slow
def test_check_finds_nothing() -> None:
    said = run("check", str(FILE))
    assert "tower-crane.yaml: good" in said
    assert "while slew moves, trolley moves too without its joystick" in said
    assert "WARNING" not in said


@pytest.mark.slow
@pytest.mark.parametrize("script", ["demo", "pulse-trolley", "pulse-slew"])
def test_demo_shows_what_the_filters_do(tmp_path: Path, script: str) -> None:
    run("demo", str(FILE), "--lockstep", "--script", script, "--out", str(tmp_path))
    crane = json.loads((tmp_path / "report.json").read_text())["crane"]
    assert crane["raw"]["residual_deg"] > 3.0
    assert crane["shaped"]["residual_deg"] < 0.3


@pytest.mark.slow
def test_a_rehearsal_leads_to_the_report(tmp_path: Path) -> None:
    path = tmp_path / FILE.name
    path.write_text(FILE.read_text(encoding="utf-8").replace("../dbc", str(ROOT / "dbc")))
    said = run("commission", str(path), "--simulated", "--yes")
    assert "ok: slew, trolley: the length of the rope is measured" in said
    assert "All steps are done" in said


@pytest.mark.slow
def test_a_campaign_draws_ropes_and_radii(tmp_path: Path) -> None:
    said = run("campaign", str(FILE), "-n", "4", "--out", str(tmp_path), "--processes", "1")
    assert "0 of 4 drives broke one" in said


def test_a_drive_has_a_rope_and_a_radius() -> None:
    ranges = read(FILE).config.uncertainty
    setting = draw_drive(read(FILE), 1, ranges)
    tower = setting.options["parameters"].tower
    assert (tower.rope_m, tower.start_radius_m) == (
        setting.factors["rope_m"],
        setting.factors["radius_m"],
    )
    assert 8.0 <= tower.rope_m <= 50.0 and 20.0 <= tower.start_radius_m <= 50.0
    assert tower.slew_full_speed_rad_s != 0.07


def test_work_is_not_done_with_a_rope() -> None:
    said = run("work", str(FILE), code=2)
    assert "expected axes slew and near_far, got slew, near_far, hoist: its operator knows" in said
