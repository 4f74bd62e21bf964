"""Commands with the shipped cranes whose load hangs on a rope."""

import json
from pathlib import Path

import pytest

from canshaper.campaign.draw import draw_drive
from tests.cli.test_overhead import run
from tests.rigs.files import CONFIG, machine_file, read
from tests.rigs.overhead import FILE as BRIDGE

HOOK = BRIDGE.with_stem("bridge-crane-hook")
TOWER, TELEHANDLER = CONFIG / "tower-crane.yaml", CONFIG / "telehandler.yaml"
ROPES = pytest.mark.parametrize("file", [TOWER, TELEHANDLER, BRIDGE], ids=lambda one: one.stem)
FILES = pytest.mark.parametrize("file", [TOWER, TELEHANDLER], ids=["tower", "telehandler"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "moves"),
    [(TOWER, "trolley"), (TELEHANDLER, "telescope"), (BRIDGE, None), (HOOK, None)],
)
def test_check_finds_nothing(file: Path, moves: str | None) -> None:
    said = run("check", str(file))
    assert f"{file.name}: good" in said
    assert ("moves too without its joystick" in said) is (moves is not None)
    assert not moves or f"while slew moves, {moves} moves too" in said
    assert "WARNING" not in said


@pytest.mark.slow
@FILES
@pytest.mark.parametrize("script", ["demo", "pulse-slew"])
def test_demo_shows_what_the_filters_do(tmp_path: Path, file: Path, script: str) -> None:
    run("demo", str(file), "--lockstep", "--script", script, "--out", str(tmp_path))
    crane = json.loads((tmp_path / "report.json").read_text())["crane"]
    assert crane["raw"]["residual_deg"] > 3.0
    assert crane["shaped"]["residual_deg"] < 0.15 * crane["raw"]["residual_deg"]


@pytest.mark.slow
@ROPES
def test_a_rehearsal_leads_to_the_report(tmp_path: Path, file: Path) -> None:
    said = run("commission", str(machine_file(tmp_path, file)), "--simulated", "--yes")
    assert "the length of the rope is measured" in said
    assert "All steps are done" in said


@pytest.mark.slow
@ROPES
def test_a_campaign_draws_ropes(tmp_path: Path, file: Path) -> None:
    said = run("campaign", str(file), "-n", "4", "--out", str(tmp_path), "--processes", "1")
    assert "0 of 4 drives broke one" in said


def test_a_drive_has_a_rope_and_where_it_may_a_radius() -> None:
    for file in (TOWER, TELEHANDLER):
        deployment = read(file)
        setting = draw_drive(deployment, 1, deployment.config.uncertainty)
        drawn, crane = setting.factors, setting.options["parameters"]
        assert crane is not None
        own = crane.tower if file is TOWER else crane.luffing
        assert own.rope_m == drawn["rope_m"] != type(own)().rope_m
        assert own.slew_full_speed_rad_s != type(own)().slew_full_speed_rad_s
        assert own.slew.lag_s == drawn["slew_lag_s"]
        assert ("radius_m" in drawn) is (file is TOWER)
        if file is TOWER:
            assert crane.tower.start_radius_m == drawn["radius_m"]
