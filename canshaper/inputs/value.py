"""One number out of a message, while it is fresh: a radius, a weight, a choice, a flow."""

import sys

from cantools.database.can import Signal

from canshaper.codec.frame import FrameFault
from canshaper.codec.signals import special_codes
from canshaper.inputs.input import GOOD, Input, Raw
from canshaper.machine.inputs import BoundInput

LARGEST = sys.float_info.max


class MeasuredSignal:
    """A signal with a range: an error code is no value, nor what lies outside, or is no number.

    Args:
        signal: the signal of the DBC.
        low: smallest value that is one.
        high: largest.

    Attributes:
        name: of the signal.
    """

    __slots__ = ("_high", "_low", "_offset", "_scale", "_special", "name")

    def __init__(self, signal: Signal, low: float, high: float) -> None:
        self.name, self._scale, self._offset = signal.name, signal.scale, signal.offset
        self._special = special_codes(signal)
        self._low, self._high = low, high

    def value(self, raw: Raw) -> float | None:
        """Its value by the raw values of a message, in the DBC's unit; None where it is none."""
        code = raw[self.name]
        value: float = code * self._scale + self._offset
        return value if code not in self._special and self._low <= value <= self._high else None


class ValueInput(Input):
    """The value of one signal.

    Args:
        bound: its message.
        signal: the signal.
        low: smallest value that is one; by default every number.
        high: largest.

    Attributes:
        value: the last one that counted, in the unit of the DBC.
        measured_ns: when it arrived; None when there is none.
    """

    def __init__(
        self, bound: BoundInput, signal: Signal, low: float = -LARGEST, high: float = LARGEST
    ) -> None:
        super().__init__(bound)
        self._signal = MeasuredSignal(signal, low, high)
        self.value = 0.0
        self.measured_ns: int | None = None

    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """What is no value is a fault."""
        value = self._signal.value(raw)
        if value is None:
            return FrameFault.INVALID_SIGNAL
        if accepted:
            self.value, self.measured_ns = value, arrived_ns
        return GOOD

    def fresh(self, now_ns: int) -> float | None:
        """The value; None while it is not known."""
        if self.measured_ns is None or now_ns - self.measured_ns > self._timeout_ns:
            return None
        return self.value

    def invalidate(self) -> None:
        """Nothing received so far counts any more."""
        super().invalidate()
        self.measured_ns = None


def measurable(signal: Signal) -> tuple[float, float]:
    """What of a signal can be a measurement; a millionth more, for the rounding of decimals."""
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or high <= low:
        return -LARGEST, LARGEST
    return low - 1e-6 * (high - low), high + 1e-6 * (high - low)
