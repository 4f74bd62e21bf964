"""The bits of a frame as the DBC file places them, and the checksums that may be among them."""

import functools
import operator
from collections.abc import Callable, Mapping
from typing import Any

from cantools.database.can import Signal


class Field:
    """The bits of one little-endian integer signal, in a frame read as one number."""

    __slots__ = (
        *("full", "high", "low", "mask", "name", "scale"),
        *("sign", "special", "start", "turn", "zero"),
    )

    def __init__(self, signal: Signal, section: Mapping[str, Any] | None = None) -> None:
        """``section`` is what the deployment file says of its scaling."""
        assert signal.byte_order == "little_endian", signal.name
        assert not signal.is_float, signal.name
        self.name = signal.name
        self.start = signal.start
        self.mask = (1 << signal.length) - 1
        self.sign = 1 << (signal.length - 1) if signal.is_signed else 0
        said = section or {}
        self.scale = signal.scale
        # raw value of full deflection; offsets are not used in the DBC files of these machines
        assert not signal.offset, signal.name
        self.zero = round(said.get("zero", 0) / signal.scale)
        self.turn = -1 if said.get("invert") else 1
        self.low, self.high = -self.sign - self.zero, self.mask - self.sign - self.zero
        self.full = round(said.get("full", signal.maximum or 0) / signal.scale)
        self.special = {int(raw): str(name) for raw, name in (signal.choices or {}).items()}

    def get(self, word: int) -> int:
        value = (word >> self.start) & self.mask
        return self.read(value - 2 * self.sign if value & self.sign else value)

    def read(self, raw: int) -> int:
        """Steps from zero of a raw value."""
        return self.turn * (raw - self.zero)

    def put(self, steps: int) -> int:
        return (self.turn * steps + self.zero & self.mask) << self.start

    def code(self, kind: str) -> int | None:
        """Raw value that the DBC names so, such as Error."""
        return next((raw for raw, name in self.special.items() if name == kind), None)


def crc8(polynomial: int, end: int) -> Callable[[bytes], int]:
    """A CRC of eight bits that starts with 0xFF, bit by bit, from a table."""
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1) ^ (polynomial if byte & 0x80 else 0)  # noqa: PLW2901
        table.append(byte & 0xFF)
    return lambda data: functools.reduce(lambda crc, b: table[crc ^ b], data, 0xFF) ^ end


CHECKSUMS: dict[str, Callable[[bytes], int]] = {
    "xor": lambda data: functools.reduce(operator.xor, data, 0),
    "sum": lambda data: sum(data) % 256,
    "crc8_sae_j1850": crc8(0x1D, 0xFF),
    "crc8_autosar": crc8(0x2F, 0xFF),
}
