"""What the output guard reads in the bytes of a frame: bits by masks of its own.

Everything is computed once, at the start, from the signals as cantools has loaded them. Nothing of
the codecs with which the controller reads and writes the same frames is used: a mistake in them
must not be a mistake here too.
"""

import math
import struct
from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import Literal

from cantools.database.can import Message, Signal

from canshaper.codec.signals import find_signal, special_codes
from canshaper.config.schema import Command, Valve

# Part of full scale; more than the rounding of scale and offset, less than any resolution.
ROUNDING = 1e-6
# What rounding may take from a command in another resolution, in its steps.
HALF = 0.5 + ROUNDING
# Values of a signal that are kept once read, so that a fine one does not fill the memory.
MOST_KNOWN = 4096
_FLOATS = {16: "<e", 32: "<f", 64: "<d"}


def span_of(bits: int) -> slice:
    """The bytes from the first to the last with any of these bits, byte 0 the lowest."""
    first = (bits & -bits).bit_length() - 1
    return slice(first // 8, (bits.bit_length() + 7) // 8)


class Field:
    """Raw value of one signal.

    Attributes:
        bits: where it lies, byte 0 the lowest.
    """

    __slots__ = ("_float", "_mask", "_order", "_shift", "_sign", "bits")

    def __init__(self, signal: Signal, length: int) -> None:
        big = signal.byte_order == "big_endian"
        # Of Intel ``start`` is the lowest bit; of Motorola the highest, counted within its byte.
        first = signal.start // 8 * 8 + 7 - signal.start % 8
        self._shift = 8 * length - first - signal.length if big else signal.start
        self._order: Literal["big", "little"] = "big" if big else "little"
        self._mask = (1 << signal.length) - 1
        self._sign = 1 << signal.length - 1 if signal.is_signed and not signal.is_float else 0
        self._float = struct.Struct(_FLOATS[signal.length]) if signal.is_float else None
        data = (self._mask << self._shift).to_bytes(length, self._order)
        self.bits = int.from_bytes(data, "little")

    def raw(self, data: bytes) -> float:
        """Raw value, of a float signal the float."""
        raw = int.from_bytes(data, self._order) >> self._shift & self._mask
        if self._float is not None:
            value: float = self._float.unpack(raw.to_bytes(self._float.size, "little"))[0]
            return value
        return raw - 2 * self._sign if raw & self._sign else raw


class Part:
    """Value of a signal as a part of its DBC range."""

    __slots__ = ("_full", "_high", "_low", "_offset", "_scale", "_special", "field")

    def __init__(self, signal: Signal, length: int) -> None:
        self.field = Field(signal, length)
        self._scale, self._offset = signal.scale, signal.offset
        low, high = signal.minimum or 0.0, signal.maximum or 0.0
        # One raw step more on one side is full, as two's complement has it.
        self._full = full = _full(signal)
        self._low, self._high = min(low / full, -1.0) - ROUNDING, high / full + ROUNDING
        self._special = frozenset(special_codes(signal))

    def value(self, data: bytes) -> float:
        """In [-1, 1]; 0 where it is none: an error code, not available, out of range."""
        raw = self.field.raw(data)
        value = (raw * self._scale + self._offset) / self._full
        # ``not`` first: what is no number is in no range.
        if not self._low <= value <= self._high or raw in self._special:
            return 0.0
        return min(max(value, -1.0), 1.0)


class JoystickBits:
    """The command of one axis in a joystick frame.

    Attributes:
        fields: every field that it is read from.
        span: the bytes with all of them.
    """

    def __init__(self, message: Message, joystick: Command) -> None:
        length = message.length
        self._part = Part(_signal(message, joystick.signal), length)
        self._negative = (
            Part(_signal(message, joystick.negative), length) if joystick.negative else None
        )
        self._flags: tuple[Field, ...] = ()
        if flags := joystick.flags:
            names = (flags.neutral, flags.positive, flags.negative)
            self._flags = tuple(Field(_signal(message, name), length) for name in names)
        self._band = joystick.neutral_pct / 100.0 - ROUNDING
        self.fields = [self._part.field, *self._flags]
        self.fields += [self._negative.field] if self._negative else []
        self.span = span_of(reduce(or_, (field.bits for field in self.fields)))

    def command(self, data: bytes) -> float:
        """Part of full speed, [-1, 1]; 0 in neutral."""
        command = self._part.value(data)
        if self._negative is not None:
            command -= self._negative.value(data)
        elif self._flags:
            flags = [flag.raw(data) for flag in self._flags]
            command *= _SIGNS.get(tuple(flags), 0)
        return command if abs(command) > self._band else 0.0


class CommandBits:
    """The command of one axis in a valve frame.

    Attributes:
        full: steps of the command from zero to full.
        span: bytes with the signals that carry it.
    """

    def __init__(self, message: Message, valve: Valve, joystick: Command | None) -> None:
        """``joystick`` is that of a joystick whose own message carries the command, else None."""
        length = message.length
        signal = _signal(message, valve.signal)
        self._size, self._zero, self._sign, self.full = _steps(signal, length)
        self._codes = _SIGNS
        self._direction: tuple[Field, ...] = ()
        if direction := valve.direction:
            self._direction = (Field(_signal(message, direction.signal), length),)
            codes = (direction.neutral, direction.positive, direction.negative)
            self._codes = {(code,): sign for code, sign in zip(codes, (0, 1, -1), strict=True)}
        elif joystick and (flags := joystick.flags):
            names = (flags.neutral, flags.positive, flags.negative)
            self._direction = tuple(Field(_signal(message, name), length) for name in names)
        self._back: Field | None = None
        if joystick and joystick.negative:
            self._back = _steps(_signal(message, joystick.negative), length)[0]
        self._also = [_steps(_signal(message, name), length) for name in valve.also]
        fields = [self._size, *self._direction, *(also[0] for also in self._also)]
        fields += [self._back] if self._back else []
        self.span = span_of(reduce(or_, (field.bits for field in fields)))

    def steps(self, data: bytes) -> int | None:
        """Steps of the command, with their sign: 0 where every signal says that there is none.

        Returns:
            None where the signals contradict each other.
        """
        size = steps = int(self._sign * (self._size.raw(data) - self._zero))
        if self._direction:
            sign = self._codes.get(tuple([field.raw(data) for field in self._direction]))
            # No direction without a command, and no command without a direction.
            if sign is None or steps < 0 or (steps == 0) != (sign == 0):
                return None
            steps *= sign
        elif self._back is not None:
            back = int(self._sign * (self._back.raw(data) - self._zero))
            if size < 0 or back < 0 or (size and back):
                return None
            steps -= back
        for field, zero, sign, full in self._also:
            if abs(sign * (field.raw(data) - zero) - full * size / self.full) > HALF:
                return None
        return steps


# (neutral, positive, negative) to the sign that they carry.
_SIGNS: Mapping[tuple[float, ...], int] = {(1, 0, 0): 0, (0, 1, 0): 1, (0, 0, 1): -1}


def _signal(message: Message, name: str) -> Signal:
    signal = find_signal(message, name)
    assert signal is not None  # checked with the deployment
    return signal


def _full(signal: Signal) -> float:
    """The nearer end of a range around 0, else its upper end."""
    ends = (signal.maximum or 0.0, -(signal.minimum or 0.0))
    return min(ends) if ends[1] > 0.0 else ends[0]


def _steps(signal: Signal, length: int) -> tuple[Field, int, int, int]:
    """Of a command signal its field, raw value of zero, sign of a raw step, and steps to full."""
    full = math.floor(_full(signal) / abs(signal.scale) + ROUNDING)
    zero = round(-signal.offset / signal.scale)
    return Field(signal, length), zero, 1 if signal.scale > 0 else -1, full
