"""How checksums are computed: by tables, a byte at a time; crccheck works bit by bit."""

from functools import reduce
from operator import xor
from typing import Protocol

from crccheck.crc import Crc8Autosar, Crc8Base, Crc8SaeJ1850, CrcBase


class Place(Protocol):
    """Position of the checksum in a message."""

    @property
    def byte(self) -> int:
        """First byte of the checksum, counted from 0."""


def _numbers(library: type[CrcBase]) -> tuple[int, int, tuple[int, ...]]:
    """Return (start register, final XOR, table) of a CRC.

    The table holds the register after one byte, by (register byte XOR data byte).
    """
    end: int = library.calc(b"", initvalue=0)
    start: int = library.calc(b"") ^ end
    return start, end, tuple(library.calc(bytes((i,)), initvalue=0) ^ end for i in range(256))


class KernelSum:
    """A checksum that we compute, and the kernel from the same numbers (``codec.kernel_check``)."""

    def of(self, data: bytes) -> int:
        """Checksum of these bytes."""
        raise NotImplementedError

    def __call__(self, _can_id: int, place: Place, data: bytes) -> int:
        """Return the checksum over all bytes of a frame except the checksum's own byte."""
        at = place.byte
        return self.of(data[:at] + data[at + 1 :])


class Xor(KernelSum):
    """Exclusive or of all bytes.

    Attributes:
        start: value before the first byte.
    """

    def __init__(self, start: int = 0) -> None:
        self.start = start

    def of(self, data: bytes) -> int:
        """Return the exclusive or of ``start`` and every byte of ``data``."""
        return reduce(xor, data, self.start)


class Crc8(KernelSum):
    """A CRC of 8 bits: that of a crccheck class that reflects both bytes and result, or neither.

    Attributes:
        start: register before the first byte.
        end: value that is XORed into the register after the last byte.
        table: register after one byte, by (register XOR byte).
    """

    def __init__(self, library: type[Crc8Base]) -> None:
        self.start, self.end, table = _numbers(library)
        self.table = bytes(table)

    def run(self, value: int, data: bytes) -> int:
        """Return the register after ``data``, starting from ``value``."""
        table = self.table
        for byte in data:
            value = table[value ^ byte]
        return value

    def of(self, data: bytes) -> int:
        """Return the CRC of ``data`` with the algorithm's start value and final XOR."""
        return self.run(self.start, data) ^ self.end


SAE_J1850 = Crc8(Crc8SaeJ1850)
"""Polynomial 0x1D, start and end 0xFF."""
AUTOSAR = Crc8(Crc8Autosar)
"""Polynomial 0x2F, start and end 0xFF."""


class ReflectedCrc:
    """A CRC of 16 bits or more: that of a crccheck class that reflects bytes and result."""

    def __init__(self, library: type[CrcBase]) -> None:
        self._start, self._end, self._table = _numbers(library)

    def of(self, data: bytes) -> int:
        """CRC of ``data``."""
        value, table = self._start, self._table
        for byte in data:
            value = value >> 8 ^ table[(value ^ byte) & 0xFF]
        return value ^ self._end


class Crc16:
    """A CRC of 16 bits: that of a crccheck class that reflects neither bytes nor result."""

    def __init__(self, library: type[CrcBase]) -> None:
        self._start, self._end, self._table = _numbers(library)

    def of(self, data: bytes) -> int:
        """CRC of ``data``."""
        value, table = self._start, self._table
        for byte in data:
            value = (value & 0xFF) << 8 ^ table[value >> 8 ^ byte]
        return value ^ self._end
