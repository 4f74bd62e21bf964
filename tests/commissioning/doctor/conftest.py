"""Deployments for the doctor, and what it measured as the tests make it up."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canshaper.commissioning.doctor.measure import Run
from tests.rigs.files import ROOT

SHIPPED = ROOT / "config" / "forwarder.yaml"
TICK_NS = 20_000_000

# A second bus with a joystick of another cycle, a quicker tick, and an emergency stop.
YAML = {
    "tick_ms: 20": "tick_ms: 10",
    "  crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }\n": (
        "  crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }\n"
        "  boom: { interface: udp_multicast, channel: 239.1.2.3 }\n"
    ),
    "  right:\n    bus: crane": "  right:\n    bus: boom",
    "bus: crane, message: LiftCommand": "bus: boom, message: LiftCommand",
    "../dbc/forwarder.dbc": "machine.dbc",
    "status: { bus: crane, message: ShaperStatus }": (
        "emergency_stop: { bus: boom, message: Stop, signal: Pressed, timeout_ms: 100 }\n"
        "status: { bus: crane, message: ShaperStatus }"
    ),
}
DBC = {
    "BO_ 512 SlewCommand": (
        'BO_ 64 Stop: 1 JOYSTICKS\n SG_ Pressed : 0|2@1+ (1,0) [0|3] "" SHAPER\n\n'
        "BO_ 512 SlewCommand"
    ),
    'BA_ "GenMsgCycleTime" BO_ 273 20;\n': (
        'BA_ "GenMsgCycleTime" BO_ 273 30;\nBA_ "GenMsgCycleTime" BO_ 64 20;\n'
    ),
}


def changed(file: Path, changes: dict[str, str], encoding: str = "utf-8") -> str:
    text = file.read_text(encoding=encoding)
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new)
    return text


@pytest.fixture
def two_buses(tmp_path: Path) -> Path:
    """The shipped machine on two buses, with all that a deployment may have."""
    dbc = changed(ROOT / "dbc" / "forwarder.dbc", DBC, "cp1252")
    (tmp_path / "machine.dbc").write_text(dbc, encoding="cp1252")
    file = tmp_path / "machine.yaml"
    file.write_text(changed(SHIPPED, YAML), encoding="utf-8")
    return file


@pytest.fixture
def run() -> Callable[..., Run]:
    """A run in which nothing is wrong, with changes."""

    def make(**changes: Any) -> Run:
        good: dict[str, Any] = {
            "late_ns": [50_000] * 1000,
            "valve_ns": [300_000] * 1000,
            "tick_ns": [400_000] * 1000,
            "joystick_ns": [10_000_000] * 1000,
            "missed": 0,
            "events": [("slew", "ACTIVE", "JOYSTICK_MOVED")],
            "moved": ["lift", "near_far", "slew"],
            "faults": {},
            "policy": None,
            "memory": None,
        }
        return Run(**{**good, **changes})

    return make
