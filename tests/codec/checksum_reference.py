"""Every kind of checksum once more, by another library or digit by digit."""

from collections.abc import Callable
from functools import reduce
from operator import xor
from typing import Any

from crccheck.crc import Crc8Autosar, Crc8SaeJ1850, Crc16Arc, Crc16CcittFalse

# By the CAN id, the bytes without those of the checksum (half a byte of it is 0), and their number
# with those.
REFERENCE: dict[str, Callable[[int, bytes, int], Any]] = {
    "xor": lambda _id, rest, _length: reduce(xor, rest, 0),
    "sum": lambda _id, rest, _length: sum(rest) % 256,
    "crc8_sae_j1850": lambda _id, rest, _length: Crc8SaeJ1850.calc(rest),
    "crc8_autosar": lambda _id, rest, _length: Crc8Autosar.calc(rest),
    "sum_id": lambda can_id, rest, _length: sum(bytes.fromhex(f"{can_id:08x}") + rest) % 256,
    "sum_length": lambda _id, rest, length: (sum(rest) + length) % 256,
    "sum4": lambda _id, rest, _length: sum(int(digit, 16) for digit in rest.hex()) % 16,
    "crc16_ccitt_false": lambda _id, rest, _length: Crc16CcittFalse.calc(rest),
    "crc16_arc": lambda _id, rest, _length: Crc16Arc.calc(rest),
}
# Signal of each width that the tests add to JoystickLeft, in bits that it does not use.
PLACES = {4: "48|4@1+", 8: "48|8@1+", 16: "40|16@1+"}


def with_checksum(kind: str, bits: int, can_id: int, data: bytes) -> bytes:
    """Return the frame of JoystickLeft with its checksum."""
    start = int(PLACES[bits].partition("|")[0])
    word = int.from_bytes(data, "little") & ~((1 << bits) - 1 << start)
    clear = word.to_bytes(len(data), "little")
    rest = clear if bits < 8 else clear[: start // 8] + clear[(start + bits) // 8 :]
    word |= REFERENCE[kind](can_id, rest, len(data)) << start
    return word.to_bytes(len(data), "little")
