"""Traffic in the log of a step: messages, joysticks, valves and states of the deployment."""

from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from cantools.database.can import Message

from canshaper.codec.frame import Frame
from canshaper.codec.layout import Layout
from canshaper.commissioning import suggest
from canshaper.commissioning.doctor.listen import inputs_of
from canshaper.commissioning.frame_finder import InputFinder
from canshaper.commissioning.identification.commands import Samples, joystick_commands, valve_part
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput, BoundJoystick
from canshaper.machine.valves import BoundAxis
from canshaper.recording.channels import Key
from canshaper.recording.history import History
from canshaper.recording.listen import ReceivedFrame
from canshaper.recording.log import LogFile

# Part of full beyond which a value is a code, not a deflection.
HIGHEST_PART = 1.3


@dataclass
class AxisTraffic:
    """One axis.

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


@dataclass
class Traffic:
    """A log.

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
    frames: dict[Key, list[float]] = field(default_factory=lambda: defaultdict(list))
    inputs: dict[str, list[int]] = field(default_factory=dict)
    axes: dict[str, AxisTraffic] = field(default_factory=dict)
    moved: dict[str, list[float]] = field(default_factory=dict)
    missed_deadlines: int | None = None


class _Reader:
    """Takes the frames of a log."""

    def __init__(self, deployment: Deployment) -> None:
        self.traffic = Traffic(axes={name: AxisTraffic() for name in deployment.axes})
        self._axes = deployment.axes
        named = inputs_of(deployment)
        self._names = {bound.key: name for name, bound in named.items()}
        self.traffic.inputs = {name: [] for name in named}
        self._finder: InputFinder[BoundInput] = InputFinder(deployment.config.buses, named.values())
        self._history = History(deployment)
        self._valves: dict[Key, list[BoundAxis]] = defaultdict(list)
        for axis in deployment.axes.values():
            self._valves[axis.valve.message.key].append(axis)
        self._candidates = {
            (message.frame_id, message.is_extended_frame): (message, Layout(message))
            for message in possible_joysticks(deployment)
        }

    def receive(self, frame: Frame, time_ns: int, time_s: float) -> None:
        """Take a frame that was received."""
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
        self._history.receive(ReceivedFrame(time_ns, frame.bus, "", *frame[1:], ""))
        traffic.missed_deadlines = self._history.counters.get("MissedDeadlines")
        for name, status in self._history.axes.items():
            states = traffic.axes[name].states
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
        """Extremes of its signals that could be a velocity."""
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
    """Messages that are, or look like, those of joysticks, and are nothing else to the machine."""
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


def read_traffic(log: Path, deployment: Deployment) -> Traffic:
    """Read the traffic of a step from its log; its channels are those of the deployment.

    Raises:
        LogError: the log cannot be read.
    """
    reader = _Reader(deployment)
    buses = {bus.channel: name for name, bus in deployment.config.buses.items()}
    first_ns: int | None = None
    for one in LogFile(log) if log.stat().st_size else ():  # nothing was on any bus
        first_ns = one.time_ns if first_ns is None else first_ns
        if bus := buses.get(one.channel):
            frame = Frame(bus, one.can_id, one.extended, one.data)
            reader.receive(frame, one.time_ns, (one.time_ns - first_ns) / 1e9)
    return reader.traffic
