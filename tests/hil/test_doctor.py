"""The doctor on real interfaces: it sees them, receives the joysticks, and sends nothing."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.hil.machine import FILE, candump, joysticks_on, logged


def doctor(*arguments: str) -> dict[str, dict[str, Any]]:
    """Findings of ``canshaper doctor`` by their subject."""
    command = [sys.executable, "-m", "canshaper", "doctor", str(FILE), *arguments]
    command += ["--seconds", "1", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    findings = json.loads(done.stdout)["findings"]
    return {finding["subject"]: finding for finding in findings}


def test_nothing_is_sent_on_the_bus_of_the_deployment(tmp_path: Path) -> None:
    with candump(tmp_path / "vcan0.log", "vcan0"):
        findings = doctor("--no-load", "--listen", "1")
    assert logged(tmp_path / "vcan0.log") == []
    assert findings["vcan0"]["found"] == "up; a virtual bus, nothing else to check"
    assert findings["joystick left"]["level"] == "bad"
    assert findings["joystick left"]["found"] == "0 frames received"


def test_the_joysticks_are_received() -> None:
    with joysticks_on("vcan0"):
        findings = doctor("--no-load", "--listen", "1")
    for name in ("joystick left", "joystick right"):
        assert "frames, a period of" in findings[name]["found"]
        assert "(DBC: 20 ms)" in findings[name]["found"]


def test_the_set_up_of_a_controller_is_seen(can_pair: tuple[str, str]) -> None:
    name = can_pair[0]
    findings = doctor("--no-load", "--channel", name)
    assert findings[f"{name} bit rate"]["found"] == "250000 bit/s"
    assert findings[f"{name} restart"]["level"] == "warning"
    assert findings[f"{name} queue"]["level"] == "ok"


def test_an_interface_that_is_not_there_cannot_be_listened_to() -> None:
    findings = doctor("--no-load", "--channel", "can7", "--listen", "1")
    assert findings["can7"]["found"] == "No such device"
    assert findings["joysticks"]["found"] == "cannot listen: No such device"
