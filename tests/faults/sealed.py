"""Header of a frame with AUTOSAR E2E profile 4 or 7, from the text of the standard."""

import struct
from functools import cache
from typing import Any


@cache
def table(polynomial: int) -> list[int]:
    """The register after one byte, where it was 0 before."""
    made = [*range(256)]
    for _ in range(8):
        made = [value >> 1 ^ (polynomial if value & 1 else 0) for value in made]
    return made


def crc(polynomial: int, bits: int, data: bytes) -> int:
    """A reflected CRC that starts and ends with all ones."""
    after = table(polynomial)
    register = ones = (1 << bits) - 1
    for byte in data:
        register = register >> 8 ^ after[(register ^ byte) & 255]
    return register ^ ones


def crc32_p4(data: bytes) -> int:
    """The CRC of profile 4: polynomial 0xF4ACFB13, here reflected."""
    return crc(0xC8DF352F, 32, data)


def crc64_xz(data: bytes) -> int:
    """The CRC of profile 7: polynomial 0x42F0E1EBA9EA3693, here reflected."""
    return crc(0xC96C5795D7870F42, 64, data)


def with_header_p4(length: int, count: int, data_id: int, rest: bytes) -> bytes:
    """The frame of profile 4: length, counter, data ID, and the CRC over all but itself."""
    head = struct.pack(">HHI", length, count % (1 << 16), data_id)
    return head + struct.pack(">I", crc32_p4(head + rest)) + rest


def sealed(section: dict[str, Any] | None, data: bytes, ahead: int = 0) -> bytes:
    """The frame with the right header, its counter so much ahead; as it is without a section."""
    if section is None:
        return data
    if section["profile"] == "p04":
        length, count, data_id, _ = struct.unpack(">HHII", data[:12])
        return with_header_p4(length, count + ahead, data_id, data[12:])
    assert section["profile"] == "p07"
    length, count, data_id = struct.unpack(">III", data[8:20])
    rest = struct.pack(">III", length, (count + ahead) % (1 << 32), data_id) + data[20:]
    return struct.pack(">Q", crc64_xz(rest)) + rest
