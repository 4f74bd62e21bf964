"""Profiles of AUTOSAR E2E: 1, 2, 5, 6, 11 and 22 for any frame, 4 and 7 for CAN FD.

Source: AUTOSAR PRS_E2EProtocol (FO R20-11), whose protocol examples are in the tests. Start and end
values of the CRCs, order of the bytes of the data ID and counter positions are those of the
MIT-licensed Python package autosar-e2e and of torsko/autosar-e2e, which agree.

Every profile puts a header into the first bytes of a message. In profiles 1 and 2 the CRC fills
byte 0, the counter the lower half of byte 1; 11 and 22 are the same with fewer variants. Other
positions are not supported. The headers of profiles 4 and 7 (12, 20 bytes) fit into CAN FD only.
"""

import binascii
from collections.abc import Sequence
from typing import Literal

from crccheck.crc import Crc32Autosar, Crc64Xz

from canshaper.checksums.algorithms import AUTOSAR, SAE_J1850, ReflectedCrc

COUNTER = 0x0F
"""Bits of byte 1 that hold the counter in profiles 1 and 2."""


class E2e:
    """Common part of all profiles.

    Attributes:
        counts: number of values of the counter.
        bits: length of the header at the beginning of a message, bits.
    """

    counts: int
    bits = 12

    def count(self, data: bytes) -> int:
        """Return the counter of a frame."""
        return data[1] & COUNTER

    def __eq__(self, other: object) -> bool:
        """Return whether ``other`` is the same profile with the same data IDs and mode."""
        return type(other) is type(self) and vars(other) == vars(self)

    def __hash__(self) -> int:
        return hash(type(self))

    def verify(self, data: bytes) -> bool:
        """Return whether the header of a frame of two bytes or more is right."""
        count = self.count(data)
        return count < self.counts and data[0] == self.crc(data, count)

    def protect(self, data: bytes, count: int) -> bytes:
        """Return the frame with its header, in which the counter is ``count``."""
        data = bytes((0, self.second(data[1], count))) + data[2:]
        return bytes((self.crc(data, count),)) + data[1:]

    def second(self, byte: int, count: int) -> int:
        """Return byte 1 with this counter; ``byte`` is byte 1 as the signals encode it."""
        return byte & ~COUNTER | count

    def crc(self, data: bytes, count: int) -> int:
        """CRC of a frame whose counter is ``count``."""
        raise NotImplementedError


class Profile1(E2e):
    """CRC-8 SAE J1850 over the data ID and then the bytes from 1; counter 0 to 14, 15 is invalid.

    Args:
        data_id: 16 bits that distinguish this message from all others.
        mode: bytes of the data ID that enter the CRC. ``both``: the low byte, then the high one.
            ``low``: the low byte. ``alternating``: the low byte with even counters, the high byte
            with odd ones. ``nibble``: the low byte, then a zero; four bits of the high byte are
            sent in the upper half of byte 1.

    Attributes:
        starts: register of the CRC after the data ID, for even and for odd counters.

    The profile starts the CRC with 0 and does not invert its result, unlike the CRC-8 SAE J1850 of
    catalogues.
    """

    counts = 15

    def __init__(self, data_id: int, mode: str) -> None:
        low, high = data_id & 0xFF, data_id >> 8
        even: tuple[int, ...] = (low,)
        odd = even
        if mode == "both":
            even = odd = (low, high)
        elif mode == "alternating":
            odd = (high,)
        elif mode == "nibble":
            even = odd = (low, 0)
        self.starts = tuple(SAE_J1850.run(0, bytes(first)) for first in (even, odd))
        self._nibble = (high & 0x0F) << 4 if mode == "nibble" else None
        self.bits = 12 if self._nibble is None else 16

    def verify(self, data: bytes) -> bool:
        """Return whether the header, and the part of the data ID that is sent, are right."""
        if self._nibble is not None and data[1] & 0xF0 != self._nibble:
            return False
        return super().verify(data)

    def second(self, byte: int, count: int) -> int:
        """Return byte 1 with this counter and the part of the data ID that is sent."""
        return super().second(byte if self._nibble is None else self._nibble, count)

    def crc(self, data: bytes, count: int) -> int:
        """CRC of a frame."""
        return SAE_J1850.run(self.starts[count & 1], data[1:])


