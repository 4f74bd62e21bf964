"""The machine of forwarder.yaml with nodes of CANopen damps as much, in lock-step."""

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
    """By valves that follow in the state ACTIVE only, on nodes that are started by us."""
    ours = residual_reduction_pct("forwarder.yaml")
    canopen = residual_reduction_pct("canopen-forwarder.yaml")
    print(ours, canopen)
    assert canopen == pytest.approx(ours, abs=1.0)
    assert min(canopen.values()) > 90.0
