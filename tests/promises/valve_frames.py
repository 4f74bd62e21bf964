"""Frames of the valves of a deployment, written and read by their bytes."""

from functools import cache
from pathlib import Path
from typing import Any

import yaml

from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.faults.fields import Field
from tests.faults.machine import Machine
from tests.faults.sealed import sealed
from tests.faults.shipped import CONFIG

ACTIVE = 0xF  # control word of CiA 408


@cache
def loaded(path: Path) -> tuple[dict[str, Any], Machine, Deployment]:
    """File, the machine as its files say, and the deployment."""
    return yaml.safe_load(path.read_text()), Machine(path.stem, path), load_deployment(path)


class ValveFrames:
    """Commands in the frames of a deployment's valves."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.file, self.machine, self.deployment = loaded(CONFIG / f"{name}.yaml")
        self.axes = self.machine.axes
        self._commands = {axis: self._command(axis) for axis in self.axes}

    def encode(self, axis: str, data: bytes, steps: int) -> bytes:
        """A valve's frame with another command, else as it was."""
        of, word = self.axes[axis], int.from_bytes(data, "little")
        also, codes, e2e = self._commands[axis]
        put = [(of.valve, abs(steps) if of.direction else steps)]
        if codes:
            field, code = codes
            put.append((field, code[(steps > 0) - (steps < 0)]))
        put += [(field, round(field.full * abs(steps) / of.steps)) for field in also]
        if of.words and steps:
            put.append((of.words.control, ACTIVE))
        for field, raw in put:
            word = word & ~(field.mask << field.start) | field.put(raw)
        return sealed(e2e, word.to_bytes(len(data), "little"))

    def _command(self, axis: str) -> tuple[list[Field], tuple[Field, dict[int, int]] | None, Any]:
        """Other fields with the command of an axis, code of the direction by sign, and E2E."""
        of, valve = self.axes[axis], self.file["axes"][axis]["valve"]
        signal = of.valve_message.get_signal_by_name
        also = [Field(signal(name)) for name in valve.get("also", [])]
        if not of.direction:
            return also, None, valve.get("e2e")
        name, signs = of.direction
        codes = Field(signal(name)), {sign: code for code, sign in signs.items()}
        return also, codes, valve.get("e2e")

    def fields(self, axis: str) -> list[Field]:
        """Where its command lies in the frame of its valve; the first one is the size."""
        of, (also, codes, _) = self.axes[axis], self._commands[axis]
        words = [of.words.control] if of.words else []
        return [of.valve, *also, *([codes[0]] if codes else []), *words]

    def count(self, axis: str, data: bytes) -> int:
        """Alive counter of a valve's frame, where that is a signal."""
        counter = self.axes[axis].valve_counter
        return counter.get(int.from_bytes(data, "little")) if counter else 0

    def counted(self, axis: str, data: bytes, ahead: int) -> bytes:
        """A valve's frame whose alive counter, signal or of E2E, is so much ahead."""
        if counter := self.axes[axis].valve_counter:
            word, now = int.from_bytes(data, "little"), self.count(axis, data)
            word += counter.put(now + ahead) - counter.put(now)
            return word.to_bytes(len(data), "little")
        return sealed(self.file["axes"][axis]["valve"].get("e2e"), data, ahead)

    def decode(self, axis: str, data: bytes) -> int | None:
        """Steps in a frame of the valve; None where it is no command."""
        of, word = self.axes[axis], int.from_bytes(data, "little")
        if len(data) != of.valve_message.length:
            return None
        steps = of.valve.get(word)
        if of.direction and (codes := self._commands[axis][1]):
            sign = of.direction[1].get(codes[0].get(word))
            if sign is None or steps < 0 or (steps == 0) != (sign == 0):
                return None
            steps *= sign
        return steps if abs(steps) <= of.steps else None
