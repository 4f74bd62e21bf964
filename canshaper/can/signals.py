"""Signals of a DBC message: raw codes are tested first, then scaled.

cantools scales whatever it finds: an error code of 1022 at 0.1 % per bit becomes 102.2 %. So
everything here is decoded raw (``decode_choices=False, scaling=False``) and judged raw.
"""

import math
import re
from dataclasses import dataclass
from typing import Any

from cantools.database.can import Message, Signal

from canshaper.shaping.states import Reason

# Names that the tables of a DBC give to raw values that are no measurement.
_NOT_AVAILABLE = re.compile(r"not.?avail|^(na|n/a|sna)$", re.IGNORECASE)
_ERROR = re.compile(r"err|fault|fail|invalid|reserved|defect|not.?valid", re.IGNORECASE)


def find_signal(message: Message, name: str) -> Signal | None:
    """Signal of that name, or None."""
    return next((s for s in message.signals if s.name == name), None)


def raw_limits(signal: Signal) -> tuple[int, int]:
    """Smallest and largest raw value that the bits of an integer signal hold."""
    if signal.is_signed:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def symmetrical_range(signal: Signal) -> str | None:
    """Why the DBC range of a velocity signal cannot serve as full scale, or None when it can."""
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or high <= low:
        return f"{signal.name} has no range in the DBC; full speed is taken from it"
    if not math.isclose(-low, high):
        return f"{signal.name} has the range [{low:g}|{high:g}]; allowed is a symmetrical one"
    if not signal.is_float:
        raw_low, raw_high = raw_limits(signal)
        ends = [(v - signal.offset) / signal.scale for v in (low, high)]
        if min(ends) < raw_low or max(ends) > raw_high:
            return (
                f"{signal.name} cannot reach its range [{low:g}|{high:g}] with {signal.length}"
                f" bits at {signal.scale:g} per bit"
            )
    return None


@dataclass(frozen=True, slots=True)
class VelocitySignal:
    """Signed velocity of a stick: raw value to command or fault."""

    name: str
    scale: float
    offset: float
    full: float
    special: dict[Any, Reason]

    @classmethod
    def of(cls, signal: Signal) -> "VelocitySignal":
        """Bind a DBC signal whose range is symmetrical (``symmetrical_range``)."""
        full = float(signal.maximum or 0.0)
        special: dict[Any, Reason] = {}
        for raw, name in (signal.choices or {}).items():
            if _NOT_AVAILABLE.search(str(name)):
                special[raw] = Reason.STICK_NOT_AVAILABLE
            elif _ERROR.search(str(name)):
                special[raw] = Reason.STICK_ERROR
        return cls(signal.name, signal.scale, signal.offset, full, special)

    def command(self, raw: float) -> float | Reason:
        """Command in [-1, 1], or why the raw value is none."""
        fault = self.special.get(raw)
        if fault is not None:
            return fault
        value = (raw * self.scale + self.offset) / self.full
        if not math.isfinite(value):
            return Reason.STICK_NOT_A_NUMBER
        # A millionth covers the rounding of scale and offset, less than any resolution.
        if abs(value) > 1.000001:
            return Reason.STICK_OUT_OF_RANGE
        return min(max(value, -1.0), 1.0)


class FieldSet:
    """Physical values to the raw fields of one message; what is not set keeps its start value."""

    def __init__(self, message: Message) -> None:
        self.message = message
        self._base: dict[str, Any] = {s.name: self._start(s) for s in message.signals}
        self._fields = {
            s.name: (s.scale, s.offset, *raw_limits(s)) for s in message.signals if not s.is_float
        }

    @staticmethod
    def _start(signal: Signal) -> int:
        """GenSigStartValue (a raw value), within the bits of the signal."""
        low, high = raw_limits(signal)
        return min(max(int(signal.raw_initial or 0), low), high)

    def raw(self, name: str, value: float) -> int:
        """Raw value nearest to a physical one, held within the bits of the signal.

        Held, not refused: a status beyond its range shall still be seen.
        """
        scale, offset, low, high = self._fields[name]
        return min(max(round((value - offset) / scale), low), high)

    def encode(self, raw: dict[str, int]) -> bytes:
        """Data of the message with these raw values."""
        return self.message.encode({**self._base, **raw}, scaling=False, strict=False)
