"""Signals of a CAN log, named by DBC, with the commands in the same log."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from cantools.database.can import Message, Signal

from canshaper.codec.identifier import NULL, group_of
from canshaper.codec.layout import Layout, is_j1939
from canshaper.codec.signals import find_signal, special_codes
from canshaper.commissioning.identification.commands import Commands, Samples
from canshaper.commissioning.identification.series import Kind, Series, Unit, ordered, unit_of
from canshaper.errors import CutOffError, IdentificationError, LogError
from canshaper.inputs.sway_sensor import GOOD_MERIT
from canshaper.machine.database import Messages
from canshaper.machine.deployment import Deployment
from canshaper.recording.channels import TimedFrame
from canshaper.recording.log import LogFile


@dataclass
class _Reader:
    """A signal that is looked for in a log; ``merit`` is the signal of its figure of merit."""

    name: str
    message: Message
    signal: Signal
    unit: Unit
    source: int | None = None
    merit: str | None = None
    samples: Samples = field(default_factory=Samples)
    senders: set[tuple[str, int]] = field(default_factory=set)
    wrong_length: int = 0
    no_value: int = 0

    def __post_init__(self) -> None:
        self._layout = Layout(self.message)
        self._special = special_codes(self.signal)
        low, high = self.signal.minimum, self.signal.maximum
        bounded = low is not None and high is not None and low < high
        self._low = float(low) if bounded and low is not None else -math.inf
        self._high = float(high) if bounded and high is not None else math.inf

    def wants(self, can_id: int, extended: bool) -> bool:
        """Whether an identifier is that of its message, of J1939 whatever its priority."""
        if extended != self.message.is_extended_frame:
            return False
        own = self.message.frame_id
        if not is_j1939(self.message):
            return can_id == own
        sender = own & 0xFF if self.source is None else self.source
        return group_of(can_id) == group_of(own) and sender in (NULL, can_id & 0xFF)

    def receive(self, time_s: float, sender: tuple[str, int], data: bytes) -> None:
        """Take a frame that was received."""
        self.senders.add(sender)
        if len(data) < self.message.length:
            self.wrong_length += 1
            return
        values = self._layout.decode(data[: self.message.length])
        raw = values[self.signal.name]
        value = raw * self.signal.scale + self.signal.offset
        poor = self.merit is not None and values[self.merit] != GOOD_MERIT
        if poor or raw in self._special or not self._low <= value <= self._high:
            self.no_value += 1
            return
        self.samples.add(time_s, value * self.unit.factor)


def bind(name: str, messages: Messages) -> tuple[Message, Signal, Unit]:
    """Message, signal and unit of "Message.Signal".

    Raises:
        IdentificationError: it is not in the DBC files, or cannot be used.
    """
    message_name, dot, signal_name = name.partition(".")
    if not (message_name and dot and signal_name):
        raise IdentificationError(f"--signal: expected AXIS=MESSAGE.SIGNAL, got {name!r}")
    entry = messages.find(message_name)
    if isinstance(entry, str):
        raise IdentificationError(f"--signal {name}: {entry}")
    message = entry[1]
    signal = find_signal(message, signal_name)
    if signal is None:
        names = ", ".join(s.name for s in message.signals)
        raise IdentificationError(f"--signal {name}: {message_name} has the signals {names}")
    if message.is_multiplexed():
        raise IdentificationError(f"--signal {name}: multiplexed messages are not read")
    try:
        unit = unit_of(signal.unit or "")
    except IdentificationError as error:
        raise IdentificationError(f"--signal {name}: {error}") from None
    return message, signal, unit


def read_can(
    path: Path,
    label: str,
    names: Mapping[str, str],
    messages: Messages,
    *,
    deployment: Deployment | None = None,
    channel: str | None = None,
    sources: Mapping[str, int | None] | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> dict[str, Series]:
    """Signals of a log by axis.

    Args:
        path: the log.
        label: state of the grapple in it.
        names: "Message.Signal" of each axis.
        messages: of the DBC files.
        deployment: names commands, signal of the grapple and figures of merit, where known.
        channel: bus of the log that is read; by default all of them.
        sources: address of the sender of each axis, in J1939; by default that of the DBC.
        on_progress: called with the part that is read, 0 to 1.

    Raises:
        IdentificationError: a signal is not in the log, or from two senders.
        LogError: the log cannot be read.
    """
    merits = _merits(deployment)
    readers = {
        axis: _Reader(name, *bind(name, messages), (sources or {}).get(axis), merits.get(name))
        for axis, name in names.items()
    }
    grapple = deployment.load_state if deployment else None
    weight = None
    if grapple and (signal := find_signal(grapple.message, grapple.config.signal)):
        weight = _Reader("load state", grapple.message, signal, Unit(Kind.OTHER, 1.0, ""))
    commands = Commands(deployment)
    all_readers = [*readers.values(), *([weight] if weight else [])]
    frames, ids, notes = _read(LogFile(path, on_progress), path, channel, all_readers, commands)
    idle = commands.idle()
    at = float(np.median(weight.samples.arrays()[1])) if weight and weight.samples.value else None
    result = {}
    for axis, reader in readers.items():
        faults = _checked(path, reader, frames, ids, messages)
        time, value = ordered(f"{path}: {reader.name}", *reader.samples.arrays())
        source = f"{path.name}: {reader.name}"
        command = commands.of(axis)
        result[axis] = Series(
            source,
            label,
            reader.unit,
            time,
            value,
            command,
            idle,
            commands.others(axis),
            at,
            [*notes, *faults],
        )
    return result


def _merits(deployment: Deployment | None) -> dict[str, str]:
    """Figure of merit of each "Message.Signal" that a sway sensor of the deployment measures."""
    sensors = [s for a in deployment.axes.values() if (s := a.sway_sensor)] if deployment else []
    return {one.name: one.config.merit for one in sensors if one.config.merit}


def _read(
    log: Iterable[TimedFrame],
    path: Path,
    channel: str | None,
    readers: Sequence[_Reader],
    commands: Commands,
) -> tuple[int, set[tuple[int, bool]], list[str]]:
    """Hand every frame to who reads it: how many there were, of which ids, and what to note."""
    readers_of: dict[tuple[int, bool], list[_Reader]] = {}
    notes: list[str] = []
    frames, first_ns = 0, None
    channels: set[str] = set()
    try:
        for frame in log:
            channels.add(frame.channel)
            if channel is not None and frame.channel != channel:
                continue
            frames += 1
            first_ns = frame.time_ns if first_ns is None else first_ns
            time_s = (frame.time_ns - first_ns) / 1e9
            key = frame.can_id, frame.extended
            if key not in readers_of:
                readers_of[key] = [r for r in readers if r.wants(*key)]
            for reader in readers_of[key]:
                reader.receive(time_s, (frame.channel, frame.can_id), frame.data)
            commands.receive(time_s, key, frame.data)
    except CutOffError as error:
        notes.append(f"{error}; what stands before it was used")
    if channel is not None and not frames:
        raise LogError(f"{path}: expected the bus {channel!r}, got frames of {_listed(channels)}")
    return frames, set(readers_of), notes


def _listed(names: set[str]) -> str:
    return ", ".join(sorted(repr(n) for n in names)) or "none"


def _checked(
    path: Path, reader: _Reader, frames: int, seen: set[tuple[int, bool]], messages: Messages
) -> list[str]:
    """Notes on what was left out of a signal."""
    if not reader.senders:
        there = ", ".join(messages.named(seen)) or "none of the DBC files"
        raise IdentificationError(
            f"{path}: expected frames of {reader.message.name} (id {reader.message.frame_id:#x}),"
            f" got {frames} of {there}. Is it the right log, and the right DBC file?"
        )
    if len(reader.senders) > 1:
        senders = ", ".join(
            f"{i:#x}" + (f" on {c}" if c else "") for c, i in sorted(reader.senders)
        )
        raise IdentificationError(
            f"{path}: {reader.message.name} comes from more than one sender: {senders};"
            " choose a bus with --channel, or give the DBC message the address of one"
        )
    notes = []
    for count, what in (
        (reader.wrong_length, "frames were too short"),
        (reader.no_value, "values were not available, errors or out of range"),
    ):
        if count:
            notes.append(f"{path}: {reader.name}: {count} {what} and left out")
    if not reader.samples.value:
        raise IdentificationError(f"{notes[0]}; no value is left")
    return notes
