"""CRCs of eight bits from a table of 256 entries: the library works bit by bit."""

from crccheck.crc import Crc8Autosar, Crc8Base, Crc8SaeJ1850


class Crc8:
    """The CRC of a class of crccheck that reflects nothing.

    Attributes:
        start: the register before the first byte.
        end: what the register is changed by after the last.
        table: the register after one byte, by what both are together.
    """

    def __init__(self, library: type[Crc8Base]) -> None:
        self.end: int = library.calc(b"", initvalue=0)
        self.start: int = library.calc(b"") ^ self.end
        self.table = bytes(library.calc(bytes((i,)), initvalue=0) ^ self.end for i in range(256))

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
