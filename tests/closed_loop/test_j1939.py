"""The machine of forwarder.yaml with joysticks and valves of J1939 damps as much, in lock-step."""

from pathlib import Path

import pytest

from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper.report.metrics import compare
from canshaper_sim.operator import SCRIPTS

CONFIG = Path(__file__).resolve().parents[2] / "config"


def residual_reduction_pct(file: str) -> dict[str, float]:
    deployment = load_deployment(CONFIG / file)
    script = SCRIPTS["one-by-one"]
    report = compare(drive(deployment, script, bypass=True), drive(deployment, script))
    reductions = {name: report[name].residual_reduction_pct for name in ("slew", "near_far")}
    return {name: value for name, value in reductions.items() if value is not None}


@pytest.mark.slow
def test_sway_is_reduced_as_with_messages_of_our_own() -> None:
    ours = residual_reduction_pct("forwarder.yaml")
    j1939 = residual_reduction_pct("j1939-forwarder.yaml")
    assert j1939 == pytest.approx(ours, abs=1.0)
    assert min(j1939.values()) > 90.0
    print(ours, j1939)
