"""A CRC of 16 bits over the frame and its CAN id."""

import binascii

from canshaper import Checksum, ChecksumKind


def crc16_id(can_id: int, place: Checksum, data: bytes) -> int:
    """Of a frame without the bytes in which it lies itself."""
    return binascii.crc_hqx(place.others(data) + can_id.to_bytes(4, "big"), 0x1D0F)


CRC16_ID = ChecksumKind(
    "CRC 0x1021, start 0x1D0F, also over the CAN id", 16, crc16_id, needs_id=True
)
