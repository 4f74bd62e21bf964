"""What a socket of SocketCAN carries: the structures can_frame and canfd_frame of linux/can.h."""

import struct
from collections.abc import Iterable
from typing import NamedTuple, Self

from canshaper.codec.can_id import EFF_FLAG, ERR_FLAG, RTR_FLAG, SFF_MASK, id_of
from canshaper.codec.frame import Frame, new_frame

CAN_FRAME = struct.Struct("=IB3x8s")
SIZE = CAN_FRAME.size
FD_FRAME = struct.Struct("=IBB2x64s")
FD_SIZE = FD_FRAME.size
WORD = struct.Struct("=I")
"""The first member of both: the id with its flags."""
BRS, FDF = 0x01, 0x04
"""Flags of a frame of CAN FD: its data have a bit rate of their own; it is one of CAN FD."""


class Packet(NamedTuple):
    """What a socket of SocketCAN carries, unpacked.

    Attributes:
        word: id with its flags.
        data: up to 8 bytes, of CAN FD up to 64.
        flags: those of a frame of CAN FD; None of a classical one.
    """

    word: int
    data: bytes
    flags: int | None = None

    @classmethod
    def unpack(cls, packet: bytes) -> Self:
        """From the bytes of the socket, of which there are ``FD_SIZE`` at most.

        Raises:
            struct.error: it has not the size of a frame.
        """
        if len(packet) == FD_SIZE:
            word, length, flags, data = FD_FRAME.unpack(packet)
            return cls(word, data[:length], flags)
        word, length, data = CAN_FRAME.unpack(packet)
        return cls(word, data[:length])

    def pack(self) -> bytes:
        """The bytes for a socket."""
        if self.flags is None:
            return CAN_FRAME.pack(self.word, len(self.data), self.data)
        return FD_FRAME.pack(self.word, len(self.data), self.flags, self.data)


def frame_of(bus: str, packet: bytes) -> Frame | None:
    """The data frame in the bytes of a socket; None where there is none in them.

    Args:
        bus: name of the bus in the deployment file.
        packet: the bytes.
    """
    if len(packet) == SIZE:
        word, length, payload = CAN_FRAME.unpack(packet)
        if word <= SFF_MASK and length <= 8:  # the most frequent kind first
            return new_frame(Frame, (bus, word, False, payload[:length]))
    elif len(packet) == FD_SIZE:
        word, length, _flags, payload = FD_FRAME.unpack(packet)
    else:
        return None
    if word & (ERR_FLAG | RTR_FLAG) or length > len(payload):
        return None
    return Frame(bus, *id_of(word), payload[:length])


def kernel_ids(messages: Iterable[tuple[int, bool]]) -> frozenset[int]:
    """The kernel's ids of messages: id, and whether it has 29 bits."""
    return frozenset(i | EFF_FLAG if extended else i for i, extended in messages)
