"""One fault of a drive: what it is, when it acts, and on what."""

import random
from dataclasses import dataclass, field
from typing import Any

from tests.faults.axis import Axis
from tests.faults.inputs import Joystick
from tests.faults.machine import Machine

Raw = dict[str, int]


@dataclass
class Fault:
    """One fault of a drive."""

    kind: str
    start: int
    stop: int
    machine: Machine
    rng: random.Random
    joystick: Joystick
    axis: Axis
    memory: dict[str, Any] = field(default_factory=dict)

    def active(self, tick: int) -> bool:
        return self.start <= tick < self.stop

    def __str__(self) -> str:
        return f"{self.kind} {self.joystick.name}/{self.axis.name} {self.start}..{self.stop}"
