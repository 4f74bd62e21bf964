"""Deployment file and DBC files brought together: codecs, or every problem at once."""

from dataclasses import dataclass, field
from pathlib import Path

from cantools.database.can import Message, Signal

from canshaper.can.codecs import (
    AxisStatusCodec,
    LeverCodec,
    Sender,
    ServiceStatusCodec,
    ValveCodec,
    valve_steps,
)
from canshaper.can.database import DbcFile, Messages, load_dbc
from canshaper.can.signals import VelocitySignal, find_signal, symmetrical_range
from canshaper.config.load import load_config
from canshaper.config.schema import AxisConfig, DeploymentConfig, Lever, Status, Valve
from canshaper.config.source import DeploymentError, Place, Problem, Source


@dataclass(frozen=True)
class BoundLever:
    """A lever with its message; ``key`` is (bus, id, extended)."""

    name: str
    config: Lever
    message: Message
    codec: LeverCodec

    @property
    def key(self) -> tuple[str, int, bool]:
        """Where its frames are found."""
        return self.config.bus, self.message.frame_id, self.message.is_extended_frame


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


@dataclass(frozen=True)
class Deployment:
    """Everything the controller needs, checked."""

    path: Path
    config: DeploymentConfig
    messages: Messages
    levers: dict[str, BoundLever]
    axes: dict[str, BoundAxis]
    status: ServiceStatusCodec | None
    status_ticks: int


def load_deployment(path: Path) -> Deployment:
    """Load a deployment file with its DBC files.

    Raises:
        DeploymentError: with every problem of all files.
    """
    config, source = load_config(path)
    return _Binder(path, config, source).deployment()


