"""Read-only access to the buses of a deployment, and the history of its status messages.

This module cannot send.
"""

import select
import socket
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any, NamedTuple

import can

from canshaper.bus.packet import (
    ANCILLARY_BYTES,
    BRS,
    FD_SIZE,
    FDF,
    SO_TIMESTAMPNS,
    stamp_ns,
    unpack,
)
from canshaper.bus.port import not_opened
from canshaper.bus.python_can import MOST_FAILURES, open_python_can, waiting
from canshaper.bus.socketcan import dropped_frames, open_sockets
from canshaper.codec.frame import EFF_MASK, ERR_FLAG, RTR_FLAG, MessageKey, id_of
from canshaper.codec.status import LAST_FAULT, StatusCodec
from canshaper.config.bus import Bus
from canshaper.errors import BusError
from canshaper.machine.deployment import Deployment

# Frames read from one bus before the next one has its turn.
MOST_AT_ONCE = 2000
# After this many errors in a row, without a frame or silence between them, the bus is gone.
MOST_ERRORS = 10 * MOST_FAILURES
# A signal that asks us to end must not wait for the next frame.
LOOK_S = 0.2
# Polling period of an interface without a file descriptor, s.
POLL_S = 0.01


class ReceivedFrame(NamedTuple):
    """One frame, as it was received.

    Attributes:
        time_ns: wall clock, of the kernel if it can; of python-can the stamp of its interface; of a
            simulated or replayed frame its time in the drive.
        bus: name of the bus in the deployment.
        channel: channel of the bus.
        can_id: id, with the error flag of SocketCAN for an error frame.
        extended: the id has 29 bits, or is an error class.
        data: bytes of the frame.
        kind: empty for a data frame, else "remote" or "error".
        flags: flags of a CAN FD frame, as in SocketCAN; None for a classical frame.
    """

    time_ns: int
    bus: str
    channel: str
    can_id: int
    extended: bool
    data: bytes
    kind: str
    flags: int | None = None

    def line(self) -> str:
        """Return the line that ``candump -L`` writes for the frame, with its line end."""
        seconds, ns = divmod(self.time_ns, 10**9)
        can_id = f"{self.can_id:08X}" if self.extended else f"{self.can_id:03X}"
        data = "R" if self.kind == "remote" else self.data.hex().upper()
        if self.flags is not None:
            data = f"#{self.flags & 0xF:X}{data}"
        return f"({seconds}.{ns // 1000:06d}) {self.channel} {can_id}#{data}\n"


class Listener:
    """Opens buses and reads their frames.

    Args:
        buses: (name, bus) of each.

    Attributes:
        lost: number of frames that the kernel dropped before they were read.
        errors: number of errors that interfaces of python-can raised in place of a frame, by bus.
        last_error: text of the last error, with its bus.

    Raises:
        BusError: a bus cannot be opened.
    """

    def __init__(self, buses: Iterable[tuple[str, Bus]]) -> None:
        self.lost, self.last_error = 0, ""
        self.errors: Counter[str] = Counter()
        self._failing: Counter[str] = Counter()  # errors since the last frame, by bus
        self._sockets: dict[Any, tuple[str, str]] = {}
        self._files: list[Any] = []
        for name, bus in buses:
            try:
                self._open(name, bus)
            except Exception as error:  # each interface raises its own kinds
                self.close()
                raise not_opened(name, bus, error) from error

    def _open(self, name: str, bus: Bus) -> None:
        if bus.interface == "socketcan":
            (one,) = open_sockets(bus, None)
            one.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            self._sockets[one] = name, bus.channel
            self._files.append(one)
            return
        opened = open_python_can(bus)
        self._sockets[opened] = name, bus.channel
        with suppress(Exception):  # not every interface has one
            if opened.fileno() >= 0:
                self._files.append(opened)

    def frames(self, timeout_s: float = LOOK_S) -> list[ReceivedFrame]:
        """Return the waiting frames by time, at most ``MOST_AT_ONCE`` of each bus.

        It waits for the first one for up to ``timeout_s`` seconds; for ``POLL_S`` if a bus has no
        file descriptor to wait for.

        Raises:
            BusError: a bus can no longer be read.
        """
        all_have_files = len(self._files) == len(self._sockets)
        try:
            select.select(self._files, [], [], timeout_s if all_have_files else POLL_S)
        except (OSError, ValueError) as error:
            raise BusError(f"cannot read: {error}") from error
        received: list[ReceivedFrame] = []
        for one, (name, channel) in self._sockets.items():
            read = _raw if isinstance(one, socket.socket) else self._python_can
            try:
                received += islice(read(one, name, channel), MOST_AT_ONCE)
            except (OSError, can.CanError) as error:
                text = getattr(error, "strerror", None) or str(error)
                raise BusError(f"bus {name}: cannot read {channel}: {text}") from error
        raw = [one for one in self._sockets if isinstance(one, socket.socket)]
        self.lost = dropped_frames(raw)
        received.sort(key=lambda frame: frame.time_ns)
        return received

    def _python_can(self, one: can.BusABC, name: str, channel: str) -> Iterator[ReceivedFrame]:
        """Yield the frames of a python-can bus; count errors, raise at ``MOST_ERRORS`` in a row."""
        for message in waiting(one, MOST_AT_ONCE):
            if not isinstance(message, Exception):
                self._failing[name] = 0
                if message is not None:
                    yield _python_can(message, name, channel)
                continue
            self.errors[name] += 1
            self._failing[name] += 1
            self.last_error = f"bus {name}: {type(message).__name__} {message}".rstrip()
            if self._failing[name] == MOST_ERRORS:
                raise can.CanOperationError(getattr(message, "strerror", None) or str(message))

    def close(self) -> None:
        """Close the buses."""
        for one in self._sockets:
            with suppress(Exception):  # each interface raises its own kinds
                one.close() if isinstance(one, socket.socket) else one.shutdown()
        self._sockets.clear()
        self._files.clear()


