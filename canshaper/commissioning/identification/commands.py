"""Commands of the axes in a CAN log: when each was commanded to move, and how fast."""

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from ipaddress import ip_address
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from canshaper.codec.frame import Frame
from canshaper.codec.layout import Layout
from canshaper.commissioning.frame_finder import InputFinder
from canshaper.commissioning.identification.driven_data import STANDS
from canshaper.commissioning.identification.series import Array, Command
from canshaper.commissioning.identification.table import is_table
from canshaper.errors import CutOffError
from canshaper.machine.database import Messages
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundJoystick
from canshaper.machine.valves import BoundAxis
from canshaper.recording.log import read_log

# Silence of a command's message after which nothing is known of the command, s.
_SILENT_S = 2.0


@dataclass
class Samples:
    """Times in s from the first frame of the log, and values."""

    time_s: "array[float]" = field(default_factory=lambda: array("d"))
    value: "array[float]" = field(default_factory=lambda: array("d"))

    def add(self, time_s: float, value: float) -> None:
        """Put one in."""
        self.time_s.append(time_s)
        self.value.append(value)

    def arrays(self) -> tuple[Array, Array]:
        """Times and values."""
        return np.array(self.time_s), np.array(self.value)


def joystick_commands(
    joystick: BoundJoystick, axes: Mapping[str, BoundAxis], data: bytes
) -> tuple[dict[str, Any], dict[str, float]]:
    """Decode a joystick's frame: its raw values, and the command of each of its axes.

    Both are empty for a frame of another length; a command that is no value is left out.
    """
    if len(data) != joystick.message.length:
        return {}, {}
    raw, commands = joystick.decode(data)
    values = {}
    for name, axis in axes.items():
        config = axis.config.command
        value = commands.get(config.signal) if config.joystick == joystick.name else None
        if type(value) is float:
            values[name] = value
    return raw, values


class Commands:
    """Commands of the axes of a deployment, from valve frames, else from joysticks."""

    def __init__(self, deployment: Deployment | None) -> None:
        self._axes = dict(deployment.axes) if deployment else {}
        self._valves: dict[str, Samples] = {n: Samples() for n in self._axes}
        self._joysticks: dict[str, Samples] = {n: Samples() for n in self._axes}
        self._by_valve: dict[tuple[int, bool], list[BoundAxis]] = {}
        self._layouts: dict[tuple[int, bool], tuple[Layout, int]] = {}
        for bound in self._axes.values():
            key = bound.valve.message.key[1:]
            self._by_valve.setdefault(key, []).append(bound)
            self._layouts[key] = Layout(bound.valve_message), bound.valve_message.length
        self._curves = {n: a.config.limits.curve() for n, a in self._axes.items()}
        joysticks = list(deployment.joysticks.values()) if deployment else []
        self._joystick_buses = {joystick.key[0] for joystick in joysticks}
        self._finder = InputFinder(deployment.config.buses if deployment else {}, joysticks)

    def receive(self, time_s: float, key: tuple[int, bool], data: bytes) -> None:
        """Take a frame that was received."""
        valves = self._by_valve.get(key)
        if valves:
            layout, length = self._layouts[key]
            if len(data) == length:
                raw: dict[str, Any] = layout.decode(data)
                for bound in valves:
                    if (steps := bound.valve.read(raw)) is not None:
                        part = steps / bound.valve.steps
                        speed = self._speed(bound, part)
                        self._valves[bound.name].add(time_s, speed)
        for bus in self._joystick_buses:  # no one has said which channel of the log it is
            if joystick := self._finder.find(Frame(bus, *key, data), round(time_s * 1e9)):
                self._take_joystick(joystick, time_s, data)

    def _take_joystick(self, joystick: BoundJoystick, time_s: float, data: bytes) -> None:
        _, commands = joystick_commands(joystick, self._axes, data)
        for name, value in commands.items():
            moved = abs(value) > self._axes[name].config.command.neutral_pct / 100.0
            self._joysticks[name].add(time_s, value if moved else 0.0)

    def _speed(self, bound: BoundAxis, command: float) -> float:
        """Speed that the valve gives by the limits of its axis, part of full."""
        if (curve := self._curves[bound.name]) is not None:
            return curve.velocity(command)
        dead = bound.config.limits.deadband_pct / 100.0
        opening = max(0.0, (abs(command) - dead) / (1.0 - dead))
        return opening if command > 0.0 else -opening

    def of(self, axis: str) -> Command | None:
        """Commands of an axis; None where the log has none."""
        return self._of(axis, (self._valves, self._joysticks))

    @staticmethod
    def _of(axis: str, kinds: Sequence[Mapping[str, Samples]]) -> Command | None:
        """Return the command of the first kind that the log has."""
        for kind in kinds:
            if (samples := kind.get(axis)) and samples.value:
                time, speed = samples.arrays()
                return Command(time, speed)
        return None

    def others(self, axis: str) -> list[tuple[float, float]]:
        """Stretches in which other axes are commanded.

        By their joysticks where these are in the log: what a two-axis motion adds makes no swing.
        """
        others = [self._of(n, (self._joysticks, self._valves)) for n in self._axes if n != axis]
        return [part for command in others if command for part in _moving(command)]

    def idle(self) -> list[tuple[float, float]] | None:
        """Stretches in which every axis stands; None where no command is in the log."""
        known = [c for c in (self.of(axis) for axis in self._axes) if c]
        if not known:
            return None
        idle = [(max(float(c.time_s[0]) for c in known), min(float(c.time_s[-1]) for c in known))]
        for command in known:
            idle = _common(idle, _standing(command))
        return idle


def _standing(command: Command) -> list[tuple[float, float]]:
    """Stretches in which a command is known to be zero."""
    return _while(command, np.abs(command.speed[:-1]) < STANDS)


def _moving(command: Command) -> list[tuple[float, float]]:
    """Stretches in which it is known not to be zero."""
    return _while(command, np.abs(command.speed[:-1]) >= STANDS)


def _while(command: Command, is_so: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Stretches in which something is so of a command, and the next one comes soon."""
    time = command.time_s
    known = is_so & (np.diff(time) < _SILENT_S)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], known.astype(int), [0]])))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [(float(time[a]), float(time[b])) for a, b in pairs]


def _common(
    one: list[tuple[float, float]], other: list[tuple[float, float]]
) -> list[tuple[float, float]]:
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


# Of the simulated crane alone: no sensor of a machine reports the swing in both directions.
_OWN = "GrappleSway"
# So many frames hold every message of a bus; the simulated crane sends its own every 20 ms.
_FRAMES = 5000


def is_simulated(log: Path, messages: Messages) -> bool:
    """Whether a log was recorded on a virtual bus, or has what only the simulated crane sends.

    Args:
        log: a CAN log, or a table: that is of a machine.
        messages: of the DBC files.

    Raises:
        LogError: the log cannot be read.
    """
    if is_table(log):
        return False
    message = messages.find(_OWN)
    own = None if isinstance(message, str) else (message[1].frame_id, message[1].is_extended_frame)
    try:
        return any(
            (frame.can_id, frame.extended) == own or _is_virtual(frame.channel)
            for frame in islice(read_log(log), _FRAMES)
        )
    except CutOffError:
        return False


def _is_virtual(channel: str) -> bool:
    """Whether a channel of a log is one of vcan, or the address of a bus over UDP."""
    if channel.startswith(("vcan", "vxcan")):
        return True
    try:
        ip_address(channel)
    except ValueError:
        return False
    return True
