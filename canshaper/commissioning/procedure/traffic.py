"""Traffic in the log of a step: messages, joysticks, valves and states; a drive as a recording."""

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from cantools.database.can import Message

from canshaper.codec.frame import Frame, MessageKey
from canshaper.codec.layout import Layout
from canshaper.commissioning import suggest
from canshaper.commissioning.doctor.joysticks import inputs_of
from canshaper.commissioning.identification.canlog import read_can
from canshaper.commissioning.identification.series import Array, Command, Kind, Samples, Series
from canshaper.errors import IdentificationError
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.machine.joysticks import BoundJoystick
from canshaper.machine.valves import BoundAxis
from canshaper.recording.channels import InputFinder, joystick_commands, valve_part
from canshaper.recording.listen import History, ReceivedFrame
from canshaper.recording.log import LogFile
from canshaper_sim.crane import CraneParameters
from canshaper_sim.recorder import Recorder
from canshaper_sim.recording import AxisTrace, CraneTrace, Recording

# Part of full beyond which a value is a code, not a deflection.
HIGHEST_PART = 1.3


@dataclass
class AxisTraffic:
    """Traffic of one axis; times from the first frame of the log.

    Attributes:
        joystick: its command, [-1, 1].
        enabled: whether the switch in the message of its joystick is on, 0 or 1.
        valve: what the valve frames carried, parts of full command.
        states: (time in s, state, reason) at each change; empty where no status message is there.
    """

    joystick: Samples = field(default_factory=Samples)
    enabled: Samples = field(default_factory=Samples)
    valve: Samples = field(default_factory=Samples)
    states: list[tuple[float, str, str]] = field(default_factory=list)

    @property
    def reach(self) -> tuple[float, float]:
        """Least and largest demand of its joystick."""
        return min(self.joystick.value, default=0.0), max(self.joystick.value, default=0.0)


@dataclass
class Traffic:
    """Messages, axes and moving signals in a log.

    Attributes:
        duration_s: from the first frame to the last one.
        frames: times in s of each message, by bus, id and whether that is extended.
        inputs: times in ns of what the deployment needs, by the names of ``inputs_of``.
        axes: by name.
        moved: least and most of each signal that could be a joystick, parts of full, by
            MESSAGE.SIGNAL.
        missed_deadlines: of the daemon, by its status; None where that is not in the log.
    """

    duration_s: float = 0.0
    frames: dict[MessageKey, list[float]] = field(default_factory=lambda: defaultdict(list))
    inputs: dict[str, list[int]] = field(default_factory=dict)
    axes: dict[str, AxisTraffic] = field(default_factory=dict)
    moved: dict[str, list[float]] = field(default_factory=dict)
    missed_deadlines: int | None = None


class _Reader:
    """Reader of a log, frame by frame."""

    def __init__(self, deployment: Deployment) -> None:
        self.traffic = Traffic(axes={name: AxisTraffic() for name in deployment.axes})
        self._axes = deployment.axes
        named = inputs_of(deployment)
        self._names = {bound.key: name for name, bound in named.items()}
        self.traffic.inputs = {name: [] for name in named}
        self._finder: InputFinder[BoundInput] = InputFinder(deployment.config.buses, named.values())
        self._history = History(deployment)
        self._valves: dict[MessageKey, list[BoundAxis]] = defaultdict(list)
        for axis in deployment.axes.values():
            self._valves[axis.valve.message.key].append(axis)
        self._candidates = {
            (message.frame_id, message.is_extended_frame): (message, Layout(message))
            for message in possible_joysticks(deployment)
        }

    def receive(self, frame: Frame, time_ns: int, time_s: float) -> None:
        """Take a frame into ``traffic``."""
        traffic, key = self.traffic, frame[:3]
        traffic.duration_s = time_s
        traffic.frames[key].append(time_s)
        if bound := self._finder.find(frame, time_ns):
            traffic.inputs[self._names[bound.key]].append(time_ns)
            if isinstance(bound, BoundJoystick):
                self._joystick(bound, time_s, frame.data)
        for axis in self._valves.get(key, ()):
            if (part := valve_part(axis, Layout(axis.valve_message), frame.data)) is not None:
                traffic.axes[axis.name].valve.add(time_s, part)
        name = self._history.receive(ReceivedFrame(time_ns, frame.bus, "", *frame[1:], ""))
        traffic.missed_deadlines = self._history.counters.get("MissedDeadlines")
        if name:
            states, status = traffic.axes[name].states, self._history.axes[name]
            if not states or states[-1][1:] != (status.state, status.reason):
                states.append((time_s, status.state, status.reason))
        if candidate := self._candidates.get(key[1:]):
            self._move(*candidate, frame.data)

    def _joystick(self, bound: BoundJoystick, time_s: float, data: bytes) -> None:
        raw, commands = joystick_commands(bound, self._axes, data)
        for name, value in commands.items():
            self.traffic.axes[name].joystick.add(time_s, value)
            if bound.enable:
                self.traffic.axes[name].enabled.add(time_s, float(raw[bound.enable] == 1))

    def _move(self, message: Message, layout: Layout, data: bytes) -> None:
        """Note the extremes of the signals of a message that may be a velocity."""
        if len(data) != message.length:
            return
        raw = layout.decode(data)
        for signal in suggest.velocities(message):
            part = (raw[signal.name] * signal.scale + signal.offset) / suggest.likely_full(signal)
            if abs(part) <= HIGHEST_PART:  # beyond it are codes for errors
                extremes = self.traffic.moved.setdefault(
                    f"{message.name}.{signal.name}", [part, part]
                )
                extremes[:] = min(extremes[0], part), max(extremes[1], part)