def _raw(one: socket.socket, bus: str, channel: str) -> Iterator[ReceivedFrame]:
    """Yield the waiting frames of a SocketCAN socket."""
    with suppress(BlockingIOError):
        while True:
            packet, ancillary, _, _ = one.recvmsg(FD_SIZE, ANCILLARY_BYTES)
            if (parts := unpack(packet)) is None:
                continue
            stamp = stamp_ns(ancillary)
            time_ns = time.time_ns() if stamp is None else stamp
            word, data, flags = parts
            if word & ERR_FLAG:
                can_id = ERR_FLAG | word & EFF_MASK
                yield ReceivedFrame(time_ns, bus, channel, can_id, True, data, "error")
                continue
            kind = "remote" if word & RTR_FLAG else ""
            yield ReceivedFrame(time_ns, bus, channel, *id_of(word), data, kind, flags)


def _python_can(message: can.Message, bus: str, channel: str) -> ReceivedFrame:
    """Return the frame in a message of python-can."""
    time_ns = round(message.timestamp * 1e6) * 1000
    can_id, extended, kind = message.arbitration_id, message.is_extended_id, ""
    flags = None
    if message.is_error_frame:
        can_id, extended, kind = ERR_FLAG | can_id, True, "error"
    elif message.is_remote_frame:
        kind = "remote"
    elif message.is_fd:
        flags = FDF | (BRS if message.bitrate_switch else 0)
    return ReceivedFrame(time_ns, bus, channel, can_id, extended, bytes(message.data), kind, flags)


@dataclass(frozen=True, slots=True)
class AxisStatus:
    """Status of one axis, as received.

    Attributes:
        time_ns: time of reception.
        values: decoded fields by name.
        shown: the same fields as texts for people.
    """

    time_ns: int
    values: dict[str, Any]
    shown: dict[str, str]

    @property
    def state(self) -> str:
        """Name of the state, or its number if it is unknown."""
        return self.shown["State"]

    @property
    def reason(self) -> str:
        """Name of the reason, or its number if it is unknown."""
        return self.shown["Reason"]


@dataclass(frozen=True, slots=True)
class HistoryEvent:
    """One line for people: a new state or reason, or a changed counter."""

    time_ns: int
    text: str


class History:
    """Takes frames; keeps the last status of each axis and of the service, and notes changes.

    Attributes:
        axes: last status by axis.
        counters: last counters of the service by name.
        last_fault: name of the service's last fault.
        counted_ns: time of the last counters; None before the first.
        changes: the first ``MOST_CHANGES`` changes, oldest first; later ones are dropped.
    """

    MOST_CHANGES = 100_000

    def __init__(self, deployment: Deployment) -> None:
        self.axes: dict[str, AxisStatus] = {}
        self.counters: dict[str, int] = {}
        self.last_fault = ""
        self.counted_ns: int | None = None
        self.changes: list[HistoryEvent] = []
        self._axes = {a.status.message.key: n for n, a in deployment.axes.items() if a.status}
        self._codecs: dict[MessageKey, StatusCodec[Any]] = {
            axis.status.message.key: axis.status for axis in deployment.axes.values() if axis.status
        }
        if deployment.status:
            self._codecs[deployment.status.message.key] = deployment.status

    def receive(self, frame: ReceivedFrame) -> str | None:
        """Take a data frame; return the axis' name if it is the valid status of one, else None."""
        key = (frame.bus, frame.can_id, frame.extended)
        codec = self._codecs.get(key)
        if codec is None or (values := codec.decode(frame.data)) is None:
            return None
        shown = {one.name: one.shown(values[one.name]) for one in codec.fields}
        if name := self._axes.get(key):
            self._axis(name, AxisStatus(frame.time_ns, values, shown))
        else:
            self._counters(values, shown[LAST_FAULT.name], frame.time_ns)
        return name

    def _axis(self, name: str, status: AxisStatus) -> None:
        last = self.axes.get(name)
        self.axes[name] = status
        if last is None or (last.state, last.reason) != (status.state, status.reason):
            was = f" from={last.state}" if last else ""
            text = f"axis={name} state={status.state}{was} reason={status.reason}"
            self._note(status.time_ns, text)

    def _counters(self, values: dict[str, int], fault: str, time_ns: int) -> None:
        self.counted_ns = time_ns
        counters = {name: count for name, count in values.items() if name != LAST_FAULT.name}
        for name, count in counters.items():
            last = self.counters.get(name)
            if last is not None and count != last:
                self._note(time_ns, f"{name}={count} was={last} last_fault={fault}")
        self.counters, self.last_fault = counters, fault

    def _note(self, time_ns: int, text: str) -> None:
        if len(self.changes) < self.MOST_CHANGES:
            self.changes.append(HistoryEvent(time_ns, text))
