"""Checks of protected messages as the kernel's gateway computes them, where it can."""

import struct

from canshaper.checksums.algorithms import AUTOSAR, SAE_J1850, Crc8, Xor
from canshaper.checksums.kinds import CHECKSUMS, Checksum
from canshaper.codec.e2e import Profile1, Profile2, Profile4, Profile5
from canshaper.codec.protection import Protection

# linux/can/gw.h: attributes of a rule that compute a checksum.
CS_XOR, CS_CRC8 = 5, 6
_XOR = struct.Struct("=bbbB")  # cgw_csum_xor
_CRC8 = struct.Struct("=bbbBB256sB20s")  # cgw_csum_crc8
# linux/can/gw.h: no more than the bytes; a byte by the low half of byte 1 after them.
PLAIN, BY_COUNTER = 0, 2


def neutral_fault(protection: Protection, length: int) -> str | None:
    """Why the kernel cannot protect a frame of so many bytes again that it has changed, or None."""
    check = protection.check
    if isinstance(check, Checksum):
        kernel = CHECKSUMS[check.kind].kernel
        if kernel is None:
            return f"can-gw of the kernel knows no checksum of the kind {check.kind}"
        if isinstance(kernel, Crc8) and check.byte not in (0, length - 1):
            return f"can-gw of the kernel computes {check.kind} in the first or last byte only"
    if isinstance(check, Profile4 | Profile5):
        return "can-gw of the kernel knows no CRC of more than 8 bits"
    if isinstance(check, Profile1) and check.starts[0] != check.starts[1]:
        return "can-gw of the kernel knows no data ID that alternates"
    return None


def kernel_check(protection: Protection, length: int) -> tuple[tuple[tuple[int, bytes], ...], int]:
    """The check as can-gw computes it, and bits that have to be 0 before; no ``neutral_fault``."""
    check = protection.check
    last = length - 1
    if check is None:
        return (), 0
    if isinstance(check, Checksum):
        kernel = CHECKSUMS[check.kind].kernel
        if isinstance(kernel, Xor):
            # Over all bytes, its own among them, which therefore is 0 before.
            return ((CS_XOR, _XOR.pack(0, last, check.byte, kernel.start)),), 0xFF << 8 * check.byte
        assert kernel is not None
        first = 1 if check.byte == 0 else 0
        return _crc8(kernel, (first, last - 1 + first, check.byte), kernel.start, kernel.end), 0
    if isinstance(check, Profile1):
        return _crc8(SAE_J1850, (1, last, 0), check.starts[0], 0), 0
    assert isinstance(check, Profile2)
    ids = b"".join(check.ids)
    return _crc8(AUTOSAR, (1, last, 0), AUTOSAR.start, AUTOSAR.end, ids), 0


def _crc8(
    crc: Crc8, places: tuple[int, int, int], start: int, end: int, by_counter: bytes = b""
) -> tuple[tuple[int, bytes], ...]:
    profile = BY_COUNTER if by_counter else PLAIN
    return ((CS_CRC8, _CRC8.pack(*places, start, end, crc.table, profile, by_counter)),)