def possible_joysticks(deployment: Deployment) -> list[Message]:
    """Return the joysticks' messages, and unused ones with a velocity and a switch."""
    own = [joystick.message for joystick in deployment.joysticks.values()]
    used = {bound.message.name for bound in deployment.inputs()}
    used |= {axis.valve_message.name for axis in deployment.axes.values()}
    used |= {message.name for message in own}
    others = [
        message
        for message in deployment.messages.all()
        if message.name not in used and not suggest.is_status(message)
    ]
    return own + [m for m in others if suggest.axes(m) and suggest.switches(m)]


def _frames(log: Path, deployment: Deployment) -> Iterator[tuple[int, int, Frame]]:
    """Yield the frames of a log with their time and that of the first one, ns.

    Channels are those of the deployment; frames of others are left out.
    """
    buses = {bus.channel: name for name, bus in deployment.config.buses.items()}
    first_ns: int | None = None
    for one in LogFile(log) if log.stat().st_size else ():  # nothing was on any bus
        first_ns = one.time_ns if first_ns is None else first_ns
        if bus := buses.get(one.channel):
            yield one.time_ns, first_ns, Frame(bus, one.can_id, one.extended, one.data)


def read_traffic(log: Path, deployment: Deployment) -> Traffic:
    """Read the traffic of a step from its log.

    Raises:
        LogError: the log cannot be read.
    """
    reader = _Reader(deployment)
    for time_ns, first_ns, frame in _frames(log, deployment):
        reader.receive(frame, time_ns, (time_ns - first_ns) / 1e9)
    return reader.traffic


MOST_SILENT_S = 0.5  # a fifth of the swing of most grapples


def simulated_recording(
    log: Path, deployment: Deployment, parameters: CraneParameters
) -> Recording:
    """Return the recording of a drive of the simulated crane, out of its messages.

    Raises:
        LogError: the log cannot be read.
    """
    recorder = Recorder(deployment, parameters)
    for time_ns, _, frame in _frames(log, deployment):
        recorder.receive(frame, time_ns / 1e9)
    return recorder.recording()


def machine_recording(log: Path, deployment: Deployment, signals: Mapping[str, str]) -> Recording:
    """Return the recording of a drive of a machine, with the signals that show its swing.

    An axis counts as moving with the speed that its valve was sent. A rate becomes an angle by the
    period of the swing. The total swing is that of all signals; the place of the tip is not known.

    Args:
        log: of the drive.
        deployment: the machine.
        signals: MESSAGE.SIGNAL of the swing by axis, at least one; axes may share one.

    Raises:
        IdentificationError: a signal is not in the log, shows no angle and no rate, or was silent.
        LogError: the log cannot be read.
    """
    sensors = {name: s for name in signals if (s := deployment.axes[name].sway_sensor)}
    sources = {n: one.config.source for n, one in sensors.items() if one.name == signals[n]}
    swings = read_can(log, signals, deployment.messages, deployment=deployment, sources=sources)
    traffic = read_traffic(log, deployment)
    time_s = next(iter(swings.values())).time_s
    planes: dict[str, list[float]] = {}
    axes = {}
    for name, axis in traffic.axes.items():
        sent = swings[name].command if name in swings else None
        velocity = (sent or Command(*axis.valve.arrays())).at(time_s).tolist()
        joystick = Command(*axis.joystick.arrays()).at(time_s)
        sway = None
        if name in swings:
            _check_complete(name, swings[name], traffic.duration_s)
            sway = planes[signals[name]] = _angle_deg(deployment, name, swings[name], time_s)
        axes[name] = AxisTrace(joystick.tolist(), velocity, velocity, sway)
    begin_s = float(time_s[0])
    total = [math.hypot(*angles) for angles in zip(*planes.values(), strict=True)]
    crane = CraneTrace([], [], total)
    return Recording([float(value) - begin_s for value in time_s], axes, crane)


def _check_complete(name: str, series: Series, duration_s: float) -> None:
    """Check that the sensor was never silent: in a gap no swing would show.

    Raises:
        IdentificationError: it has a gap.
    """
    edges = np.concatenate(([0.0], series.time_s, [duration_s]))
    number = int(np.argmax(np.diff(edges)))
    gap_s = float(edges[number + 1] - edges[number])
    if gap_s > MOST_SILENT_S:
        text = f"{series.source}: no value for {gap_s:.1f} s from {edges[number]:.1f} s on"
        remedy = "is the sensor on, and the swing within its range? Do it again"
        raise IdentificationError(f"{name}: {text}: {remedy}")


def _angle_deg(deployment: Deployment, name: str, series: Series, at_s: Array) -> list[float]:
    if series.unit.kind is Kind.OTHER:
        got = series.unit.text or "no unit"
        text = f"{series.source}: expected an angle or its rate, got {got}"
        raise IdentificationError(f"{name}: {text}; nothing else is compared in degrees")
    value = series.value - np.median(series.value)
    sway = deployment.axes[name].config.sway
    if series.unit.kind is Kind.RATE and sway:
        value = value * sway.mode().period_s / (2.0 * math.pi)
    return [math.degrees(v) for v in np.interp(at_s, series.time_s, value)]
