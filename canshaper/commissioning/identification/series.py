"""A measured signal over time, with its unit, and what is known of the commands with it."""

import math
import re
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from canshaper.errors import IdentificationError

Array = NDArray[np.float64]
Span = tuple[float, float]  # start and end, s

# Bins that a fast signal is averaged into; the shortest period that is looked for has 15 of them.
BIN_S = 0.02
# Step back that is still taken for reordering by the logger, s.
_REORDERED_S = 0.1


class Kind(Enum):
    """Quantity of a signal in the swing."""

    ANGLE = "angle"
    """Angle, rad."""
    RATE = "rate"
    """Its rate, in rad/s."""
    OTHER = "other"
    """Something that swings along, such as a pressure, in its own unit."""

    @property
    def shown(self) -> tuple[float, str]:
        """Factor to the unit for people, and its name; a signal of another kind has its own."""
        if self is Kind.OTHER:
            return 1.0, ""
        return math.degrees(1.0), "degrees" if self is Kind.ANGLE else "degrees/s"


@dataclass(frozen=True, slots=True)
class Value:
    """A number with its confidence interval: ``value`` +- ``half``."""

    value: float
    half: float

    @property
    def relative(self) -> float:
        """Half width as a part of the value."""
        return self.half / abs(self.value) if self.value else math.inf


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of a signal as it was logged: its kind, the factor to rad or rad/s, and its name."""

    kind: Kind
    factor: float
    text: str


_RADIANS = math.pi / 180.0
_UNITS = {
    r"(deg(rees?)?|°)\s*(/|per\s*)\s*s(ec)?|°\s*s-1|dps": (Kind.RATE, _RADIANS),
    r"rad(ians?)?\s*(/|per\s*)\s*s(ec)?|rad\s*s-1": (Kind.RATE, 1.0),
    r"mrad\s*/\s*s": (Kind.RATE, 1e-3),
    r"mrad": (Kind.ANGLE, 1e-3),
    r"deg(rees?)?|°": (Kind.ANGLE, _RADIANS),
    r"rad(ians?)?": (Kind.ANGLE, 1.0),
}
_ACCELERATION = re.compile(r"m\s*/\s*s\s*(\^?2|²|/s)|m\s*s-2|m?g", re.IGNORECASE)


def unit_of(text: str) -> Unit:
    """The unit of that name.

    Raises:
        IdentificationError: it is that of an acceleration, which does not show a swing.
    """
    text = text.strip()
    for pattern, (kind, factor) in _UNITS.items():
        if re.fullmatch(pattern, text, re.IGNORECASE):
            return Unit(kind, factor, text)
    if _ACCELERATION.fullmatch(text):
        raise IdentificationError(
            f"is an acceleration ({text}), and what hangs freely feels its weight along the cable"
            " all the time: it does not show the swing; name the gyroscope (rad/s, deg/s) instead"
        )
    return Unit(Kind.OTHER, 1.0, text)


@dataclass(frozen=True, slots=True)
class Command:
    """Commands of an axis, each held until the next: rising times, and parts of full speed."""

    time_s: Array
    speed: Array


@dataclass(frozen=True, slots=True)
class Series:
    """A signal of one axis, in rad, rad/s or its own unit; times from the start of the log, s."""

    source: str  # file and signal, for people
    label: str  # state of the grapple it was logged in, such as "empty"; may be ""
    unit: Unit
    time_s: Array  # rising
    value: Array
    command: Command | None = None  # of the axis, where the log has them
    idle: list[Span] | None = None  # no axis was commanded to move; None where that is not known
    others: list[Span] = field(default_factory=list)  # other axes were commanded
    at: float | None = None  # value of the deployment's grapple signal, where the log has it
    notes: list[str] = field(default_factory=list)  # what was left out while reading


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of a signal, that begins at ``start_s`` in the log; its times count from there."""

    source: str
    start_s: float
    time_s: Array
    value: Array
    kind: Kind

    @property
    def end_s(self) -> float:
        """Its end in the log."""
        return self.start_s + float(self.time_s[-1])


def ordered(source: str, time_s: Array, value: Array) -> tuple[Array, Array]:
    """Times in s and values with numbers only, in order; ``source``: file and signal.

    Raises:
        IdentificationError: the time goes back: two clocks or two recordings in one file.
    """
    good = np.isfinite(value) & np.isfinite(time_s)
    time_s, value = time_s[good], value[good]
    if len(time_s) < 2:
        return time_s, value
    latest = np.maximum.accumulate(time_s)
    drop = latest - time_s
    worst = int(np.argmax(drop))
    if drop[worst] > _REORDERED_S:
        raise IdentificationError(
            f"{source}: the time goes back by {drop[worst]:.3g} s after {latest[worst]:.3f} s:"
            " two clocks, or two recordings in one file; record on one clock, or split the file"
        )
    order = np.argsort(time_s, kind="stable")
    return time_s[order], value[order]


def binned(time_s: Array, value: Array) -> tuple[Array, Array]:
    """Means of times and values in bins, those without samples left out; times rise strictly."""
    if not len(time_s):
        return time_s, value
    number = np.floor((time_s - time_s[0]) / BIN_S + 1e-6).astype(np.int64)
    first = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
    count = np.diff(np.append(first, len(number)))
    return np.add.reduceat(time_s, first) / count, np.add.reduceat(value, first) / count


def pieces(time_s: Array, gap_s: float) -> list[slice]:
    """Stretches without gaps longer than ``gap_s``."""
    near = np.diff(time_s) <= gap_s
    return [slice(a, b + 1) for a, b in runs(np.append(near, False))]


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Each run of True, as the numbers of its first one and of the one behind its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def common(one: list[Span], other: list[Span]) -> list[Span]:
    """Return the intersection of two lists of stretches, each in order."""
    common, i, j = [], 0, 0
    while i < len(one) and j < len(other):
        start, end = max(one[i][0], other[j][0]), min(one[i][1], other[j][1])
        if end > start:
            common.append((start, end))
        if one[i][1] < other[j][1]:
            i += 1
        else:
            j += 1
    return common
