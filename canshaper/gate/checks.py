"""Checksums of frames, and profiles of AUTOSAR E2E: the gate's own code, from the definitions."""

from dataclasses import dataclass, field
from functools import reduce
from operator import xor
from typing import Literal


@dataclass(slots=True)
class Crc:
    """A CRC by its numbers in catalogues, computed a byte at a time by a table."""

    bits: int  # width of the register, 8 to 64
    polynomial: int  # without its highest bit
    start: int  # register before the first byte
    end: int  # XORed into the register after the last byte
    reflected: bool = False  # the lowest bit of each byte comes first
    table: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        polynomial, bits, ones = self.polynomial, self.bits, (1 << self.bits) - 1
        table = []
        if self.reflected:
            polynomial, self.start = _turned(polynomial, bits), _turned(self.start, bits)
        for byte in range(256):  # the register after one byte, where it was 0 before
            value = byte if self.reflected else byte << (bits - 8)
            for _ in range(8):
                if self.reflected:
                    value = value >> 1 ^ (polynomial if value & 1 else 0)
                else:
                    value = (value << 1 ^ (polynomial if value >> (bits - 1) else 0)) & ones
            table.append(value)
        self.table = tuple(table)

    def of(self, data: bytes) -> int:
        """Return the CRC of these bytes."""
        value, table = self.start, self.table
        if self.reflected:
            for byte in data:
                value = value >> 8 ^ table[(value ^ byte) & 0xFF]
        else:
            top, ones = self.bits - 8, (1 << self.bits) - 1
            for byte in data:
                value = value << 8 & ones ^ table[value >> top ^ byte]
        return value ^ self.end


def _turned(value: int, bits: int) -> int:
    """Return a value with its bits in reverse order."""
    return int(f"{value:0{bits}b}"[::-1], 2)


@dataclass(frozen=True, slots=True)
class Checksum:
    """A checksum over all other bits of a frame."""

    how: Crc | Literal["xor", "sum", "halves"]  # halves: sum of the half bytes
    byte: int  # its first byte in the frame
    shift: int = 0  # its lowest bit in that byte
    bits: int = 8
    order: Literal["little", "big"] = "little"
    plus: int = 0  # what is added to a sum: the bytes of the identifier, or the length

    def right(self, data: bytes) -> bool:
        """Return whether the checksum in a frame is that of the frame's other bits."""
        at, ones = self.byte, (1 << self.bits) - 1
        end = at + (self.bits + 7) // 8
        sent = int.from_bytes(data[at:end], self.order)
        others = data[:at] + data[end:]
        if isinstance(self.how, Crc):
            value = self.how.of(others)
        elif self.how == "xor":
            value = reduce(xor, others, 0)
        elif self.how == "sum":
            value = sum(others) + self.plus
        else:
            rest = sent & ~(ones << self.shift)
            value = sum(byte + (byte >> 4) for byte in (*others, rest))
        return value & ones == sent >> self.shift & ones


J1850, J1850_OF_1, AUTOSAR = (8, 0x1D, 0xFF, 0xFF), (8, 0x1D, 0, 0), (8, 0x2F, 0xFF, 0xFF)
CCITT = 16, 0x1021, 0xFFFF, 0
P4 = 32, 0xF4ACFB13, 0xFFFF_FFFF, 0xFFFF_FFFF, True
XZ = 64, 0x42F0_E1EB_A9EA_3693, (1 << 64) - 1, (1 << 64) - 1, True
CRCS: dict[str, tuple[int, ...]] = {
    "crc8_sae_j1850": J1850, "crc8_autosar": AUTOSAR, "crc16_ccitt_false": CCITT,
    "crc16_arc": (16, 0x8005, 0, 0, True), "p01": J1850_OF_1, "p11": J1850_OF_1, "p02": AUTOSAR,
    "p22": AUTOSAR, "p04": P4, "p05": CCITT, "p06": CCITT, "p07": XZ,
}  # fmt: skip
"""Numbers of the CRC (as in ``Crc``) by checksum kind, and by E2E profile."""


def crc_of(name: str) -> Crc:
    """Return the CRC of a checksum kind or E2E profile."""
    bits, polynomial, start, end, *reflected = CRCS[name]
    return Crc(bits, polynomial, start, end, bool(reflected))


@dataclass(slots=True)
class E2e:
    """CRC and counter in the first bytes of a frame (AUTOSAR PRS_E2EProtocol)."""

    profile: str  # p01, p02, p04, p05, p06, p07, p11 or p22
    counts: int  # number of values of the counter
    data_id: int = 0  # of the message
    mode: str = ""  # bytes of the data ID that enter the CRC, profiles 1 and 11
    ids: bytes = b""  # data IDs by the counter, profiles 2 and 22
    crc: Crc = field(init=False)

    def __post_init__(self) -> None:
        self.crc = crc_of(self.profile)

    def count(self, data: bytes) -> int:
        """Return the counter of a frame."""
        first, last = COUNTERS[self.profile]
        count = int.from_bytes(data[first:last], "big")
        return count & 0x0F if last == 2 else count

    def right(self, data: bytes) -> bool:
        """Return whether the header of a frame is right."""
        profile, count, of = self.profile, self.count(data), self.crc.of
        if count >= self.counts:
            return False
        if profile in ("p01", "p11"):  # the data ID by its mode comes before the bytes from 1
            low, high = self.data_id & 0xFF, self.data_id >> 8
            if self.mode == "nibble" and data[1] >> 4 != high & 0x0F:
                return False
            first = {
                "both": (low, high),
                "low": (low,),
                "nibble": (low, 0),
                "alternating": (high if count & 1 else low,),
            }[self.mode]
            return data[0] == of(bytes(first) + data[1:])
        if profile in ("p02", "p22"):
            return data[0] == of(data[1:] + self.ids[count : count + 1])
        # The others put length, counter and data ID into a header, high bytes first except p05.
        if profile == "p05":
            crc = of(data[2:] + self.data_id.to_bytes(2, "little"))
            head = crc.to_bytes(2, "little")
        elif profile == "p06":
            crc = of(data[2:] + self.data_id.to_bytes(2, "big"))
            head = crc.to_bytes(2, "big") + len(data).to_bytes(2, "big")
        elif profile == "p04":
            head = len(data).to_bytes(2, "big") + data[2:4] + self.data_id.to_bytes(4, "big")
            head += of(data[:8] + data[12:]).to_bytes(4, "big")
        else:
            head = of(data[8:]).to_bytes(8, "big") + len(data).to_bytes(4, "big")
            head += data[12:16] + self.data_id.to_bytes(4, "big")
        return data.startswith(head)


COUNTERS = {
    "p01": (1, 2), "p11": (1, 2), "p02": (1, 2), "p22": (1, 2), "p04": (2, 4), "p05": (2, 3),
    "p06": (4, 5), "p07": (12, 16),
}  # fmt: skip
"""(first byte, end byte) of the counter by profile; in byte 1 it fills the lower half only."""
COUNTS = {"p01": 15, "p11": 15, "p02": 16, "p22": 16, "p04": 1 << 16, "p07": 1 << 32}
"""Number of values of the counter by profile; other profiles have 256."""
HEADERS = {"p04": 12, "p05": 3, "p06": 5, "p07": 20}
"""Bytes of the header by profile; other profiles have 2."""
