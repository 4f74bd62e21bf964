"""Frames of a log, the buses of its channels, and the input that each frame belongs to."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from canshaper.codec.frame import Frame, FrameFault, MessageKey, group_of
from canshaper.codec.layout import Layout
from canshaper.config.bus import Bus
from canshaper.errors import CutOffError, LogError
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.machine.joysticks import BoundJoystick
from canshaper.machine.valves import BoundAxis
from canshaper.protocols.j1939.groups import AnySource, ReceivedGroup


class Kind(Enum):
    """Meaning of a frame on the bus for the daemon of a deployment."""

    RECEIVED = "received"
    """The frame waits in the first socket, and is read before the valves have their frames."""
    OTHER = "other"
    """The frame is seen too, after the valves have their frames."""
    SENT = "sent"
    """The daemon sends such frames."""
    IGNORED = "ignored"
    """The daemon does not see it."""


def bus_of_channel(
    deployment: Deployment, channels: Collection[str], given: Mapping[str, str]
) -> dict[str, str]:
    """Return bus by channel of a log, without the channels that belong to no bus.

    Args:
        deployment: the machine.
        channels: channels of the log.
        given: channel by bus from the command line. For other buses the function tries the
            deployment's own channel, then the name of the bus; for a single bus, the only channel.

    Raises:
        LogError: a bus has no channel in the log, or two buses have the same channel.
    """
    buses = deployment.config.buses
    chosen: dict[str, str] = {}
    for name, bus in buses.items():
        named = given.get(name)
        tries = [named] if named is not None else [bus.channel, name]
        if named is None and len(channels) == 1 and len(buses) == 1:
            tries += channels
        channel = next((c for c in tries if c in channels), None)
        names = ", ".join(repr(c) for c in sorted(channels)) or "none"
        if channel is None:
            text = f"bus {name}: expected the channel {tries[0]!r}, got {names} in the log"
            raise LogError(f"{text}; choose one of them with --channel {name}=CHANNEL")
        if channel in chosen:
            text = f"bus {name}: expected a channel of its own, got {channel!r}, that of bus"
            raise LogError(f"{text} {chosen[channel]}; choose one with --channel {name}=CHANNEL")
        chosen[channel] = name
    return chosen


class Sorter:
    """Sorts frames by their ``Kind`` for a deployment; it judges each id once."""

    def __init__(self, deployment: Deployment) -> None:
        self._buses = deployment.routing.buses
        # Other interfaces hand out all there is before the valves have their frames.
        self._raw = {n: b.interface == "socketcan" for n, b in deployment.config.buses.items()}
        # This message carries the digest of the recording program, which may be another one.
        identity = deployment.identity_status
        self._kinds = {identity.message.key: Kind.IGNORED} if identity else {}

    def kind(self, key: MessageKey) -> Kind:
        """Return the kind of a frame by its key: bus, id and whether the id is extended."""
        kind = self._kinds.get(key)
        if kind is None:
            kind = self._kinds[key] = self._judge(key)
        return kind

    def _judge(self, key: MessageKey) -> Kind:
        bus, message = key[0], key[1:]
        ids = self._buses[bus]
        if message in ids.sent or message in ids.claims:
            return Kind.SENT
        group = group_of(message[0]) if message[1] else -1
        if message in ids.received or group in ids.received_groups:
            return Kind.RECEIVED
        if group not in ids.sent_groups and (message in ids.known or (message[1] and ids.j1939)):
            return Kind.IGNORED
        return Kind.OTHER if self._raw[bus] else Kind.RECEIVED


# Later than any clock, from 1970 or from the start of the log: the year 2286.
LATEST_S = 10_000_000_000
MOST_BYTES = 64  # in a frame; a frame with more than 8 is one of CAN FD


class TimedFrame(NamedTuple):
    """A data frame with the time of its reception.

    Attributes:
        time_ns: on the clock of the log, whatever its origin.
        channel: name of the channel in the log; empty if the format has no channels.
        can_id: 11 or 29 bits.
        extended: the id has 29 bits.
        data: up to 8 bytes, of CAN FD up to 64.
    """

    time_ns: int
    channel: str
    can_id: int
    extended: bool
    data: bytes


def fits(can_id: int, *, extended: bool) -> bool:
    """Return whether an id fits into 11 bits, or 29 if it is extended."""
    return can_id < 1 << (29 if extended else 11)


@dataclass
class Place:
    """Position of the reader in a log, for messages, and counts of what it has left out.

    Attributes:
        path: the log.
        unit: name of what ``number`` counts: line or frame.
        number: number of the present line or frame, from 1.
        left_out: number of left-out frames and lines by kind, such as "remote", "impossible".
        notes: other things that a person must know about the log.
    """

    path: Path
    unit: str = "line"
    number: int = 0
    left_out: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    def error(self, got: str, expected: str) -> LogError:
        """Return an error at this place of the log."""
        return LogError(f"{self}: expected {expected}, got {got}")

    def cut_off(self, reason: str) -> CutOffError:
        """Return an error for a log that ends here, within a line or frame."""
        return CutOffError(f"{self}: the log is cut off: {reason}")

    def checked(self, frame: TimedFrame, length: int) -> TimedFrame:
        """Return the frame; raise LogError for another length or an id that does not fit."""
        if len(frame.data) != length or length > MOST_BYTES:
            expected = "all of them" if length <= MOST_BYTES else f"{MOST_BYTES} at most"
            raise self.error(f"{len(frame.data)} of {length} bytes", expected)
        if not fits(frame.can_id, extended=frame.extended):
            expected = "an id of 11 bits, or of an extended frame of 29"
            raise self.error(f"id {frame.can_id:#x}", expected)
        return frame

    def __str__(self) -> str:
        if not self.number:  # nothing is read yet: it is about the whole file
            return str(self.path)
        if self.unit == "line":
            return f"{self.path}:{self.number}"
        return f"{self.path}: {self.unit} {self.number}"


_Input = TypeVar("_Input", bound=BoundInput)


class InputFinder(Generic[_Input]):
    """Finds the input of a frame by its identifier; for J1939 by group and source, at any priority.

    If a message may come from any address, the finder uses the first sender until it is silent for
    ``timeout_ms``; frames of other senders have no input.

    Args:
        buses: buses of the machine by name.
        inputs: the inputs to find.
    """

    def __init__(self, buses: Mapping[str, Bus], inputs: Iterable[_Input]) -> None:
        self._by_key: dict[MessageKey, _Input] = {}
        self._by_group: dict[tuple[str, int], ReceivedGroup] = {}
        self._input: _Input | None = None
        for bound in inputs:
            if not bound.by_group:
                self._by_key |= dict.fromkeys(bound.keys, bound)
                continue
            bus, can_id, _ = bound.key
            node = buses[bus].j1939
            own = node.address if node else None
            group = self._by_group.setdefault((bus, group_of(can_id)), ReceivedGroup(own))
            noted = _Noted(self, bound)
            if bound.any_source:
                timeout_ns = bound.config.timeout_ms * 1_000_000
                group.rest = AnySource(bus, bound.message.name, noted, timeout_ns)
            else:
                group.of[can_id & 0xFF] = noted

    def find(self, frame: Frame, now_ns: int) -> _Input | None:
        """Return the input of a frame, or None; ``now_ns`` is its arrival on any clock."""
        if (bound := self._by_key.get(frame[:3])) is not None:
            return bound
        self._input = None
        if frame.extended and (group := self._by_group.get((frame.bus, group_of(frame.can_id)))):
            group.receive(frame, now_ns)
        return self._input

    def note(self, bound: _Input) -> None:
        """Note that the present frame belongs to this input."""
        self._input = bound


class _Noted(Generic[_Input]):
    """Stands for an input in a J1939 group: notes that the frame belongs to it, keeps no state."""

    def __init__(self, finder: InputFinder[_Input], bound: _Input) -> None:
        self._finder = finder
        self._bound = bound

    def receive(self, _data: bytes, _arrived_ns: int, /) -> FrameFault:
        """Note this input as that of the frame."""
        self._finder.note(self._bound)
        return FrameFault.NONE

    def invalidate(self) -> None:
        """Do nothing: no state is kept."""


def joystick_commands(
    joystick: BoundJoystick, axes: Mapping[str, BoundAxis], data: bytes
) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the raw values by signal in a joystick's frame, and the demands by axis, -1 to 1.

    Both are empty for a frame of another length; an axis with an invalid demand is left out.
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
    """Return the setpoint in a valve frame, -1 to 1; None for a wrong length or no valid value."""
    if len(data) != axis.valve_message.length:
        return None
    steps = axis.valve.read(layout.decode(data))
    return None if steps is None else steps / axis.valve.steps
