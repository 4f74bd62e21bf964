"""Nodes of J1939 next to the daemon, and what they say of it."""

import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import can
import j1939
import pytest

from tests.hil.machine import ANSWER_S, logged, open_bus
from tests.rigs.j1939 import OWN, bjm

# Industry group 2, function 129, manufacturer 2047, serial number 1: as the file has it.
NAME = 0x20008100FFE00001


def ours(log: Path) -> list[can.Message]:
    return [m for m in logged(log) if m.is_extended_id and m.arbitration_id & 0xFF == OWN]


def kernel_has_j1939() -> None:
    subprocess.run(["modprobe", "can_j1939"], check=False, capture_output=True)
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_DGRAM, socket.CAN_J1939).close()
    except OSError as error:
        pytest.skip(f"this kernel has no J1939: {error}")


class Joysticks(threading.Thread):
    """Both joysticks, sent every 20 ms."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._bus = open_bus("vcan0")
        self._ended = threading.Event()
        self.x = 0.0
        self.reset = False

    def run(self) -> None:
        while not self._ended.wait(0.02):
            for frame in (bjm("BJM1", X=self.x, Button2=int(self.reset)), bjm("BJM2")):
                message = can.Message(arbitration_id=frame.can_id, data=frame.data)
                with suppress(can.CanError):  # the interface may be down
                    self._bus.send(message)

    def end(self) -> None:
        self._ended.set()
        self.join()
        self._bus.shutdown()


@contextmanager
def another_ecu(name: int) -> Iterator[j1939.ControllerApplication]:
    """A node of can-j1939 that claims our address, and has no other."""
    ecu = j1939.ElectronicControlUnit()
    ecu.connect(interface="socketcan", channel="vcan0")
    application = j1939.ControllerApplication(j1939.Name(value=name), OWN)
    ecu.add_ca(controller_application=application)
    application.start()
    try:
        yield application
    finally:
        ecu.disconnect()
        ecu.stop()


@contextmanager
def j1939acd(name: int, log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """The address claiming daemon of can-utils, with our address as its only one."""
    kernel_has_j1939()
    command = ["j1939acd", "-v", "-r", str(OWN), f"{name:016x}", "vcan0"]
    with log.open("wb") as file:
        process = subprocess.Popen(command, stdout=file, stderr=file)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(ANSWER_S)
