"""The gate's own decoder: converts bits of a frame to numbers and velocities by shift and mask."""

import struct
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

Word = tuple[int, int]
"""A frame as two numbers: byte 0 is the lowest byte of the first, the highest of the second."""
EPSILON = 1e-6
"""Part of full speed: more than the rounding of floats, less than any step of a frame."""
SMALL = 0.05
"""Largest part of full deflection at which the neutral flag may be set: flag and position sensor do
not switch at one angle."""
# Flags (neutral, negative, positive) to (sign, largest part of full deflection with them).
_FLAGS: Mapping[tuple[float, ...], tuple[int, float]] = {
    (0, 0, 1): (1, 1.0),
    (0, 1, 0): (-1, 1.0),
    (1, 0, 0): (0, SMALL),
    (0, 0, 0): (0, EPSILON),
}


def word_of(data: bytes) -> Word:
    """Return a frame as a word."""
    return int.from_bytes(data, "little"), int.from_bytes(data, "big")


@dataclass(frozen=True, slots=True)
class Field:
    """Bits of a frame that are one number."""

    shift: int  # lowest bit of the number in the word
    mask: int  # all ones, as long as the number
    sign: int = 0  # the sign bit; 0 where there is none
    order: int = 0  # 0 for little endian, 1 for big endian: which number of the word
    real: str = ""  # ``struct`` format of a float; empty where it is none

    def raw(self, word: Word) -> float:
        """Return the raw value; of a float signal the float."""
        raw = word[self.order] >> self.shift & self.mask
        if raw & self.sign:
            return raw - 2 * self.sign
        if self.real:
            size = struct.calcsize(self.real)
            return float(struct.unpack(self.real, raw.to_bytes(size, "little"))[0])
        return raw


@dataclass(frozen=True, slots=True)
class Part:
    """A signal that is read as a part of full deflection."""

    field: Field
    scale: float  # value = (raw * scale + offset) / full
    offset: float
    full: float
    low: float  # parts of full deflection beyond which it is no measurement
    high: float
    named: frozenset[float]  # raw values that are no measurement, as the DBC names them

    def value(self, word: Word) -> float | None:
        """Return the value in [-1, 1]; None where it is no measurement."""
        raw = self.field.raw(word)
        if raw in self.named:
            return None
        value = (raw * self.scale + self.offset) / self.full
        if not self.low <= value <= self.high:  # true of NaN too
            return None
        return -1.0 if value < -1.0 else 1.0 if value > 1.0 else value


@dataclass(frozen=True, slots=True)
class Stick:
    """Reads the demand of one axis from the frame of its joystick."""

    part: Part
    back: Part | None = None  # negative direction of a rocker with a signal for each direction
    flags: tuple[Field, ...] = ()  # neutral, negative and positive flag, where part is a magnitude
    band: float = 0.02  # deflection up to which the joystick is neutral

    def demand(self, word: Word) -> float | None:
        """Return the demand in [-1, 1]; None where it has none, or its signals contradict."""
        value = self.part.value(word)
        if value is None:
            return None
        if self.back is not None:
            back = self.back.value(word)
            if back is None or min(value, back) < -EPSILON or min(value, back) > SMALL:
                return None
            return value - back
        if self.flags:
            neutral, negative, positive = self.flags
            flags = neutral.raw(word), negative.raw(word), positive.raw(word)
            sign, largest = _FLAGS.get(flags, (0, -1.0))
            if value < -EPSILON or value > largest:
                return None
            return sign * value
        return value


@dataclass(slots=True)
class Opening:
    """Velocity of a valve by command in one direction: beyond a deadband, or by a curve."""

    steps: tuple[float, ...]  # commands; the first is the largest command that moves nothing
    velocities: tuple[float, ...]  # part of full speed at each of these commands
    slopes: tuple[float, ...] = field(init=False)  # velocity per step between two commands

    def __post_init__(self) -> None:
        ends = list(zip(self.steps, self.velocities, strict=True))
        self.slopes = tuple((b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(ends))

    def velocity(self, steps: int) -> float:
        """Return the part of full speed for a command in steps; never 0, as the command is not."""
        i = bisect_right(self.steps, steps, 1, len(self.slopes)) - 1
        velocity = self.velocities[i] + (steps - self.steps[i]) * self.slopes[i]
        return velocity if velocity > 2 * EPSILON else 2 * EPSILON


def openings_of(
    deadband_pct: float, curve: tuple[Sequence[float] | None, Sequence[float] | None], full: int
) -> tuple[Opening, Opening]:
    """Return the openings of the positive and of the negative direction.

    Args:
        deadband_pct: deadband, % of full command.
        curve: commands and speeds of the measured valve in %, instead of the deadband, or Nones.
        full: steps from zero to full command.
    """
    commands, speeds = curve
    if commands is None or speeds is None:
        one = Opening((deadband_pct / 100.0 * full, float(full)), (0.0, 1.0))
        return one, one
    points = [(c / 100.0 * full, v / 100.0) for c, v in zip(commands, speeds, strict=True)]
    edge = next(i for i, (_, speed) in enumerate(points) if speed == 0.0)
    sides = points[edge + 1 :], [(-c, -v) for c, v in points[edge::-1]]
    forth, back = (Opening(tuple(c for c, _ in one), tuple(v for _, v in one)) for one in sides)
    return forth, back


@dataclass(frozen=True, slots=True)
class Resolution:
    """A signal that carries a command, and its resolution."""

    field: Field
    zero: int  # raw value at zero command
    sign: int  # -1 where the raw value falls as the command rises, else 1
    full: int  # steps from zero to full command

    def steps(self, word: Word) -> int:
        """Return the command as steps from zero."""
        return self.sign * (int(self.field.raw(word)) - self.zero)


@dataclass(frozen=True, slots=True)
class Command:
    """Reads the command of one axis from the frame of its valve."""

    size: Resolution  # the command; its magnitude where other signals say the direction
    codes: tuple[Field, ...] = ()  # signals of the direction
    signs: Mapping[tuple[float, ...], int] = field(default_factory=dict)  # sign by their raw values
    back: Resolution | None = None  # magnitude of the negative direction, for a rocker
    also: tuple[Resolution, ...] = ()  # the same command in other resolutions

    def steps(self, word: Word) -> int | None:
        """Return the signed steps; None where signals contradict, or they are beyond full."""
        size = steps = self.size.steps(word)
        full = self.size.full
        if self.codes:
            sign = self.signs.get(tuple([one.raw(word) for one in self.codes]))
            # No direction without a command, and no command without a direction.
            if sign is None or steps < 0 or (steps == 0) != (sign == 0):
                return None
            steps *= sign
        elif self.back is not None:
            back = self.back.steps(word)
            if size < 0 or back < 0 or (size and back):
                return None
            steps -= back
        for other in self.also:  # rounded to its own resolution
            if abs(other.steps(word) - other.full * size / full) > 0.5 + EPSILON:
                return None
        return steps if -full <= steps <= full else None
