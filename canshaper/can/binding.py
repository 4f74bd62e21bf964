"""Deployment file and DBC files brought together: codecs, or every problem at once."""

from dataclasses import dataclass
from pathlib import Path

from cantools.database.can import Message

from canshaper.can.canopen import EMERGENCY, HEARTBEAT
from canshaper.can.codecs import AxisStatusCodec, Sender, ServiceStatusCodec
from canshaper.can.database import Messages
from canshaper.can.inputs import (
    BoundFeedback,
    BoundInput,
    BoundLever,
    BoundRadius,
    BoundStatusWord,
    BoundStop,
)
from canshaper.can.j1939 import CLAIMED, REQUEST, group_of
from canshaper.can.layout import is_j1939
from canshaper.can.load import BusLoad, bus_load
from canshaper.can.signals import status_faults
from canshaper.can.socketcan import Ids
from canshaper.can.valve import ValveCodec
from canshaper.can.valves import ValveBinder
from canshaper.config.filters import RobustFilter
from canshaper.config.load import load_config
from canshaper.config.schema import (
    AxisConfig,
    DeploymentConfig,
    RadialConfig,
    Status,
)
from canshaper.config.source import DeploymentError, Place
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.sway import SwayModel


@dataclass(frozen=True)
class BoundRadial:
    """Radial compensation with the message of its radius, where that is measured."""

    config: RadialConfig
    radius: BoundRadius | None

    @property
    def key(self) -> tuple[str, int, bool] | None:
        """Where the frames of the radius are found."""
        return self.radius.key if self.radius else None


@dataclass(frozen=True)
class BoundAxis:
    """An axis with its valve message and, where it has one, its status message."""

    name: str
    config: AxisConfig
    valve_message: Message
    valve: ValveCodec
    period_ticks: int
    status: AxisStatusCodec | None
    status_ticks: int
    radial: BoundRadial | None = None
    feedback: BoundFeedback | None = None
    status_word: BoundStatusWord | None = None


@dataclass(frozen=True)
class Deployment:
    """Everything the controller needs, checked."""

    path: Path
    config: DeploymentConfig
    messages: Messages
    levers: dict[str, BoundLever]
    axes: dict[str, BoundAxis]
    emergency_stop: BoundStop | None
    status: ServiceStatusCodec | None
    status_ticks: int
    on_bus: dict[str, list[Message]]

    def load(self, bus: str) -> BusLoad | None:
        """Load of a bus by the messages of the deployment; None where its bit rate is not given."""
        bitrate = self.config.buses[bus].bitrate
        return bus_load(self.on_bus.get(bus, []), bitrate) if bitrate else None

    def ids(self, bus: str) -> Ids:
        """Messages that matter on a bus."""
        inputs = [i for i in self.inputs() if i.key[0] == bus]
        radials = [a.radial.key for a in self.axes.values() if a.radial and a.radial.key]
        taken = [i.key for i in inputs if not i.any_source] + radials
        valves = [a.valve.message.sender.key for a in self.axes.values()]
        sent = valves + [s.sender.key for s in (self.status, *self._axis_status()) if s]
        canopen = self.config.buses[bus].canopen
        if canopen:
            nodes = [n.id for n in canopen.nodes.values()]
            taken += [(bus, base + n, False) for n in nodes for base in (HEARTBEAT, EMERGENCY)]
            sent.append((bus, HEARTBEAT + canopen.node, False))
        j1939 = self.config.buses[bus].j1939 is not None
        groups = {group_of(i.key[1]) for i in inputs if i.any_source}
        return Ids(
            frozenset(key[1:] for key in taken if key[0] == bus),
            frozenset(key[1:] for key in sent if key[0] == bus),
            frozenset(key[1:] for key in valves if key[0] == bus),
            frozenset(self.messages.ids()),
            frozenset(groups | ({CLAIMED << 8, REQUEST << 8} if j1939 else set())),
            frozenset(self.sent_groups(bus)),
            j1939,
        )

    def inputs(self) -> list[BoundInput]:
        """Levers, emergency stop, feedback and status words of the valves."""
        axes = self.axes.values()
        told = [i for axis in axes for i in (axis.feedback, axis.status_word)]
        return [*self.levers.values(), *(i for i in (self.emergency_stop, *told) if i)]

    def sent_groups(self, bus: str) -> set[int]:
        """Groups of J1939 that command a valve of ours, from whatever address they come."""
        return {
            group_of(axis.valve.message.sender.key[1])
            for axis in self.axes.values()
            if axis.config.valve.bus == bus and is_j1939(axis.valve_message)
        }

    def _axis_status(self) -> list[AxisStatusCodec | None]:
        return [axis.status for axis in self.axes.values()]


def load_deployment(path: Path) -> Deployment:
    """Load a deployment file with its DBC files.

    Raises:
        DeploymentError: with every problem of all files.
    """
    config, source = load_config(path)
    return _Binder(config, source).deployment(path)


