"""A gateway as a service: the rules of can-gw come before the daemon, the fallback after it."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.hil.machine import joysticks_on, open_bus, wait_for
from tests.systemd.unit import Unit, run

EXAMPLE = Path("/usr/share/canshaper/gateway.conf")
DROP_INS = Path("/etc/systemd/system/canshaper@gateway-forwarder.service.d")
SLOW = "[Service]\nTimeoutStopSec=120s\n"  # files come from a host that is busy


@pytest.fixture
def gateway(installed: None) -> Iterator[Unit]:
    """The instance of the shipped gateway between vcan0 and vcan1, with the shipped drop-in."""
    unit = Unit("gateway-forwarder")
    DROP_INS.mkdir(parents=True)
    shutil.copy(EXAMPLE, DROP_INS)
    (DROP_INS / "slow.conf").write_text(SLOW)
    run("systemctl", "daemon-reload")
    unit.systemctl("start")
    yield unit
    unit.systemctl("stop")
    run("canshaper", "gateway", str(unit.file), "down")
    shutil.rmtree(DROP_INS)  # made by an administrator, who takes it away again
    run("systemctl", "daemon-reload")


def state(unit: Unit) -> str:
    return run("canshaper", "gateway", str(unit.file)).stdout.splitlines()[0]


def test_rules_before_it_and_the_fallback_after_it(gateway: Unit) -> None:
    assert state(gateway) == "vcan0 vcan1: 40 rules, running"
    gateway.wait_journal("gateway=rules-right", "")
    process = Path("/proc") / gateway.show("MainPID")
    effective = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines())
    assert effective["CapEff"].strip("\t0") == ""  # rules are made by others
    cursor = gateway.cursor()
    with joysticks_on("vcan0") as joysticks, open_bus("vcan1") as far:
        wait_for(far, "JoystickLeft", lambda v: v["Slew"] == 0.0)
        before = gateway.number("NRestarts")
        joysticks.values["Slew"] = 80.0
        gateway.systemctl("kill", "--signal=KILL")
        gateway.wait_journal("away, 2 rules added", cursor)
        gateway.wait_restart(before)
        assert state(gateway) == "vcan0 vcan1: 40 rules, running"
        wait_for(far, "SlewStatus", lambda v: v["Reason"] == "JOYSTICK_NOT_NEUTRAL")
        gateway.systemctl("stop")
        assert state(gateway) == "vcan0 vcan1: 42 rules, away"
        while far.recv(0) is not None:
            pass
        for _ in range(10):
            assert wait_for(far, "JoystickLeft", lambda _: True)["Slew"] == 0.0
