"""Trips of a daemon that is killed soon after: the black box is on the disk, and true."""

import os
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import can
import cantools.database
import pytest
from typer.testing import CliRunner

from canshaper.bus.multicast import LocalMulticastBus
from canshaper.cli.app import app
from tests.rigs.files import ROOT, machine_file

pytestmark = pytest.mark.processes

GROUP = f"239.79.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
BUS = "{ interface: socketcan, channel: vcan0, bitrate: 250000 }"
ANSWER_S = 60.0  # only to end a test that hangs
DBC = cantools.database.load_file(ROOT / "dbc" / "forwarder.dbc")
JOYSTICKS = {"JoystickLeft": ("Slew", "NearFar"), "JoystickRight": ("Lift", "Rotate")}


class Drive:
    """A daemon on a bus of this process, and the joysticks that drive it."""

    def __init__(self, folder: Path, bus: can.BusABC) -> None:
        self.boxes, self._bus, self._count = folder / "boxes", bus, 0
        self._log = folder / "log"
        bus = (BUS, f"{{ interface: udp_multicast, channel: {GROUP} }}")
        file = machine_file(folder, "forwarder", bus)
        command = [sys.executable, "-m", "canshaper", "run", str(file)]
        with self._log.open("wb") as log:
            self.process = subprocess.Popen([*command, "--black-box", self.boxes], stderr=log)

    def until(self, happened: Callable[[], bool], enable: int = 1, **values: float) -> None:
        """Send both joysticks every 20 ms."""
        until = time.monotonic() + ANSWER_S
        while not happened():
            assert time.monotonic() < until, self._log.read_text()
            self._count = (self._count + 1) % 256
            for name, axes in JOYSTICKS.items():
                message = DBC.get_message_by_name(name)
                signals = {axis: values.get(axis, 0.0) for axis in axes}
                switches = {"Enable": enable, "AntiSwayOff": 0, "Reset": 0}
                data = message.encode({**signals, **switches, "AliveCounter": self._count})
                frame = can.Message(
                    arbitration_id=message.frame_id, is_extended_id=False, data=data
                )
                self._bus.send(frame)
            time.sleep(0.02)

    def logged(self, text: str) -> Callable[[], bool]:
        return lambda: text in self._log.read_text()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(ANSWER_S)


def after(seconds: float) -> Callable[[], bool]:
    until = time.monotonic() + seconds
    return lambda: time.monotonic() >= until


def trip_and_kill(folder: Path, after_s: float) -> None:
    """One axis trips, the other one goes on; then the daemon is killed."""
    folder.mkdir()
    with LocalMulticastBus(GROUP) as bus:
        drive = Drive(folder, bus)
        try:
            for text in ("axis=slew state=READY", "axis=lift state=READY"):
                drive.until(drive.logged(text))
            drive.until(drive.logged("axis=slew state=ACTIVE"), Slew=60.0, Lift=60.0)
            drive.until(drive.logged("state=TRIPPED"), enable=0, Slew=60.0, Lift=60.0)
            drive.until(after(after_s), Lift=60.0)
        finally:
            drive.kill()
    (box,) = drive.boxes.glob("*.zip")
    result = CliRunner().invoke(app, ["replay", str(box), "--verify", "--out", str(folder / "out")])
    assert result.exit_code == 0, result.output
    assert "state=TRIPPED from=ACTIVE" in result.output
    assert "same to the last bit" in result.output


def test_a_trip_is_on_the_disk_half_a_second_later(tmp_path: Path) -> None:
    trip_and_kill(tmp_path / "one", 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_forty_trips_are_on_the_disk(tmp_path: Path, seed: int) -> None:
    trip_and_kill(tmp_path / "one", random.Random(seed).uniform(0.5, 10.0))
