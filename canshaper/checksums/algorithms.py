"""How checksums are computed: by tables, a byte at a time; crccheck works bit by bit."""

from functools import reduce
from operator import xor
from typing import Protocol

from crccheck.crc import Crc8Autosar, Crc8Base, Crc8SaeJ1850, CrcBase


class Place(Protocol):
    """Where the checksum of a message lies."""

    @property
    def byte(self) -> int:
        """Where it begins."""


def _numbers(library: type[CrcBase]) -> tuple[int, int, tuple[int, ...]]:
    """Register before the first byte, what it is changed by after the last, and its table.

    The table has the register after one byte, by what the byte and the register's are together.
    """
    end: int = library.calc(b"", initvalue=0)
    start: int = library.calc(b"") ^ end
    return start, end, tuple(library.calc(bytes((i,)), initvalue=0) ^ end for i in range(256))


class KernelSum:
    """Computed here and, from the same numbers, by the kernel: see ``codec.kernel_check``."""

    def of(self, data: bytes) -> int:
        """Checksum of these bytes."""
        raise NotImplementedError

    def __call__(self, _can_id: int, place: Place, data: bytes) -> int:
        """Return the checksum of a frame: over the bytes but the one that it lies in."""
        at = place.byte
        return self.of(data[:at] + data[at + 1 :])


class Xor(KernelSum):
    """Exclusive or of all bytes.

    Attributes:
        start: what it begins with.
    """

    def __init__(self, start: int = 0) -> None:
        self.start = start

    def of(self, data: bytes) -> int:
        """Exclusive or of ``data`` and the start."""
        return reduce(xor, data, self.start)


class Crc8(KernelSum):
    """The CRC of a class of crccheck that reflects bytes and result, or neither.

    Attributes:
        start: the register before the first byte.
        end: what the register is changed by after the last.
        table: the register after one byte, by what both are together.
    """

    def __init__(self, library: type[Crc8Base]) -> None:
        self.start, self.end, table = _numbers(library)
        self.table = bytes(table)

    def run(self, value: int, data: bytes) -> int:
        """The register after ``data``, where it was ``value`` before."""
        table = self.table
        for byte in data:
            value = table[value ^ byte]
        return value

    def of(self, data: bytes) -> int:
        """CRC of ``data`` with the start value and the final inversion of the algorithm."""
        return self.run(self.start, data) ^ self.end


SAE_J1850 = Crc8(Crc8SaeJ1850)
"""Polynomial 0x1D, start and end 0xFF."""
AUTOSAR = Crc8(Crc8Autosar)
"""Polynomial 0x2F, start and end 0xFF."""


class ReflectedCrc:
    """The CRC of a class of crccheck that reflects bytes and result, of 16 bits or more."""

    def __init__(self, library: type[CrcBase]) -> None:
        self._start, self._end, self._table = _numbers(library)

    def of(self, data: bytes) -> int:
        """CRC of ``data``."""
        value, table = self._start, self._table
        for byte in data:
            value = value >> 8 ^ table[(value ^ byte) & 0xFF]
        return value ^ self._end


class Crc16:
    """The CRC of a class of crccheck that reflects neither, of 16 bits."""

    def __init__(self, library: type[CrcBase]) -> None:
        self._start, self._end, self._table = _numbers(library)

    def of(self, data: bytes) -> int:
        """CRC of ``data``."""
        value, table = self._start, self._table
        for byte in data:
            value = (value & 0xFF) << 8 ^ table[value >> 8 ^ byte]
        return value ^ self._end
