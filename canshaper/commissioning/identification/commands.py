"""Commands of the axes in a CAN log: when each was commanded to move, and how fast."""

from array import array
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from canshaper.codec.frame import Frame
from canshaper.codec.layout import Layout
from canshaper.commissioning.identification.series import Array, Command, Span, common, runs
from canshaper.machine.deployment import Deployment
from canshaper.machine.joysticks import BoundJoystick
from canshaper.machine.valves import BoundAxis
from canshaper.recording.channels import InputFinder

# Commands, part of full speed, below which an axis stands.
STANDS = 0.01
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


def valve_part(axis: BoundAxis, layout: Layout, data: bytes) -> float | None:
    """Command in a valve frame, part of full; None for a frame of another length or a wrong one."""
    if len(data) != axis.valve_message.length:
        return None
    steps = axis.valve.read(layout.decode(data))
    return None if steps is None else steps / axis.valve.steps


class Commands:
    """Commands of the axes of a deployment, from valve frames, else from joysticks."""

    def __init__(self, deployment: Deployment | None) -> None:
        self._axes = dict(deployment.axes) if deployment else {}
        self._valves: dict[str, Samples] = defaultdict(Samples)
        self._joysticks: dict[str, Samples] = defaultdict(Samples)
        self._by_valve: dict[tuple[int, bool], list[tuple[BoundAxis, Layout]]] = {}
        for axis in self._axes.values():
            reader = axis, Layout(axis.valve_message)
            self._by_valve.setdefault(axis.valve.message.key[1:], []).append(reader)
        self._limits = {n: a.config.limits.output_limits() for n, a in self._axes.items()}
        joysticks = list(deployment.joysticks.values()) if deployment else []
        self._joystick_buses = {joystick.key[0] for joystick in joysticks}
        self._finder = InputFinder(deployment.config.buses if deployment else {}, joysticks)

    def receive(self, time_s: float, key: tuple[int, bool], data: bytes) -> None:
        """Take a frame that was received."""
        for axis, layout in self._by_valve.get(key, ()):
            if (part := valve_part(axis, layout, data)) is not None:
                self._valves[axis.name].add(time_s, self._limits[axis.name].velocity(part))
        for bus in self._joystick_buses:  # no one has said which channel of the log it is
            if joystick := self._finder.find(Frame(bus, *key, data), round(time_s * 1e9)):
                for name, value in joystick_commands(joystick, self._axes, data)[1].items():
                    moved = abs(value) > self._axes[name].config.command.neutral_pct / 100.0
                    self._joysticks[name].add(time_s, value if moved else 0.0)

    def of(self, axis: str) -> Command | None:
        """Commands of an axis; None where the log has none."""
        return self._first(axis, self._valves, self._joysticks)

    @staticmethod
    def _first(axis: str, *kinds: Mapping[str, Samples]) -> Command | None:
        """Return the command of the first kind that the log has."""
        return next((Command(*kind[axis].arrays()) for kind in kinds if axis in kind), None)

    def others(self, axis: str) -> list[Span]:
        """Stretches in which other axes are commanded.

        By their joysticks where these are in the log: what a two-axis motion adds makes no swing.
        """
        others = [self._first(n, self._joysticks, self._valves) for n in self._axes if n != axis]
        return [span for c in others if c for span in _known(c, np.abs(c.speed) >= STANDS)]

    def idle(self) -> list[Span] | None:
        """Stretches in which every axis stands; None where no command is in the log."""
        known = [c for c in map(self.of, self._axes) if c]
        if not known:
            return None
        idle = [(max(float(c.time_s[0]) for c in known), min(float(c.time_s[-1]) for c in known))]
        for command in known:
            idle = common(idle, _known(command, np.abs(command.speed) < STANDS))
        return idle


def _known(command: Command, is_so: NDArray[np.bool_]) -> list[Span]:
    """Stretches in which something is so of a command, and the next one comes soon."""
    time = command.time_s
    known = is_so[:-1] & (np.diff(time) < _SILENT_S)
    return [(float(time[a]), float(time[b])) for a, b in runs(known)]