class _Binder(ValveBinder):
    """Binds part by part; with any problem there is no deployment."""

    def deployment(self, path: Path) -> Deployment:
        config = self.config
        self._check_buses()
        self._check_canopen()
        messages = self.load(path.parent)
        if messages is None:
            raise DeploymentError(self.problems)
        levers = {n: self.lever(n, lever) for n, lever in config.levers.items()}
        axes = {n: self._axis(n, axis) for n, axis in config.axes.items()}
        stop = self.stop(config.emergency_stop) if config.emergency_stop else None
        service = self._status(("status",), config.status, ServiceStatusCodec)
        if self.problems:
            raise DeploymentError(self.problems)
        return Deployment(
            path,
            config,
            messages,
            {n: lever for n, lever in levers.items() if lever},
            {n: axis for n, axis in axes.items() if axis},
            stop,
            ServiceStatusCodec(service[0]) if service else None,
            service[1] if service else 0,
            self.on_bus,
        )

    def _check_canopen(self) -> None:
        """Ids of nodes are used once, by no other message."""
        for bus, config in self.config.buses.items():
            canopen = config.canopen
            if canopen is None:
                continue
            ids = {"node": canopen.node} | {f"nodes.{n}": c.id for n, c in canopen.nodes.items()}
            seen: dict[int, str] = {}
            for name, number in ids.items():
                place = ("buses", bus, "canopen", *name.split("."))
                if number in seen:
                    self.add(place, f"has the node id {number} of {seen[number]}")
                seen[number] = name
                for base in (HEARTBEAT, EMERGENCY):
                    self.reserve(bus, base + number, f"buses.{bus}.canopen.{name}")

    def _check_buses(self) -> None:
        seen: dict[tuple[str, str], str] = {}
        for name, bus in self.config.buses.items():
            key = (bus.interface, bus.channel)
            if key in seen:
                self.add(("buses", name), f"has the channel {bus.channel} of bus {seen[key]}")
            seen[key] = name

    def _axis(self, name: str, axis: AxisConfig) -> BoundAxis | None:
        place: Place = ("axes", name)
        before = len(self.problems)
        if axis.stick.lever not in self.config.levers:
            names = ", ".join(self.config.levers)
            self.add((*place, "stick", "lever"), f"found {axis.stick.lever!r}, levers are {names}")
        bound = self.valve((*place, "valve"), axis.valve)
        status = self._status((*place, "status"), axis.status, AxisStatusCodec)
        if bound is None or len(self.problems) > before:
            return None
        message, codec, ticks = bound
        if fault := _filter_fault(axis, ticks * self.config.tick_ms / 1000.0):
            self.add((*place, "filter"), fault)
            return None
        return BoundAxis(
            name,
            axis,
            message,
            codec,
            ticks,
            AxisStatusCodec(status[0]) if status else None,
            status[1] if status else 0,
            self._radial((*place, "radial_compensation"), axis),
            self.feedback((*place, "feedback"), axis.feedback) if axis.feedback else None,
            self.status_word((*place, "valve", "cia408", "status"), axis.valve.cia408.status)
            if axis.valve.cia408
            else None,
        )

    def _radial(self, place: Place, axis: AxisConfig) -> BoundRadial | None:
        config = axis.radial_compensation
        if config is None:
            return None
        target = self.config.axes.get(config.axis)
        if target is None or target is axis:
            others = ", ".join(n for n, a in self.config.axes.items() if a is not axis)
            self.add((*place, "axis"), f"found {config.axis!r}, other axes are {others}")
        elif target.sway is None:
            self.add((*place, "axis"), f"found {config.axis!r}, which has no sway data")
        elif self._cycle(target) != self._cycle(axis):
            self.add((*place, "axis"), f"found {config.axis!r}, whose valve has another cycle")
        else:
            self._asked_once(place, config.axis, axis)
        if axis.sway is None:
            self.add(place, "needs the sway data of its own axis; found no sway")
        radius = config.radius
        if radius is None:
            return BoundRadial(config, None)
        at: Place = (*place, "radius")
        bound = self.radius(at, radius)
        return BoundRadial(config, bound) if bound else None

    def _asked_once(self, place: Place, name: str, axis: AxisConfig) -> None:
        """An axis is asked by one other at most, and by none when it asks itself."""
        for other, config in self.config.axes.items():
            radial = config.radial_compensation
            if radial is None or config is axis:
                continue
            if other == name:
                text = f"found {name!r}, which has a radial compensation itself"
                self.add((*place, "axis"), text)
            elif radial.axis == name:
                self.add((*place, "axis"), f"found {name!r}, which axis {other} uses already")

    def _cycle(self, axis: AxisConfig) -> int | None:
        """Cycle of the axis' valve message; None where there is no such message."""
        found = self.messages.find(axis.valve.message)
        return None if isinstance(found, str) else found[1].cycle_time

    def _status(
        self,
        place: Place,
        status: Status | None,
        codec: type[AxisStatusCodec] | type[ServiceStatusCodec],
    ) -> tuple[Sender, int] | None:
        if status is None:
            return None
        found = self.message(place, status.bus, status.message, takes=False)
        if not found:
            return None
        file, message = found
        faults = status_faults(message, codec.SIGNALS, codec.CODES)
        self.problems += [file.problem(message, fault) for fault in faults]
        ticks = self.period(file, message)
        use = dict.fromkeys(codec.SIGNALS, "a signal of the status")
        protection = self.protection(place, status, message, use)
        return (self.sender(status.bus, message, protection), ticks) if ticks else None


def _filter_fault(axis: AxisConfig, period_s: float) -> str | None:
    """Why the filter cannot run at the period of the valve, or None."""
    chosen = axis.filter
    if isinstance(chosen, RobustFilter) and chosen.tick_ms != round(1000.0 * period_s):
        return (
            f"tick_ms of the taps is {chosen.tick_ms} ms, allowed is the period of the valve,"
            f" {1000.0 * period_s:g} ms"
        )
    try:
        sway = SwayModel(axis.sway.mode(), period_s) if axis.sway else None
        build_shaper(
            chosen.kind,
            period_s,
            sway,
            valve_rate_per_s=axis.limits.slowest_per_s,
            **chosen.parameters(),
        )
    except ValueError as error:
        return str(error)
    return None
