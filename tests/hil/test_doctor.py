"""The doctor beside real interfaces: it sees them, hears the joysticks, and sends nothing."""

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
        found = doctor("--no-load", "--listen", "1")
    assert logged(tmp_path / "vcan0.log") == []
    assert found["vcan0"]["found"] == "up; a virtual bus, nothing else to check"
    assert found["joystick left"]["level"] == "bad"
    assert found["joystick left"]["found"] == "0 frames received"


def test_the_joysticks_are_received() -> None:
    with joysticks_on("vcan0"):
        found = doctor("--no-load", "--listen", "1")
    for name in ("joystick left", "joystick right"):
        assert "frames, a period of" in found[name]["found"]
        assert "(DBC: 20 ms)" in found[name]["found"]


def test_the_set_up_of_a_controller_is_seen(can_pair: tuple[str, str]) -> None:
    name = can_pair[0]
    found = doctor("--no-load", "--channel", name)
    assert found[f"{name} bit rate"]["found"] == "250000 bit/s"
    assert found[f"{name} restart"]["level"] == "warning"
    assert found[f"{name} queue"]["level"] == "ok"


def test_an_interface_that_is_not_there_cannot_be_listened_to() -> None:
    found = doctor("--no-load", "--channel", "can7", "--listen", "1")
    assert found["can7"]["found"] == "No such device"
    assert found["joysticks"]["found"] == "cannot listen: No such device"
