"""Nodes that send what the controller takes: an input in its cycle, the measured radius."""

import random
from collections.abc import Iterable

from canshaper.codec.frame import Frame
from tests.faults.fault import Fault
from tests.faults.inputs import Input
from tests.faults.machine import Machine


class Sender:
    """A node that sends one input in its cycle, with the counter running."""

    def __init__(self, source: Input, tick_ms: int, rng: random.Random) -> None:
        self.source = source
        self._tick_ms = tick_ms
        self._phase = rng.randrange(source.cycle_ms)
        self._late = rng.choice((0.0, 0.0, 0.1, 0.3))  # how often a frame slips into the next tick
        self._rng = rng
        self._count = rng.randrange(256)
        self._waiting: list[bytes] = []

    def due(self, tick: int) -> int:
        """How many frames are due in the tick that ends at this one."""
        cycle, end = self.source.cycle_ms, tick * self._tick_ms + self._phase
        return end // cycle - (end - self._tick_ms) // cycle

    def counted(self, raw: dict[str, int]) -> dict[str, int]:
        """Raw values with the next alive counter."""
        self._count += 1
        if counter := self.source.counter:
            return {**raw, counter.name: self._count & counter.mask}
        return raw

    def passed(self, frames: list[bytes]) -> list[bytes]:
        """Return those of the frames that arrive now."""
        frames = self._waiting + frames
        self._waiting = []
        if frames and self._rng.random() < self._late:
            self._waiting = [frames.pop()]
        return frames


def radius_frames(machine: Machine, value: int, active: Iterable[Fault]) -> list[Frame]:
    """A frame of the measured radius, where there is one, with the faults that act on it."""
    if machine.radius is None:
        return []
    key, length, field = machine.radius
    for fault in active:
        if fault.kind == "radius: none":
            return []
        if fault.kind == "radius: jumping":
            value = fault.rng.randint(0, field.full)
        elif fault.kind == "radius: anything":
            value = fault.rng.randint(field.low, field.high)
        elif fault.kind == "radius: wrong length":
            length += fault.rng.choice((-1, 1))
    word = field.put(value) & ((1 << 8 * length) - 1)
    return [Frame(*key, word.to_bytes(length, "little"))]
