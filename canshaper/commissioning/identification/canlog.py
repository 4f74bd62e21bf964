"""Signals of a CAN log, named by DBC, with the commands in the same log."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from cantools.database.can import Message, Signal

from canshaper.codec.frame import NULL, group_of
from canshaper.codec.layout import Layout, is_j1939
from canshaper.codec.signals import find_signal, special_codes
from canshaper.commissioning.identification.series import (
    Commands,
    Kind,
    Samples,
    Series,
    Unit,
    ordered,
    unit_of,
)
from canshaper.errors import ConfigError, CutOffError, IdentificationError, LogError
from canshaper.inputs.sway_sensor import GOOD_MERIT
from canshaper.machine.database import Messages, load_dbc
from canshaper.machine.deployment import Deployment
from canshaper.recording.log import LogFile
from canshaper.shipped import data_directory


@dataclass
class _Reader:
    """Reader of one signal of a log.

    ``source`` is the address of its sender in J1939, ``merit`` the signal of its figure of merit.
    """

    name: str
    message: Message
    signal: Signal
    unit: Unit
    source: int | None = None
    merit: str | None = None
    samples: Samples = field(default_factory=Samples)
    senders: set[tuple[str, int]] = field(default_factory=set)
    too_short: int = 0
    no_value: int = 0

    def __post_init__(self) -> None:
        self._layout = Layout(self.message)
        self._special = special_codes(self.signal)
        low, high = self.signal.minimum, self.signal.maximum
        bounded = low is not None and high is not None and low < high
        self._low, self._high = (low, high) if bounded else (-math.inf, math.inf)

    def wants(self, can_id: int, extended: bool) -> bool:
        """Return whether an identifier is the message's; of J1939 by sender, with any priority."""
        own = self.message.frame_id
        if extended != self.message.is_extended_frame:
            return False
        if not is_j1939(self.message):
            return can_id == own
        sender = own & 0xFF if self.source is None else self.source
        return group_of(can_id) == group_of(own) and sender in (NULL, can_id & 0xFF)

    def receive(self, time_s: float, sender: tuple[str, int], data: bytes) -> None:
        """Take the value of a frame; count a frame that is too short or has no valid value."""
        self.senders.add(sender)
        if len(data) < self.message.length:
            self.too_short += 1
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
    """Return message, signal and unit of the name "Message.Signal".

    Raises:
        IdentificationError: it is not in the DBC files, or cannot be used.
    """
    message_name, _, signal_name = name.partition(".")
    if not (message_name and signal_name):
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
    names: Mapping[str, str],
    messages: Messages,
    *,
    deployment: Deployment | None = None,
    channel: str | None = None,
    sources: Mapping[str, int | None] | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> dict[str, Series]:
    """Read the signal of each axis from a log; of one that is cut off, what is there.

    Args:
        path: the log.
        names: "Message.Signal" of each axis.
        messages: of the DBC files.
        deployment: names commands, signal of the grapple and figures of merit, where known.
        channel: bus of the log that is read; by default all of them.
        sources: address of the sender of each axis, in J1939; by default that of the DBC.
        on_progress: called with the part that is read, 0 to 1.

    Raises:
        IdentificationError: a signal is wrong (see ``bind``), without a value, or from two senders.
        LogError: the log cannot be read, or has no frame of the channel.
    """
    axes = deployment.axes.values() if deployment else ()
    merits = {s.name: s.config.merit for one in axes if (s := one.sway_sensor)}
    readers = {
        axis: _Reader(name, *bind(name, messages), (sources or {}).get(axis), merits.get(name))
        for axis, name in names.items()
    }
    load = None
    state = deployment.load_state if deployment else None
    if state and (signal := find_signal(state.message, state.config.signal)):
        load = _Reader("load state", state.message, signal, Unit(Kind.OTHER, 1.0, ""))
    commands = Commands(deployment)
    log = LogFile(path, on_progress)
    seen, notes = _read(log, path, channel, [*readers.values(), *filter(None, [load])], commands)
    at = float(np.median(load.samples.value)) if load and load.samples.value else None
    idle = commands.idle()
    result = {}
    for axis, reader in readers.items():
        left_out = _left_out(path, reader, seen, messages)
        time, value = ordered(f"{path}: {reader.name}", *reader.samples.arrays())
        source, texts = f"{path.name}: {reader.name}", [*notes, *left_out]
        own, others = commands.of(axis), commands.others(axis)
        result[axis] = Series(source, reader.unit, time, value, own, idle, others, at, texts)
    return result


Seen = Counter[tuple[int, bool]]  # frames of each identifier


def _read(
    log: LogFile, path: Path, channel: str | None, readers: Sequence[_Reader], commands: Commands
) -> tuple[Seen, list[str]]:
    """Hand every frame to its readers; return how often each identifier came, and notes."""
    readers_of: dict[tuple[int, bool], list[_Reader]] = {}
    seen: Seen = Counter()
    notes: list[str] = []
    first_ns = None
    channels: set[str] = set()
    try:
        for frame in log:
            channels.add(frame.channel)
            if channel is not None and frame.channel != channel:
                continue
            first_ns = frame.time_ns if first_ns is None else first_ns
            time_s = (frame.time_ns - first_ns) / 1e9
            key = frame.can_id, frame.extended
            if key not in seen:
                readers_of[key] = [r for r in readers if r.wants(*key)]
            seen[key] += 1
            for reader in readers_of[key]:
                reader.receive(time_s, (frame.channel, frame.can_id), frame.data)
            commands.receive(time_s, key, frame.data)
    except CutOffError as error:
        notes.append(f"{error}; what stands before it was used")
    notes += log.warnings()
    if channel is not None and not seen:
        there = ", ".join(map(repr, sorted(channels))) or "none"
        raise LogError(f"{path}: expected the bus {channel!r}, got frames of {there}")
    return seen, notes


def _left_out(path: Path, reader: _Reader, seen: Seen, messages: Messages) -> list[str]:
    """Return notes on the values of a signal that were left out.

    Raises:
        IdentificationError: nothing is left, or it is from two senders.
    """
    name, can_id = reader.message.name, reader.message.frame_id
    if not reader.senders:
        there = ", ".join(messages.named(set(seen))) or "none of the DBC files"
        raise IdentificationError(
            f"{path}: expected frames of {name} (id {can_id:#x}),"
            f" got {sum(seen.values())} of {there}. Is it the right log, and the right DBC file?"
        )
    if len(reader.senders) > 1:
        pairs = sorted(reader.senders)
        senders = ", ".join(f"{i:#x}" + (f" on {c}" if c else "") for c, i in pairs)
        raise IdentificationError(
            f"{path}: {name} comes from more than one sender: {senders};"
            " choose a bus with --channel, or give the DBC message the address of one"
        )
    counts = {
        "frames were too short": reader.too_short,
        "values were not available, errors or out of range": reader.no_value,
    }
    notes = [f"{path}: {reader.name}: {n} {why} and left out" for why, n in counts.items() if n]
    if not reader.samples.value:
        raise IdentificationError(f"{notes[0]}; no value is left")
    return notes


def messages_of(files: Sequence[Path], deployment: Deployment | None) -> Messages:
    """Return the messages of DBC files, else of the deployment, else of the shipped forwarder."""
    if not files and deployment:
        return deployment.messages
    paths = files or [data_directory() / "dbc" / "forwarder.dbc"]
    loaded = [load_dbc(path, ()) for path in paths]
    if problems := [fault for _, faults in loaded for fault in faults]:
        raise ConfigError(problems)
    return Messages([one for one, _ in loaded if one])
