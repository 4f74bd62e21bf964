"""The gate's own decoder: bits of a frame to numbers and velocities, by shift and mask."""

import struct
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

Word = tuple[int, int]
"""A frame as one number, in which byte 0 is the lowest, and one in which it is the highest."""
EPSILON = 1e-6
"""Part of full speed: more than the rounding of floats, less than any step of a frame."""
SMALL = 0.05
"""Part of full deflection: neutral flag and position sensor do not meet at one angle."""
# (neutral, negative, positive) to the sign, and the largest position that may go with it.
_FLAGS: Mapping[tuple[float, ...], tuple[int, float]] = {
    (0, 0, 1): (1, 1.0),
    (0, 1, 0): (-1, 1.0),
    (1, 0, 0): (0, SMALL),
    (0, 0, 0): (0, EPSILON),
}


def word_of(data: bytes) -> Word:
    """A frame as a word."""
    return int.from_bytes(data, "little"), int.from_bytes(data, "big")


@dataclass(frozen=True, slots=True)
class Field:
    """Bits of a frame that are one number."""

    shift: int  # where they lie in the word
    mask: int
    sign: int = 0  # the sign bit; 0 where there is none
    order: int = 0  # 0 for little endian, 1 for big endian: which number of the word
    real: str = ""  # ``struct`` format of a float; empty where it is none

    def raw(self, word: Word) -> float:
        """Raw value; of a float signal the float."""
        raw = word[self.order] >> self.shift & self.mask
        if raw & self.sign:
            return raw - 2 * self.sign
        if self.real:
            size = struct.calcsize(self.real)
            return float(struct.unpack(self.real, raw.to_bytes(size, "little"))[0])
        return raw


@dataclass(frozen=True, slots=True)
class Part:
    """A signal as a part of full deflection."""

    field: Field
    scale: float  # value = (raw * scale + offset) / full
    offset: float
    full: float
    low: float  # parts of full deflection beyond which it is no measurement
    high: float
    named: frozenset[float]  # raw values that are none: those with a name in the DBC

    def value(self, word: Word) -> float | None:
        """In [-1, 1]; None where it is no measurement."""
        raw = self.field.raw(word)
        if raw in self.named:
            return None
        value = (raw * self.scale + self.offset) / self.full
        if not self.low <= value <= self.high:  # nor is what is no number
            return None
        return -1.0 if value < -1.0 else 1.0 if value > 1.0 else value


@dataclass(frozen=True, slots=True)
class Stick:
    """The demand of one axis in the frame of its joystick."""

    part: Part
    back: Part | None = None  # of a rocker with a signal for each side, the negative one
    flags: tuple[Field, ...] = ()  # of a magnitude, the signals neutral, negative and positive
    band: float = 0.02  # deflection up to which it is neutral

    def demand(self, word: Word) -> float | None:
        """In [-1, 1]; None where the frame has none, or its signals contradict each other."""
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
    """Velocity that a valve gives in one direction: behind a dead band, or by a measured curve."""

    steps: tuple[float, ...]  # commands, the first one the largest that moves nothing
    velocities: tuple[float, ...]  # parts of full speed that these give
    slopes: tuple[float, ...] = field(init=False)  # between two of them, in a step

    def __post_init__(self) -> None:
        ends = list(zip(self.steps, self.velocities, strict=True))
        self.slopes = tuple((b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(ends))

    def velocity(self, steps: int) -> float:
        """Part of full speed for a command of so many steps; one that is not 0 moves something."""
        i = bisect_right(self.steps, steps, 1, len(self.slopes)) - 1
        velocity = self.velocities[i] + (steps - self.steps[i]) * self.slopes[i]
        return velocity if velocity > 2 * EPSILON else 2 * EPSILON


def openings_of(
    deadband_pct: float, curve: tuple[Sequence[float] | None, Sequence[float] | None], full: int
) -> tuple[Opening, Opening]:
    """Return the openings of the positive and of the negative direction.

    Args:
        deadband_pct: % of full command.
        curve: instead of it, of the measured valve, commands and speeds in %.
        full: steps to full command.
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
    """A signal with a command."""

    field: Field
    zero: int  # raw value
    sign: int  # -1 where the raw value falls with the command
    full: int  # steps to full command

    def steps(self, word: Word) -> int:
        """Steps from zero."""
        return self.sign * (int(self.field.raw(word)) - self.zero)


@dataclass(frozen=True, slots=True)
class Command:
    """The command of one axis in the frame of its valve."""

    size: Resolution  # where the direction stands apart, its magnitude
    codes: tuple[Field, ...] = ()  # the signals of the direction
    signs: Mapping[tuple[float, ...], int] = field(default_factory=dict)  # of their raw values
    back: Resolution | None = None  # of a rocker, the magnitude of the negative direction
    also: tuple[Resolution, ...] = ()  # the same command in other resolutions

    def steps(self, word: Word) -> int | None:
        """With their sign; None where signals contradict each other, or it is beyond full."""
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
