"""The log of candump as the witness of a soak: marks, frames of an id of their own, divide it."""

import time
from collections import Counter
from pathlib import Path

import can

from tests.hil.machine import message_name
from tests.soak.sensor_judge import Logged

MARK = 0x7E0


class WrongMove(AssertionError):
    """A valve frame moved that must not."""


class Witness:
    """The growing log of candump, read from mark to mark."""

    def __init__(self, log: Path, bus: can.BusABC) -> None:
        self._file = log.open()
        self._bus = bus
        self._count = 0
        self._rest = ""

    def mark(self) -> None:
        """Put a mark into the log."""
        self._count += 1
        data = self._count.to_bytes(4, "big")
        message = can.Message(arbitration_id=MARK, is_extended_id=False, data=data)
        try:
            self._bus.send(message)
        except can.CanError:  # reported once, from the time when the interface was down
            self._bus.send(message)

    def until_mark(self) -> list[Logged]:
        """Frames up to the next mark, which is waited for."""
        frames: list[Logged] = []
        until = time.monotonic() + 120.0
        while True:
            line = self._file.readline()
            if not line.endswith("\n"):
                self._rest += line
                if time.monotonic() > until:
                    raise AssertionError("candump writes nothing")
                time.sleep(0.02)
                continue
            line, self._rest = self._rest + line, ""
            time_s, _, frame = line.split()[:3]
            key, _, data = frame.partition("#")
            if len(key) > 3 or data.startswith("R"):  # error frames, remote frames
                continue
            if int(key, 16) == MARK:
                return frames
            frames.append(Logged(int(key, 16), bytes.fromhex(data), float(time_s[1:-1])))


def count_frames(log: Path) -> Counter[str]:
    """Frames of the whole log by message."""
    names: Counter[str] = Counter()
    with can.CanutilsLogReader(log) as reader:
        for message in reader:
            names[message_name(message) or "other"] += 1
    return names