class Profile2(E2e):
    """CRC-8 0x2F over the bytes from 1 and then the data ID of the counter, which is 0 to 15.

    Args:
        data_ids: 16 data IDs of 8 bits, by the counter.

    Attributes:
        ids: each data ID as one byte.
    """

    counts = 16

    def __init__(self, data_ids: Sequence[int]) -> None:
        self.ids = tuple(bytes((i,)) for i in data_ids)

    def crc(self, data: bytes, count: int) -> int:
        """CRC of a frame."""
        return AUTOSAR.of(data[1:] + self.ids[count])


class Profile5(E2e):
    """CRC-16 over the bytes from 2 and the data ID, low byte first; counter 0 to 255 in byte 2.

    Args:
        data_id: 16 bits that distinguish this message from all others.
    """

    counts = 256
    bits = 24
    _order: Literal["little", "big"] = "little"

    def __init__(self, data_id: int) -> None:
        self._id = data_id.to_bytes(2, self._order)

    def count(self, data: bytes) -> int:
        """Return the counter of a frame."""
        return data[2]

    def verify(self, data: bytes) -> bool:
        """Return whether the header of a frame is right."""
        return data[:2] == self.crc(data, 0).to_bytes(2, self._order)

    def protect(self, data: bytes, count: int) -> bytes:
        """Return the frame with its header."""
        data = data[:2] + bytes((count,)) + data[3:]
        return self.crc(data, count).to_bytes(2, self._order) + data[2:]

    def crc(self, data: bytes, count: int) -> int:
        """CRC of a frame; ``count`` is unused, as the counter is among the bytes."""
        return binascii.crc_hqx(data[2:] + self._id, 0xFFFF)


class Profile6(Profile5):
    """Profile 5 with the high byte first; bytes 2 and 3 are the length, byte 4 is the counter."""

    bits = 40
    _order = "big"

    def count(self, data: bytes) -> int:
        """Return the counter of a frame."""
        return data[4]

    def verify(self, data: bytes) -> bool:
        """Return whether the header and the length in it are right."""
        return data[2:4] == len(data).to_bytes(2, "big") and super().verify(data)

    def protect(self, data: bytes, count: int) -> bytes:
        """Return the frame with its header."""
        data = data[:2] + len(data).to_bytes(2, "big") + bytes((count,)) + data[5:]
        return self.crc(data, count).to_bytes(2, "big") + data[2:]


CRC32_P4 = ReflectedCrc(Crc32Autosar)
"""Polynomial 0xF4ACFB13, start and end all ones."""
CRC64 = ReflectedCrc(Crc64Xz)
"""Polynomial 0x42F0E1EBA9EA3693, start and end all ones."""


class Profile4(E2e):
    """CRC-32 over all other bytes; before it length, counter and data ID, high bytes first.

    Args:
        data_id: 32 bits that distinguish this message from all others.
    """

    counts = 1 << 16
    bits = 96

    def __init__(self, data_id: int) -> None:
        self._id = data_id.to_bytes(4, "big")

    def count(self, data: bytes) -> int:
        """Return the counter of a frame."""
        return int.from_bytes(data[2:4], "big")

    def verify(self, data: bytes) -> bool:
        """Return whether the header of a frame is right."""
        return self.protect(data, self.count(data)) == data

    def protect(self, data: bytes, count: int) -> bytes:
        """Return the frame with its header."""
        head = len(data).to_bytes(2, "big") + count.to_bytes(2, "big") + self._id
        return head + CRC32_P4.of(head + data[12:]).to_bytes(4, "big") + data[12:]


class Profile7(Profile4):
    """Profile 4 with a CRC-64, which comes first, and length and counter of 32 bits."""

    counts = 1 << 32
    bits = 160

    def count(self, data: bytes) -> int:
        """Return the counter of a frame."""
        return int.from_bytes(data[12:16], "big")

    def protect(self, data: bytes, count: int) -> bytes:
        """Return the frame with its header."""
        rest = len(data).to_bytes(4, "big") + count.to_bytes(4, "big") + self._id + data[20:]
        return CRC64.of(rest).to_bytes(8, "big") + rest
