"""A gateway in the line between vcan0 and vcan1: its file, its rules, and frames of others."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can

from tests.hil.machine import ANSWER_S, FILE, Service, service
from tests.rigs.files import machine_file

GATEWAY = FILE.with_name("gateway-forwarder.yaml")
NEAR, FAR = "vcan0", "vcan1"
OURS = {0x110, 0x111, 0x300, 0x301, 0x302, 0x310, 0x311}  # joysticks and status messages
BATCH = 40  # a bus carries so many in 20 ms, a receive queue some more


def write(folder: Path, *changes: tuple[str, str], base: Path = GATEWAY) -> Path:
    return machine_file(folder, base, *changes)


def rules(file: Path, state: str, code: int = 0) -> str:
    command = [sys.executable, "-m", "canshaper", "gateway", str(file), state]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr + done.stdout
    return done.stdout


def cangw() -> list[str]:
    """Rules and counters that the foreign tool shows."""
    # Its exit code is a length.
    done = subprocess.run(["cangw", "-L"], capture_output=True, text=True, check=False)
    return [line.partition(" #")[0] for line in done.stdout.splitlines()]


KERNEL = ("forwarding: kernel", "forwarding: kernel")
DAEMON = ("forwarding: kernel", "forwarding: daemon")
STOP = ("fallback: neutral", "fallback: stop")


@contextmanager
def in_the_line(folder: Path, *changes: tuple[str, str]) -> Iterator[tuple[Service, Path]]:
    """The daemon at work between both buses."""
    file = write(folder, *changes)
    rules(file, "running")
    with service(folder / "log", "run", str(file)) as daemon:
        daemon.wait_log("started")
        yield daemon, file


def key(message: can.Message) -> tuple[int, bool, bytes]:
    return message.arbitration_id, message.is_extended_id, bytes(message.data)


def exchanged(
    here: can.BusABC, there: can.BusABC, messages: list[can.Message]
) -> list[tuple[int, bool, bytes]]:
    """Send these, a few at a time; what of frames that are not ours comes on the other side."""
    keys: list[tuple[int, bool, bytes]] = []
    until = time.monotonic() + ANSWER_S
    for i in range(0, len(messages), BATCH):
        batch = messages[i : i + BATCH]
        for message in batch:
            here.send(message)
        while not keys or keys[-1] != key(batch[-1]):
            assert time.monotonic() < until, f"{len(keys)} of {i + len(batch)} came"
            message = there.recv(1.0)
            if message and (message.is_extended_id or message.arbitration_id not in OURS):
                keys.append(key(message))
    return keys


def drain(bus: can.BusABC) -> None:
    while bus.recv(0) is not None:
        pass
