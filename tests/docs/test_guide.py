"""The way of docs/guide.md on a crane whose pendulum is not known: by its commands alone.

What the guide does on a bus in real time, driving and recording, is done here in lock-step.
"""

import json
import random
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import script_named
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode

ROOT = Path(__file__).parents[2]
QUIET_S = 30.0  # after each push, no one touches anything
AXES = ("slew", "near_far")


def canshaper(*arguments: str, answers: str = "") -> str:
    result = CliRunner().invoke(app, list(arguments), input=answers, prog_name="canshaper")
    assert result.exit_code == 0, result.output
    return result.stdout


def demo_report(*options: str) -> Any:
    canshaper("demo", "machine.yaml", *options)
    return json.loads((Path("out") / "demo" / "report.json").read_text())


def recorded(file: Path, log: Path, change: str) -> None:
    """Two pushes without anti-sway, each followed by rest, as ``canshaper record`` writes them."""
    deployment = load_deployment(file)
    controller = Controller(deployment)
    plant = PlantNode(deployment, changed_parameters([change]))
    rows: list[str] = []

    def put(frame: Frame, time_ms: int) -> None:
        can_id = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
        rows.append(f"({time_ms / 1000:.6f}) can0 {can_id}#{frame.data.hex().upper()}")

    begin_ms = 0
    for axis in AXES:
        script = script_named(f"pulse-{axis}")
        joysticks = JoystickNode(deployment, script, bypass=True)
        end_ms = round(1000 * (script.duration_s + QUIET_S))
        for time_ms in range(0, end_ms, 20):
            now_ms = begin_ms + time_ms
            for frame in joysticks.frames(time_ms):
                controller.receive(frame, now_ms * 1_000_000)
                put(frame, now_ms)
            for frame in controller.tick(now_ms * 1_000_000):
                plant.receive(frame)
                put(frame, now_ms)
            plant.advance(0.02)
            for frame in plant.feedback():
                put(frame, now_ms)
        begin_ms += end_ms
    log.write_text("\n".join(rows) + "\n", encoding="ascii")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_guide_leads_to_a_calm_grapple(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    length = round(random.Random(seed).uniform(0.8, 1.9), 2)
    crane = f"grapple.l2_m={length}"
    (tmp_path / "machine.dbc").write_bytes((ROOT / "dbc" / "forwarder.dbc").read_bytes())
    canshaper("init", "machine.yaml", "--dbc", "machine.dbc", answers="\n")
    assert "good" in canshaper("check", "machine.yaml")
    recorded(tmp_path / "machine.yaml", tmp_path / "swing.log", crane)
    signals = ("slew=GrappleSway.SwayPerpendicular", "near_far=GrappleSway.SwayParallel")
    words = [word for signal in signals for word in ("--signal", signal)]
    canshaper("identify", "swing.log", "--file", "machine.yaml", *words, "--write")
    for axis in AXES:
        canshaper("calibrate", "machine.yaml", "--axis", axis, "--set", crane, "--write")
        canshaper("robust", "machine.yaml", "--axis", axis, "--write")
    for axis in AXES:
        options = ("--lockstep", "--set", crane, "--script", f"pulse-{axis}")
        measures = demo_report(*options)["axes"][axis]
        assert measures["residual_reduction_pct"] > 90.0, (length, axis, measures)
    text = Path("machine.yaml").read_text().replace("    waits: true\n", "")  # after first motion
    Path("machine.yaml").write_text(text)
    measures = demo_report("--lockstep", "--set", crane)["crane"]  # both at once
    assert measures["residual_reduction_pct"] > 90.0, (length, measures)
