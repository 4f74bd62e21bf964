"""A measured signal over time, with its unit, and the commands of the axes in the same log."""

import math
import re
from array import array
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from canshaper.codec.frame import Frame
from canshaper.codec.layout import Layout
from canshaper.errors import IdentificationError
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper.recording.channels import InputFinder, joystick_commands, valve_part

Array = NDArray[np.float64]
Span = tuple[float, float]  # start and end, s

# Bins that a fast signal is averaged into; the shortest period that is looked for has 15 of them.
BIN_S = 0.02
# Part of full speed below which a command counts as standing.
STANDS = 0.01
# A time that goes back by less is a frame that the logger wrote out of order, s.
_REORDERED_S = 0.1


class Kind(Enum):
    """Quantity that a signal of a swing measures."""

    ANGLE = "angle"  # rad
    RATE = "rate"  # of the angle, rad/s
    OTHER = "other"  # something that swings along, such as a pressure, in its own unit

    @property
    def shown(self) -> tuple[float, str]:
        """Factor to the unit for people, and its name; "" for the signal's own unit."""
        if self is Kind.OTHER:
            return 1.0, ""
        return math.degrees(1.0), "degrees" if self is Kind.ANGLE else "degrees/s"

    def angle(self, amplitude: float, omega: float) -> float:
        """Return the amplitude of the swing in rad; 0 where it is not known. ``omega`` in rad/s."""
        return {Kind.ANGLE: amplitude, Kind.RATE: amplitude / omega}.get(self, 0.0)


@dataclass(frozen=True, slots=True)
class Value:
    """A number with its interval of 95 %: ``value`` +- ``half``."""

    value: float
    half: float

    @property
    def relative(self) -> float:
        """Half width as a part of the value; infinite for a value of 0."""
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
    """Return the unit with this name; one that is not known is of ``Kind.OTHER``.

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

    def at(self, time_s: Array) -> Array:
        """Return the parts of full speed at these times; 0 before the first command."""
        return np.append(0.0, self.speed)[np.searchsorted(self.time_s, time_s, side="right")]


@dataclass(frozen=True, slots=True)
class Series:
    """A signal of one axis, in rad, rad/s or its own unit; times from the start of the log, s."""

    source: str  # file and signal, for people
    unit: Unit
    time_s: Array  # rising
    value: Array
    command: Command | None = None  # of the axis, where the log has them
    idle: list[Span] | None = None  # while every axis was commanded to stand; None: not known
    others: list[Span] = field(default_factory=list)  # while other axes were commanded to move
    at: float | None = None  # value of the deployment's grapple signal, where the log has it
    notes: list[str] = field(default_factory=list)  # what was left out while reading

    @property
    def driven_s(self) -> float:
        """Seconds in which the axis was commanded to move."""
        if self.command is None or not len(self.command.time_s):
            return 0.0
        held = np.diff(self.command.time_s, append=self.command.time_s[-1])
        return float(held[np.abs(self.command.speed) > STANDS].sum())


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of a signal from ``start_s`` in the log on; its times count from there."""

    source: str
    start_s: float
    time_s: Array
    value: Array
    kind: Kind

    @property
    def end_s(self) -> float:
        """Time of its end in the log, s."""
        return self.start_s + float(self.time_s[-1])


def ordered(source: str, time_s: Array, value: Array) -> tuple[Array, Array]:
    """Return times, s, and values by rising time, numbers only; ``source`` is file and signal.

    Raises:
        IdentificationError: the time goes back by over .1 s: two clocks or recordings in one file.
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
    """Return means of times and values in bins of ``BIN_S`` with samples; times rise strictly."""
    if not len(time_s):
        return time_s, value
    number = np.floor((time_s - time_s[0]) / BIN_S + 1e-6).astype(np.int64)
    first = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
    count = np.diff(np.append(first, len(number)))
    return np.add.reduceat(time_s, first) / count, np.add.reduceat(value, first) / count


def pieces(time_s: Array, gap_s: float) -> list[slice]:
    """Return the stretches of two or more times without a gap longer than ``gap_s``."""
    near = np.diff(time_s) <= gap_s
    return [slice(a, b + 1) for a, b in runs(np.append(near, False))]


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return each run of True: the index of its first, and the index after its last."""
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


