"""The machine of forwarder.yaml with nodes of CANopen, or of J1939, damps as much, in lock-step.

Joysticks and valves are such nodes; those of CANopen follow in ACTIVE only, and are started by us.
"""

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
    for file in ("canopen-forwarder.yaml", "j1939-forwarder.yaml"):
        theirs = residual_reduction_pct(file)
        print(file, ours, theirs)
        assert theirs == pytest.approx(ours, abs=1.0), file
        assert min(theirs.values()) > 90.0, file
