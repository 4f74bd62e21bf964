"""Packets of a SocketCAN socket: the frame in one, its arrival, the bus error that it reports."""

import socket
import struct
import time
from collections.abc import Iterable, Sequence

from canshaper.codec.frame import (
    EFF_FLAG,
    ERR_FLAG,
    RTR_FLAG,
    SFF_MASK,
    BusState,
    Frame,
    FrameFault,
    id_of,
    new_frame,
)
from canshaper.gate.cycle import boottime_ns

CAN_FRAME = struct.Struct("=IB3x8s")
SIZE = CAN_FRAME.size
FD_FRAME = struct.Struct("=IBB2x64s")
FD_SIZE = FD_FRAME.size
WORD = struct.Struct("=I")
"""First member of ``CAN_FRAME`` and ``FD_FRAME``: the id with its flags."""
BRS, FDF = 0x01, 0x04
"""Flags of a CAN FD frame: bit rate switch for its data; the frame is CAN FD."""


def unpack(packet: bytes) -> tuple[int, bytes, int | None] | None:
    """Return (id with its flags, data, flags of CAN FD or None) of a packet of a socket.

    A packet without the size of a frame, or with less data than its length says, is None.
    """
    flags = None
    if len(packet) == SIZE:
        word, length, data = CAN_FRAME.unpack(packet)
    elif len(packet) == FD_SIZE:
        word, length, flags, data = FD_FRAME.unpack(packet)
    else:
        return None
    return (word, data[:length], flags) if length <= len(data) else None


def pack(word: int, data: bytes, flags: int | None = None) -> bytes:
    """Return the packet of a frame; arguments as ``unpack`` returns them."""
    if flags is None:
        return CAN_FRAME.pack(word, len(data), data)
    return FD_FRAME.pack(word, len(data), flags, data)


def frame_of(bus: str, packet: bytes) -> Frame | None:
    """Return the data frame in a packet; None for any other packet.

    Args:
        bus: name of the bus in the deployment file.
        packet: bytes that the socket returned.
    """
    parts = unpack(packet)
    if parts is None:
        return None
    word, data, _flags = parts
    if word <= SFF_MASK:  # the most frequent kind first
        return new_frame(Frame, (bus, word, False, data))
    return None if word & (ERR_FLAG | RTR_FLAG) else Frame(bus, *id_of(word), data)


def kernel_ids(messages: Iterable[tuple[int, bool]]) -> frozenset[int]:
    """Return the kernel ids of messages, each given as its id and whether that has 29 bits."""
    return frozenset(i | EFF_FLAG if extended else i for i, extended in messages)


SO_TIMESTAMPNS = 35  # asm/socket.h; Python has no name for it
_STAMP = struct.Struct("@ll")  # struct timespec of this machine
ANCILLARY_BYTES = 64  # room for one stamp with its header: CMSG_SPACE, which only POSIX has, is 32


def stamp_ns(ancillary: Iterable[tuple[int, int, bytes]]) -> int | None:
    """Return the arrival of a frame by the wall clock, ns; None without a time stamp.

    Args:
        ancillary: ancillary data that ``recvmsg`` returned from a socket with SO_TIMESTAMPNS.
    """
    for level, kind, value in ancillary:
        if kind == SO_TIMESTAMPNS and level == socket.SOL_SOCKET and len(value) == _STAMP.size:
            seconds, ns = _STAMP.unpack(value)
            return int(seconds) * 1_000_000_000 + int(ns)
    return None


class Arrivals:
    """Arrival times of the frames of one port, ns by ``boottime_ns``; never later than the truth.

    A frame arrived after the port was last seen empty, and before the present read. The kernel
    stamps it by the wall clock. If someone sets that clock between the two, its offset to
    ``boottime_ns`` differs between them; the offset that makes the frame older is used.
    """

    def __init__(self) -> None:
        self._empty_ns = self._empty_offset_ns = 0
        self.begin()
        self.emptied()

    def begin(self) -> int:
        """Begin a read of the port.

        Returns:
            Earliest possible arrival of its frames: the time when the port was last seen empty.
        """
        # In this order, a standstill between the two readings makes frames older, not younger.
        self._now_ns = boottime_ns()
        self._now_offset_ns = self._now_ns - time.time_ns()
        self._offset_ns = min(self._now_offset_ns, self._empty_offset_ns)
        return self._empty_ns

    def of(self, ancillary: Sequence[tuple[int, int, bytes]]) -> int:
        """Return the arrival of a frame in this read; without a stamp the earliest possible one.

        Args:
            ancillary: ancillary data that ``recvmsg`` returned, with no other item than a stamp.
                To look for the stamp, as ``stamp_ns`` does, would take twice as long.
        """
        try:
            seconds, ns = _STAMP.unpack(ancillary[0][2])
        except (IndexError, struct.error):
            return self._empty_ns
        arrived_ns: int = seconds * 1_000_000_000 + ns + self._offset_ns
        if arrived_ns > self._now_ns:
            return self._now_ns
        return arrived_ns if arrived_ns > self._empty_ns else self._empty_ns

    def emptied(self) -> None:
        """Take note that the port is empty: later frames arrive after this read began."""
        self._empty_ns, self._empty_offset_ns = self._now_ns, self._now_offset_ns


CLASS_CONTROLLER, CLASS_BUS_OFF, CLASS_RESTARTED = 0x4, 0x40, 0x100
OVERFLOW, WARNING, PASSIVE, ACTIVE = 0x01, 0x0C, 0x30, 0x40


def read_error(word: int, payload: bytes) -> tuple[FrameFault, BusState | None]:
    """Return (fault that an error frame reports, state of the bus that it shows or None).

    Args:
        word: id of the error frame, with its flags.
        payload: its 8 bytes.
    """
    controller = payload[1] if word & CLASS_CONTROLLER else 0
    if word & CLASS_BUS_OFF:
        return FrameFault.BUS_OFF, BusState.BUS_OFF
    if controller & PASSIVE:
        return FrameFault.BUS_PASSIVE, BusState.PASSIVE
    if word & CLASS_RESTARTED or controller & (ACTIVE | WARNING):  # counters below passive
        return FrameFault.ERROR_FRAME, BusState.UP
    return FrameFault.FRAMES_LOST if controller & OVERFLOW else FrameFault.ERROR_FRAME, None
