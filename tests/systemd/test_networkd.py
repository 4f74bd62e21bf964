"""The shipped files for systemd-networkd and udev bring the buses up as they say."""

import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.systemd.unit import ANSWER_S, add_vcan, run

EXAMPLES = Path("/usr/share/canshaper/networkd")


def link(name: str) -> dict:
    shown = run("ip", "-json", "-details", "link", "show", name).stdout
    return json.loads(shown)[0] if shown.strip() else {}


@pytest.fixture
def settings(installed: None) -> Iterator[None]:
    """The examples in place; afterwards vcan0 as the other tests need it."""
    files = [shutil.copy(file, "/etc/systemd/network/") for file in EXAMPLES.iterdir()]
    subprocess.run(["ip", "link", "del", "vcan0"], check=True)
    yield
    for file in files:
        Path(file).unlink()
    subprocess.run(["systemctl", "stop", "systemd-networkd.socket", "systemd-networkd"], check=True)
    if not link("vcan0"):
        add_vcan("vcan0")


def test_examples_set_up_a_controller_and_a_virtual_bus(settings: None) -> None:
    subprocess.run(["ip", "link", "set", "can0", "down"], check=True)
    subprocess.run(["ip", "link", "set", "can0", "type", "can", "bitrate", "500000"], check=True)
    # udev reads .link files when an interface appears
    subprocess.run(["udevadm", "control", "--reload"], check=True)
    trigger = ["udevadm", "trigger", "--action=add", "--settle", "/sys/class/net/can0"]
    subprocess.run(trigger, check=True)
    assert link("can0")["txqlen"] == 16
    subprocess.run(["systemctl", "restart", "systemd-networkd"], check=True)
    until = time.monotonic() + ANSWER_S
    while not all("UP" in link(name).get("flags", []) for name in ("can0", "vcan0")):
        assert time.monotonic() < until, f"{link('can0')} {link('vcan0')}"
        time.sleep(0.2)
    controller = link("can0")["linkinfo"]["info_data"]
    assert controller["bittiming"]["bitrate"] == 250_000
    assert controller["restart_ms"] == 100