# Silence of a command's message after which nothing is known of the command, s.
_SILENT_S = 2.0


@dataclass
class Samples:
    """Times in s from the first frame of the log, and values."""

    time_s: "array[float]" = field(default_factory=lambda: array("d"))
    value: "array[float]" = field(default_factory=lambda: array("d"))

    def add(self, time_s: float, value: float) -> None:
        """Append a sample."""
        self.time_s.append(time_s)
        self.value.append(value)

    def arrays(self) -> tuple[Array, Array]:
        """Return times and values as arrays."""
        return np.array(self.time_s), np.array(self.value)


class Commands:
    """Commands of the axes of a deployment, from valve frames, else from joysticks."""

    def __init__(self, deployment: Deployment | None) -> None:
        self._axes = dict(deployment.axes) if deployment else {}
        self._valves: dict[str, Samples] = defaultdict(Samples)
        self._joysticks: dict[str, Samples] = defaultdict(Samples)
        self._by_valve: dict[tuple[int, bool], list[tuple[BoundAxis, Layout]]] = defaultdict(list)
        for axis in self._axes.values():
            self._by_valve[axis.valve.message.key[1:]].append((axis, Layout(axis.valve_message)))
        self._limits = {n: a.config.limits.output_limits() for n, a in self._axes.items()}
        joysticks = list(deployment.joysticks.values()) if deployment else []
        self._joystick_buses = {joystick.key[0] for joystick in joysticks}
        self._finder = InputFinder(deployment.config.buses if deployment else {}, joysticks)

    def receive(self, time_s: float, key: tuple[int, bool], data: bytes) -> None:
        """Take what a frame commands, if anything; ``key``: identifier, and whether extended."""
        for axis, layout in self._by_valve.get(key, ()):
            if (part := valve_part(axis, layout, data)) is not None:
                self._valves[axis.name].add(time_s, self._limits[axis.name].velocity(part))
        for bus in self._joystick_buses:  # no one has said which channel of the log it is
            if joystick := self._finder.find(Frame(bus, *key, data), round(time_s * 1e9)):
                for name, value in joystick_commands(joystick, self._axes, data)[1].items():
                    moved = abs(value) > self._axes[name].config.command.neutral_pct / 100.0
                    self._joysticks[name].add(time_s, value if moved else 0.0)

    def of(self, axis: str) -> Command | None:
        """Return the commands of an axis, by its valve, else its joystick; None for no command."""
        return self._first(axis, self._valves, self._joysticks)

    @staticmethod
    def _first(axis: str, *kinds: Mapping[str, Samples]) -> Command | None:
        """Return the command of the first kind that the log has."""
        return next((Command(*kind[axis].arrays()) for kind in kinds if axis in kind), None)

    def others(self, axis: str) -> list[Span]:
        """Return the stretches in which other axes are commanded.

        Their joysticks count where the log has them: what a two-axis motion adds makes no swing.
        """
        others = [self._first(n, self._joysticks, self._valves) for n in self._axes if n != axis]
        return [span for c in others if c for span in _known(c, np.abs(c.speed) >= STANDS)]

    def idle(self) -> list[Span] | None:
        """Return the stretches in which every axis with commands stands; None for no commands."""
        known = [c for c in map(self.of, self._axes) if c]
        if not known:
            return None
        idle = [(max(float(c.time_s[0]) for c in known), min(float(c.time_s[-1]) for c in known))]
        for command in known:
            idle = common(idle, _known(command, np.abs(command.speed) < STANDS))
        return idle


def _known(command: Command, is_so: NDArray[np.bool_]) -> list[Span]:
    """Return the stretches in which the flags are set and the next command comes within 2 s."""
    time = command.time_s
    known = is_so[:-1] & (np.diff(time) < _SILENT_S)
    return [(float(time[a]), float(time[b])) for a, b in runs(known)]
