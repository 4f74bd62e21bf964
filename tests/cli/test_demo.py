"""``canshaper demo`` in lock-step: every shipped deployment, by the axes that it has."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.campaign.measure import measured_drive
from canshaper.cli.app import app
from canshaper.config.desk import Uncertainty
from canshaper.design.lockstep import driven_part
from canshaper.machine.binding import load_deployment
from canshaper_sim.cranes import cranes
from tests.rigs.files import ROOT, machine_file

SHIPPED = sorted((ROOT / "config").glob("*.yaml"))


def demo(out: Path, *arguments: str, code: int = 0) -> tuple[str, Any]:
    result = CliRunner().invoke(app, ["demo", "--lockstep", "--out", str(out), *arguments])
    assert result.exit_code == code, result.output
    report = out / "report.json"
    return result.output, json.loads(report.read_text()) if report.exists() else None


@pytest.mark.slow
@pytest.mark.parametrize("file", SHIPPED, ids=[file.stem for file in SHIPPED])
def test_every_shipped_deployment_drives_its_own_axes_together(file: Path, tmp_path: Path) -> None:
    text, report = demo(tmp_path, str(file))
    assert "residual sway" in text
    deployment = load_deployment(file)
    names = driven_part(deployment, next(iter(cranes(deployment)), None)).coordinates.keys()
    assert {name for name, axis in report["axes"].items() if axis["raw"]["time_to_95_s"]} == names
    crane = report["crane"]
    assert crane["raw"]["residual_deg"] > (15.0 if "forwarder" in file.stem else 7.0)
    assert crane["residual_reduction_pct"] > 75.0
    assert (tmp_path / "demo.png").stat().st_size > 50_000


@pytest.mark.slow
def test_without_a_file_it_is_the_recommended_deployment_with_its_price(tmp_path: Path) -> None:
    text, report = demo(tmp_path)
    assert report["deployment"] == "forwarder-robust.yaml"
    raw, shaped = report["crane"]["raw"], report["crane"]["shaped"]
    assert raw["residual_deg"] > 20.0
    assert shaped["residual_deg"] < 1.5
    assert shaped["peak_deg"] < 0.65 * raw["peak_deg"]  # that of a full reversal
    assert 1.5 < shaped["run_on_s"] < 2.2
    assert 1.2 < shaped["run_on_m"] < 2.2
    for unit, digits in (("s", 2), ("m", 2)):
        pair = (drive[f"run_on_{unit}"] for drive in (raw, shaped))
        cell = " → ".join(f"{value:.{digits}f}" for value in pair)
        assert any(
            line.split()[:2] == ["run-on,", unit] and cell in line for line in text.splitlines()
        )


@pytest.mark.slow
def test_with_a_sensor_a_wrong_length_costs_little(tmp_path: Path) -> None:
    longer = ("--set", "grapple.l2_m=1.5")
    left = [demo(tmp_path, *one, *longer)[1] for one in ((), ("--sensor",))]
    assert left[1]["deployment"] == "forwarder-sensor.yaml"
    plain, sensed = (one["crane"]["shaped"]["residual_deg"] for one in left)
    assert sensed < 0.5 * plain
    text, _ = demo(tmp_path, "forwarder.yaml", "--sensor", code=2)
    assert "--sensor: expected without FILE, got forwarder.yaml" in text


@pytest.mark.slow
def test_readme_shows_what_the_demo_prints(tmp_path: Path) -> None:
    text, _ = demo(tmp_path)
    printed = [line.rstrip() for line in text.splitlines()]
    first = next(k for k, line in enumerate(printed) if line.endswith("Whole crane"))
    last = next(k for k, line in enumerate(printed) if "re-rise" in line)
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    block = page.partition("<!-- canshaper demo --lockstep -->\n```text\n")[2].partition("```")[0]
    assert list(filter(None, block.splitlines())) == list(filter(None, printed[first : last + 1]))


@pytest.mark.slow
def test_one_of_several_cranes_is_driven(tmp_path: Path) -> None:
    first, _ = demo(tmp_path, "two-cranes.yaml", "--script", "pulse-slew")
    assert "Crane: front (of front, rear)" in first
    rear, report = demo(tmp_path, "two-cranes.yaml", "--crane", "rear", "--script", "random-3")
    assert "Crane: rear (of front, rear)" in rear
    assert set(report["axes"]) == {"slew", "near_far", "lift", "rotator"}
    wrong, _ = demo(tmp_path, "two-cranes.yaml", "--crane", "middle", code=2)
    assert "expected one of front, rear, got 'middle'" in wrong


def test_several_cranes_are_driven_in_lock_step_only() -> None:
    result = CliRunner().invoke(app, ["demo", "two-cranes.yaml"])
    assert result.exit_code == 2
    assert "several buses or cranes; drive it with --lockstep" in result.output


@pytest.mark.slow
def test_without_a_switch_for_anti_sway_both_drives_are_said_to_be_shaped(tmp_path: Path) -> None:
    """A campaign then has no drive to compare with."""
    path = machine_file(tmp_path, "forwarder-robust", ("    anti_sway_off: AntiSwayOff\n", ""))
    said, report = demo(tmp_path, str(path))
    assert f"WARNING: {path}: no joystick has anti_sway_off" in said
    left = [report["crane"][one]["residual_deg"] for one in ("raw", "shaped")]
    assert left[0] == pytest.approx(left[1], abs=0.01)
    row = measured_drive(load_deployment(path), 1, Uncertainty())
    assert not row["fault"] and row["raw_deg"] is None
