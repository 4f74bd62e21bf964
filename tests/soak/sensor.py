"""A sway sensor for the soak: the simulated crane's, with faults put between it and the daemon.

The plant sends it on a bus of its own; ``Relay`` passes it on to the daemon's bus.
"""

import math
import random
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import can

from tests.hil.hand import CYCLE_S, write_deployment
from tests.hil.machine import open_bus
from tests.rigs.files import ROOT

SWAY = 0x410
DEGREES = 0.01  # of a step of the signal
SENSOR = (
    "    sway_sensor: { bus: crane, message: SwayAngle, signal: Across, kind: angle, "
    "invert: true, use: damp, timeout_ms: 80 }\n"
)
STATUS = "    status: { bus: crane, message: SlewStatus }\n"
BUS = "  crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }\n"

Change = Callable[[float], float | None]
"""What is sent, degrees, for what was measured; None for no frame."""


def write_files(folder: Path) -> tuple[Path, Path]:
    """The protected deployment with a sway sensor on slew, and what the plant takes it for."""
    file, plant = write_deployment(folder), folder / "plant.yaml"
    dbc = ROOT / "dbc" / "sway-sensor.dbc"
    text = file.read_text().replace("[protected.dbc]", f"[protected.dbc, {dbc}]")
    assert text.count(STATUS) == 1
    text = text.replace(STATUS, STATUS.replace("SlewStatus", "SlewSensedStatus") + SENSOR)
    file.write_text(text)
    tool = BUS.replace("crane", "tool").replace("vcan0", "vcan1")
    text = text.replace(BUS, BUS + tool)
    plant.write_text(text.replace(SENSOR, SENSOR.replace("bus: crane", "bus: tool")))
    return file, plant


class Relay(threading.Thread):
    """Passes the sensor's frames on from vcan1 to vcan0, changed by ``change``."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._tool, self._crane = open_bus("vcan1"), open_bus("vcan0")
        self._end = threading.Event()
        self.change: Change = lambda degrees: degrees

    def run(self) -> None:
        while not self._end.is_set():
            message = self._tool.recv(1.0)
            if message is None or message.arbitration_id != SWAY:
                continue
            across = int.from_bytes(message.data[:2], "little", signed=True) * DEGREES
            if (sent := self.change(across)) is None:
                continue
            raw = round(sent / DEGREES).to_bytes(2, "little", signed=True)
            message.data[:2] = raw
            with suppress(can.CanError):  # the interface may be down
                self._crane.send(message)

    def close(self) -> None:
        """End it."""
        self._end.set()
        self.join()
        self._tool.shutdown()
        self._crane.shutdown()


@contextmanager
def relay() -> Iterator[Relay]:
    """A relay at work."""
    running = Relay()
    running.start()
    try:
        yield running
    finally:
        running.close()


def silent(_pick: random.Random) -> Change:
    """Nothing is sent any more."""
    return lambda _degrees: None


def sticks(_pick: random.Random) -> Change:
    """The first value for ever."""
    first: list[float] = []

    def change(degrees: float) -> float:
        first.append(degrees)
        return first[0]

    return change


def jumps(pick: random.Random) -> Change:
    """Somewhere else at once, and there to stay."""
    by = pick.choice((-1, 1)) * pick.uniform(5.0, 30.0)
    return lambda degrees: degrees + by


def leans(pick: random.Random) -> Change:
    """An offset that grows to 8 degrees within four seconds."""
    by, steps = pick.choice((-8.0, 8.0)), iter(range(10**9))
    return lambda degrees: degrees + by * min(1.0, next(steps) * CYCLE_S / 4.0)


def swings(pick: random.Random) -> Change:
    """A swing of its own, of another length, that never ends."""
    amplitude, period_s = pick.uniform(3.0, 15.0), pick.uniform(1.5, 3.5)
    turn, steps = 2.0 * math.pi * CYCLE_S / period_s, iter(range(10**9))
    return lambda degrees: degrees + amplitude * math.sin(turn * next(steps))


KINDS: dict[str, Callable[[random.Random], Change]] = {
    f"sensor {make.__name__}": make for make in (silent, sticks, jumps, leans, swings)
}
NAMED = {"sensor silent": {"LOST"}, "sensor jumps": {"JUMP"}}
"""What the status must say of them; of the others it depends on the motion."""
