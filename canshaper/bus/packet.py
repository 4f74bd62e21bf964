"""What a socket of SocketCAN carries: the structures can_frame and canfd_frame of linux/can.h."""

import struct
from typing import NamedTuple, Self

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
