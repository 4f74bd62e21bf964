"""Raw values of a message from and to bytes, compiled once for the control loop.

bitstruct is called directly: docs/decisions.md#cantools-at-the-desk.
"""

import math
from typing import Any, NamedTuple

from cantools.database.can import Message, Signal

try:
    from bitstruct.c import compile as compile_format
except ImportError:  # no compiled part for this machine: the same in Python, and slower
    from bitstruct import compile as compile_format

CLASSICAL_BYTES = 8
FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Bytes that a frame of CAN FD may have (ISO 11898-1)."""


def layout_fault(message: Message) -> str | None:
    """Return why a message's cycle time, multiplexor or signal numbers are unusable, or None.

    cantools would report these faults only when it decodes a frame, or never.
    """
    if not isinstance(message.cycle_time, int | None) or (message.cycle_time or 0) < 0:
        return f"GenMsgCycleTime: expected a whole number of ms, got {message.cycle_time!r}"
    multiplexors = {signal.name for signal in message.signals if signal.is_multiplexer}
    for signal in message.signals:
        if signal.multiplexer_ids and signal.multiplexer_signal not in multiplexors:
            return f"{signal.name}: expected a multiplexor (M) in its message, got none for it"
        if signal.start < 0:
            return f"{signal.name}: expected a start bit of 0 or more, got {signal.start}"
        if fault := _number_fault(signal):
            return fault
    return None


def _number_fault(signal: Signal) -> str | None:
    """Return why start value, length, factor or offset of a signal is unusable, or None."""
    first = signal.raw_initial or 0
    if not isinstance(first, int | float) or not math.isfinite(first):
        return f"GenSigStartValue of {signal.name}: expected a number, got {first!r}"
    if signal.is_float and signal.length not in (32, 64):  # all that SIG_VALTYPE_ has
        return f"{signal.name}: expected a float of 32 or 64 bits, got {signal.length}"
    if not (math.isfinite(signal.scale) and math.isfinite(signal.offset)):
        got = f"({signal.scale:g},{signal.offset:g})"
        return f"{signal.name}: expected finite factor and offset, got {got}"
    return None


class Chosen(NamedTuple):
    """The frames of a multiplexed message that the deployment uses.

    Attributes:
        signal: name of the multiplexor.
        value: raw value of the multiplexor in these frames.
        alone: whether only these frames have the alive counter or checksum.
    """

    signal: str
    value: int
    alone: bool


class Layout:
    """Encodes and decodes the raw values of the signals of a message.

    The message has been loaded strictly (no signals overlap), is not multiplexed and has no
    ``layout_fault``. Bits that no signal has are encoded as 1 in messages of J1939, else as 0.
    """

    def __init__(self, message: Message) -> None:
        bits = 8 * message.length
        used = 0  # the lowest bit of the first byte is the lowest
        intel: dict[int, Signal] = {}
        motorola: dict[int, Signal] = {}
        for signal in message.signals:
            if signal.byte_order == "little_endian":
                # ``start`` is the lowest bit; the bytes will be reversed.
                intel[bits - signal.start - signal.length] = signal
                used |= _ones(signal.length) << signal.start
            else:
                # ``start`` is the highest bit, counted from the right within its byte.
                first = signal.start // 8 * 8 + 7 - signal.start % 8
                motorola[first] = signal
                place = _ones(signal.length) << (bits - first - signal.length)
                used |= int.from_bytes(place.to_bytes(message.length, "big"), "little")
        self._intel = _compiled(intel, bits)
        self._motorola = _compiled(motorola, bits) if motorola else None
        self._unused = _ones(bits) & ~used if is_j1939(message) else 0
        self.length = message.length

    def decode(self, data: bytes) -> dict[str, Any]:
        """Return the raw value of every signal, by name.

        Args:
            data: exactly as many bytes as the message has.
        """
        values: dict[str, Any] = self._intel.unpack(data[::-1])
        if self._motorola is not None:
            values.update(self._motorola.unpack(data))
        return values

    def encode(self, raw: dict[str, Any]) -> bytes:
        """Return the bytes of the message.

        Args:
            raw: raw value of every signal, by name; a whole number where the signal is no float.

        Raises:
            OverflowError: a value does not fit into the bits of its signal (bitstruct.Error where
                bitstruct has no compiled part).
        """
        data: bytes = self._intel.pack(raw)[::-1]
        if self._motorola is not None:
            data = bytes(a | b for a, b in zip(data, self._motorola.pack(raw), strict=True))
        if self._unused:
            data = (int.from_bytes(data, "little") | self._unused).to_bytes(self.length, "little")
        return data


def is_fd(message: Message) -> bool:
    """Return whether a message is CAN FD: by the DBC, or by over 8 bytes that are not J1939."""
    return message.is_fd or (message.length > CLASSICAL_BYTES and not is_j1939(message))


def frame_length(message: Message) -> int:
    """Return the length of a message's frames, bytes; CAN FD pads to the next length up to 64."""
    if not is_fd(message):
        return message.length
    return next((n for n in FD_LENGTHS if n >= message.length), message.length)


def is_j1939(message: Message) -> bool:
    """Return whether the DBC marks a message as J1939 (VFrameFormat J1939PG)."""
    return message.protocol == "j1939"


def _ones(count: int) -> int:
    return (1 << count) - 1


def _compiled(places: dict[int, Signal], bits: int) -> Any:
    """Compile a bitstruct format: signals by their first bit, padding between them."""
    text, names, at = "", [], 0
    for first, signal in sorted(places.items()):
        if first > at:
            text += f"p{first - at}"
        kind = "f" if signal.is_float else "s" if signal.is_signed else "u"
        text += f"{kind}{signal.length}"
        names.append(signal.name)
        at = first + signal.length
    if bits > at:
        text += f"p{bits - at}"
    return compile_format(text, names)
