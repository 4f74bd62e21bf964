"""Operator, daemon and plant as processes on real SocketCAN."""

import json
import re
import subprocess
import sys
from pathlib import Path

import can
import cantools
import pytest

from tests.hil.machine import (
    DBC,
    FILE,
    VALVES,
    Service,
    candump,
    logged,
    message_name,
    open_bus,
    service,
    wait_for,
)
from tests.rigs.files import ROOT, text_of

# What an emulated processor that is late makes the daemon say, rightly.
LATE = re.compile(r"from=ACTIVE reason=(LOOP_\w+|\w*JOYSTICK_TIMEOUT|ENABLE_LOST)")


def test_demo_on_vcan0_and_its_candump_log_decodes(tmp_path: Path) -> None:
    log = tmp_path / "drive.log"
    command = [sys.executable, "-m", "canshaper", "demo", "--transport", "vcan0"]
    command += ["--script", "pulse-near_far", "--out", str(tmp_path)]
    with candump(log, "vcan0"):
        subprocess.run(command, check=True)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["transport"] == "vcan0 (SocketCAN)"
    near_far = report["axes"]["near_far"]
    assert near_far["raw"]["residual_deg"] > 10.0
    # 98 % on a PC; an emulated processor misses deadlines, and a command held too long is sway.
    assert near_far["residual_reduction_pct"] > 85.0
    assert (tmp_path / "demo.png").stat().st_size > 20_000

    seen = set()
    fastest = 0.0
    for message in logged(log):
        name = message_name(message)
        assert name is not None, f"unknown id {message.arbitration_id:#x}"
        values = DBC.decode_message(name, message.data)
        assert len(message.data) == DBC.get_message_by_name(name).length
        seen.add(name)
        if name == "TipVelocity":
            fastest = max(fastest, values["RadialSpeed"])
    # this crane has no joints to report
    messages = cantools.database.load_file(ROOT / "dbc" / "forwarder.dbc").messages
    assert seen == {m.name for m in messages if not m.name.startswith("Joint")}
    assert fastest == pytest.approx(1.0, abs=0.03)


def test_joystick_and_valves_on_different_buses(
    can_pairs: tuple[tuple[str, str], tuple[str, str]], tmp_path: Path
) -> None:
    (joystick, joystick_far), (valve, valve_far) = can_pairs
    text = text_of(FILE).replace(
        "  crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }",
        "  joy: { interface: socketcan, channel: can0 }\n"
        "  crane: { interface: socketcan, channel: can2 }",
    )
    head, joysticks, rest = text.partition("joysticks:")
    joystick_part, axes, rest = rest.partition("axes:")
    file = tmp_path / "two.yaml"
    file.write_text(
        head + joysticks + joystick_part.replace("bus: crane", "bus: joy") + axes + rest
    )
    ours = ["--channel", f"joy={joystick}", "--channel", f"crane={valve}"]
    theirs = ["--channel", f"joy={joystick_far}", "--channel", f"crane={valve_far}"]
    with (
        candump(tmp_path / "joy.log", joystick_far),
        candump(tmp_path / "valve.log", valve_far),
        service(tmp_path / "sim.log", "sim", str(file), *theirs) as sim,
        service(tmp_path / "run.log", "run", str(file), *ours) as daemon,
    ):
        daemon.wait_log("started file=")
        with open_bus(valve_far) as bus:  # a plant that comes late has not seen the press
            wait_for(bus, "TipVelocity", lambda _: True)
        operate(tmp_path / "operator.log", daemon, "--script", "pulse-near_far", *theirs)
        assert sim.process.poll() is None, sim.text()
        assert daemon.end() == 0, daemon.text()
    names_joy = {message_name(m) for m in logged(tmp_path / "joy.log")}
    on_valves = logged(tmp_path / "valve.log")
    names_valve = {message_name(m) for m in on_valves}
    assert names_joy == {"JoystickLeft", "JoystickRight"}
    assert names_valve >= VALVES | {"GrappleSway", "ShaperStatus"}
    assert not names_valve & names_joy
    assert max(speed(m) for m in on_valves) == pytest.approx(1.0, abs=0.03), daemon.text()
    assert "state=ACTIVE" in daemon.text()


def operate(log: Path, daemon: Service, *script: str) -> None:
    """Play the script to its end; again where this machine was late and the daemon said so."""
    for _ in range(3):
        before = len(daemon.text())
        file = str(log.parent / "two.yaml")
        with service(log, "operator", file, *script) as operator:
            assert operator.process.wait() == 0, operator.text()
        if not LATE.search(daemon.text()[before:]):
            return
    raise AssertionError(f"late three times:\n{daemon.text()}")


def speed(message: can.Message) -> float:
    if message_name(message) != "TipVelocity":
        return 0.0
    return float(DBC.decode_message("TipVelocity", message.data)["RadialSpeed"])