@dataclass
class _Binder:
    """Collects problems while binding, so that all are told at once."""

    path: Path
    config: DeploymentConfig
    source: Source
    problems: list[Problem] = field(default_factory=list)
    messages: Messages | None = None
    _used: dict[tuple[str, int, bool], str] = field(default_factory=dict)

    def deployment(self) -> Deployment:
        config = self.config
        self._check_buses()
        self._load_files()
        if self.messages is None:
            raise DeploymentError(self.problems)
        levers = {n: self._lever(n, lever) for n, lever in config.levers.items()}
        axes = {n: self._axis(n, axis) for n, axis in config.axes.items()}
        service = self._status(("status",), config.status, ServiceStatusCodec.SIGNALS)
        if self.problems:
            raise DeploymentError(self.problems)
        return Deployment(
            self.path,
            config,
            self.messages,
            {n: lever for n, lever in levers.items() if lever},
            {n: axis for n, axis in axes.items() if axis},
            ServiceStatusCodec(service[0]) if service else None,
            service[1] if service else 0,
        )

    def _check_buses(self) -> None:
        seen: dict[tuple[str, str], str] = {}
        for name, bus in self.config.buses.items():
            key = (bus.interface, bus.channel)
            if key in seen:
                self._add(("buses", name), f"has the channel {bus.channel} of bus {seen[key]}")
            seen[key] = name

    def _load_files(self) -> None:
        """Load the DBC files; when one is none, its messages are not missed one by one too."""
        files = []
        for i, name in enumerate(self.config.dbc):
            file, problems = load_dbc(self.path.parent / name)
            self.problems += problems
            if file:
                files.append(file)
            else:
                self._add(("dbc", i), f"found {name!r}, which is no DBC file that can be used")
        if len(files) == len(self.config.dbc):
            self.messages = Messages(files)

    def _lever(self, name: str, lever: Lever) -> BoundLever | None:
        place: Place = ("levers", name)
        found = self._message(place, lever.bus, lever.message, takes=True)
        if not found:
            return None
        file, message = found
        before = len(self.problems)
        for key in ("enable", "reset", "anti_sway_off", "alive_counter"):
            self._signal((*place, key), message, getattr(lever, key))
        cycle = message.cycle_time
        if not cycle:
            self.problems.append(file.problem(message, "has no GenMsgCycleTime"))
        elif lever.timeout_ms < 2 * cycle:
            self._add(
                (*place, "timeout_ms"),
                f"found {lever.timeout_ms}, allowed is {2 * cycle} ms or more:"
                f" twice the cycle of {lever.message}",
            )
        velocities = []
        for axis_name, axis in self.config.axes.items():
            if axis.stick.lever == name:
                at = ("axes", axis_name, "stick", "signal")
                signal = self._signal(at, message, axis.stick.signal)
                if signal and self._full_scale(file, message, signal):
                    velocities.append(VelocitySignal.of(signal))
        if len(self.problems) > before:
            return None
        return BoundLever(name, lever, message, LeverCodec(message, velocities))

    def _axis(self, name: str, axis: AxisConfig) -> BoundAxis | None:
        place: Place = ("axes", name)
        before = len(self.problems)
        if axis.stick.lever not in self.config.levers:
            names = ", ".join(self.config.levers)
            self._add((*place, "stick", "lever"), f"found {axis.stick.lever!r}, levers are {names}")
        bound = self._valve((*place, "valve"), axis.valve)
        status = self._status((*place, "status"), axis.status, AxisStatusCodec.SIGNALS)
        if bound is None or len(self.problems) > before:
            return None
        message, codec, ticks = bound
        return BoundAxis(
            name,
            axis,
            message,
            codec,
            ticks,
            AxisStatusCodec(status[0]) if status else None,
            status[1] if status else 0,
        )

    def _valve(self, place: Place, valve: Valve) -> tuple[Message, ValveCodec, int] | None:
        found = self._message(place, valve.bus, valve.message, takes=False)
        if not found:
            return None
        file, message = found
        ticks = self._period(file, message)
        signal = self._signal((*place, "signal"), message, valve.signal)
        self._signal((*place, "alive_counter"), message, valve.alive_counter)
        if not signal or not ticks or not self._full_scale(file, message, signal):
            return None
        if signal.is_float:
            self._add((*place, "signal"), f"{signal.name} is a float, allowed is an integer signal")
            return None
        if valve_steps(signal.maximum or 0.0, abs(signal.scale)) < 10:
            text = f"{signal.name} has fewer than 10 steps to full command"
            self.problems.append(file.problem(message, text))
            return None
        return (
            message,
            ValveCodec(Sender(valve.bus, message), signal.name, valve.alive_counter),
            ticks,
        )

    def _status(
        self, place: Place, status: Status | None, signals: tuple[str, ...]
    ) -> tuple[Sender, int] | None:
        if status is None:
            return None
        found = self._message(place, status.bus, status.message, takes=False)
        if not found:
            return None
        file, message = found
        missing = [s for s in signals if not find_signal(message, s)]
        if missing:
            self.problems.append(file.problem(message, f"lacks the signals {', '.join(missing)}"))
        ticks = self._period(file, message)
        return (Sender(status.bus, message), ticks) if ticks else None

    def _message(
        self, place: Place, bus: str, name: str, *, takes: bool
    ) -> tuple[DbcFile, Message] | None:
        """The message; noted as used on that bus, where no other part may use it."""
        if bus not in self.config.buses:
            self._add((*place, "bus"), f"found {bus!r}, buses are {', '.join(self.config.buses)}")
        assert self.messages is not None
        found = self.messages.find(name)
        if isinstance(found, str):
            self._add((*place, "message"), found)
            return None
        message = found[1]
        where = ".".join(str(p) for p in place)
        key = (bus, message.frame_id, message.is_extended_frame)
        if key in self._used:
            self._add(
                (*place, "message"),
                f"{name} has the id {message.frame_id:#x} on bus {bus}, which is used already"
                f" by {self._used[key]}",
            )
        self._used[key] = where
        if message.length > 8:
            self._add((*place, "message"), f"{name} has {message.length} bytes, allowed are 8")
        if message.is_multiplexed():
            verb = "taken from" if takes else "sent in"
            self._add((*place, "message"), f"{name} is multiplexed; nothing can be {verb} it")
        return found

    def _signal(self, place: Place, message: Message, name: str | None) -> Signal | None:
        if name is None:
            return None
        signal = find_signal(message, name)
        if signal is None:
            names = ", ".join(s.name for s in message.signals)
            self._add(place, f"found {name!r}, signals of {message.name} are {names}")
        return signal

    def _full_scale(self, file: DbcFile, message: Message, signal: Signal) -> bool:
        why = symmetrical_range(signal)
        if why:
            self.problems.append(file.problem(message, why))
        return not why

    def _period(self, file: DbcFile, message: Message) -> int:
        """Ticks between two sendings of a message, from its GenMsgCycleTime; 0 when impossible."""
        cycle, tick = message.cycle_time, self.config.tick_ms
        if not cycle or cycle % tick:
            found = f"GenMsgCycleTime {cycle} ms" if cycle else "no GenMsgCycleTime"
            text = f"has {found}, allowed is a multiple of tick_ms, {tick} ms"
            self.problems.append(file.problem(message, text))
            return 0
        return cycle // tick

    def _add(self, place: Place, text: str) -> None:
        self.problems.append(self.source.problem(place, text))
