"""Rules of the kernel's can-gw next to a gateway: set up, left, missing, and their checksums."""

import subprocess
from pathlib import Path

import can
import pytest

from canshaper.checksums.kinds import CHECKSUMS
from tests.codec.checksum_reference import REFERENCE
from tests.hil.gateway import (
    DAEMON,
    FAR,
    KERNEL,
    NEAR,
    STOP,
    cangw,
    exchanged,
    in_the_line,
    key,
    rules,
    write,
)
from tests.hil.machine import ANSWER_S, FILE, joysticks_on, open_bus, service
from tests.hil.machine import wait_for as wait

pytestmark = pytest.mark.usefixtures("no_rules")


@pytest.mark.parametrize("kind", [kind for kind, row in CHECKSUMS.items() if row.kernel])
def test_the_fallback_makes_checksums_right(tmp_path: Path, kind: str) -> None:
    """Computed by crccheck at both ends; the kernel does it between."""
    dbc = (FILE.parents[1] / "dbc" / "forwarder.dbc").read_text()
    # In the last byte, with the counter before it.
    counter = ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273'
    moved = ' SG_ AliveCounter : 48|8@1+ (1,0) [0|255] "" SHAPER\n'
    moved += ' SG_ Checksum : 56|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273'
    assert counter in dbc
    (tmp_path / "gateway.dbc").write_text(dbc.replace(counter, moved))
    checksum = f"checksum: {{ signal: Checksum, kind: {kind} }}"
    file = write(
        tmp_path,
        ("left:\n    bus: joysticks", f"left:\n    {checksum}\n    bus: joysticks"),
        ("signal: Slew, timeout_ms: 200,", f"signal: Slew, timeout_ms: 200, {checksum},"),
        ("signal: NearFar, timeout_ms: 200,", f"signal: NearFar, timeout_ms: 200, {checksum},"),
        (f"{FILE.parents[1] / 'dbc'}/forwarder.dbc", "gateway.dbc"),
    )
    rules(file, "away")
    with open_bus(NEAR) as near, open_bus(FAR) as far:
        for count in range(50):
            data = bytes((0x34, 0x12, 0xFF, 0x7F, 0x01, 0, count))
            near.send(can.Message(arbitration_id=0x110, is_extended_id=False,
                                  data=data + bytes([REFERENCE[kind](0, data, 8)])))  # fmt: skip
            passed = far.recv(ANSWER_S)
            assert passed is not None
            assert bytes(passed.data[:7]) == bytes((0, 0, 0, 0, 1, 0, count))
            assert passed.data[7] == REFERENCE[kind](0, bytes(passed.data[:7]), 8)


def test_a_fallback_that_is_left_in_place_is_reported_and_moves_nothing(tmp_path: Path) -> None:
    """Two senders of one message: the user who started the daemon by hand is to see it."""
    file = write(tmp_path)
    rules(file, "away")
    with (
        joysticks_on(NEAR),
        open_bus(FAR) as far,
        service(tmp_path / "log", "run", str(file)) as daemon,
    ):
        daemon.wait_log("gateway=rules-too-many")
        wait(far, "SlewStatus", lambda v: v["Reason"] == "SECOND_SENDER")


def test_missing_rules_are_reported(tmp_path: Path) -> None:
    with service(tmp_path / "log", "run", str(write(tmp_path))) as daemon:
        daemon.wait_log("gateway=rules-missing 40 of 40")


def test_rules_are_set_up_shown_and_removed(tmp_path: Path) -> None:
    """A rule of another program between both interfaces goes, one elsewhere stays."""
    file = write(tmp_path)
    elsewhere = ["-s", "vxcan0", "-d", "vxcan1", "-e"]
    subprocess.run(["modprobe", "can-gw"], check=False)
    subprocess.run(["cangw", "-A", *elsewhere], check=True)
    subprocess.run(["cangw", "-A", "-s", NEAR, "-d", FAR, "-e", "-f", "110:7FF"], check=True)
    assert "others" in rules(file, "show", code=1)
    assert f"removed {NEAR} -> {FAR} 110:7ff" in rules(file, "running")
    assert "40 rules, running" in rules(file, "show")
    assert rules(file, "running") == f"{NEAR} {FAR}: running, 0 rules added, 0 removed\n"
    assert all("-l 1" in line for line in cangw() if "vcan" in line)
    assert "42 rules, away" in [rules(file, "away"), rules(file, "show")][1]
    rules(file, "down")
    assert cangw() == ["cangw -A -s vxcan0 -d vxcan1 -e"]
    assert "0 rules, down" in rules(file, "show", code=1)


def test_pass_lets_the_joystick_through_while_the_daemon_is_away(tmp_path: Path) -> None:
    file = write(tmp_path, ("fallback: neutral", "fallback: pass"))
    rules(file, "away")
    with joysticks_on(NEAR) as joysticks, open_bus(FAR) as far:
        joysticks.values["Slew"] = 80.0
        wait(far, "JoystickLeft", lambda v: v["Slew"] == 80.0)


@pytest.mark.parametrize("who", [KERNEL, DAEMON], ids=["kernel", "daemon"])
def test_an_interface_that_was_removed(tmp_path: Path, who: tuple[str, str]) -> None:
    """Back again the daemon passes on; rules of the kernel went with it, which is reported."""
    with in_the_line(tmp_path, who, STOP) as (daemon, file):
        subprocess.run(["ip", "link", "del", FAR], check=True)
        try:
            daemon.wait_log("bus=machine state=gone")
        finally:
            subprocess.run(["ip", "link", "add", FAR, "type", "vcan"], check=True)
            subprocess.run(["ip", "link", "set", FAR, "mtu", "72", "up"], check=True)
        daemon.wait_log("bus=machine state=up")
        if who == KERNEL:
            daemon.wait_log("gateway=rules-missing 40 of 40")
            rules(file, "running")
            daemon.wait_log("rules-right(.|\n)*rules-missing(.|\n)*rules-right")
        with joysticks_on(NEAR), open_bus(NEAR) as near, open_bus(FAR) as far:
            wait(far, "JoystickLeft", lambda v: v["Enable"] == "On")
            message = can.Message(arbitration_id=0x7E1, is_extended_id=False, data=[1])
            assert exchanged(near, far, [message]) == [key(message)]
