"""One number out of a message, while it is fresh: a radius, a weight, a profile, a flow."""

import math
import sys
from collections import deque
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Protocol, Self

from cantools.database.can import Signal

from canshaper.codec.frame import FrameFault
from canshaper.codec.signals import special_codes
from canshaper.config.limits import Position
from canshaper.config.schema import DeploymentConfig
from canshaper.config.schema import FeedbackSection as FeedbackConfig
from canshaper.inputs.input import GOOD, Input, Raw
from canshaper.inputs.joystick import JoystickInput
from canshaper.machine.inputs import BoundInput, BoundValue

LARGEST = sys.float_info.max


class MeasuredSignal:
    """A signal with a range. An error code, a number out of the range and a NaN are no values.

    Args:
        signal: the signal of the DBC.
        low: smallest valid value.
        high: largest valid value.

    Attributes:
        name: name of the signal.
    """

    __slots__ = ("_high", "_low", "_offset", "_scale", "_special", "name")

    def __init__(self, signal: Signal, low: float, high: float) -> None:
        self.name, self._scale, self._offset = signal.name, signal.scale, signal.offset
        self._special = special_codes(signal)
        self._low, self._high = low, high

    def value(self, raw: Raw) -> float | None:
        """Return its value from the raw values of a message, in the DBC's unit; None for none."""
        code = raw[self.name]
        value: float = code * self._scale + self._offset
        return value if code not in self._special and self._low <= value <= self._high else None


class Value:
    """Last value of one signal, in a message that may carry others.

    Args:
        signal: the signal.
        low: smallest valid value.
        high: largest valid value.
        timeout_ms: age after which the value is no longer known.

    Attributes:
        value: last valid value, in the unit of the DBC.
        measured_ns: arrival of that value; None while there is none.
    """

    def __init__(self, signal: Signal, low: float, high: float, timeout_ms: int) -> None:
        self._signal = MeasuredSignal(signal, low, high)
        self._timeout_ns = timeout_ms * 1_000_000
        self.value = 0.0
        self.measured_ns: int | None = None

    def take(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Take the value of an accepted frame; in any frame a code that is no value is a fault."""
        value = self._signal.value(raw)
        if value is None:
            return FrameFault.INVALID_SIGNAL
        if accepted:
            self.value, self.measured_ns = value, arrived_ns
        return GOOD

    def fresh(self, now_ns: int) -> float | None:
        """Return the value; None while there is none that is fresh."""
        if self.measured_ns is None or now_ns - self.measured_ns > self._timeout_ns:
            return None
        return self.value


class PositionInput(Input):
    """A message with measured positions; several parts of a machine may each read one of them.

    Args:
        bound: its message.
    """

    def __init__(self, bound: BoundInput) -> None:
        super().__init__(bound)
        self._values: list[Value] = []

    def read(self, bound: BoundValue[Position]) -> Value:
        """Return a position that accepted frames update, within its signal's range in the DBC."""
        low, high = bound.signal.minimum, bound.signal.maximum
        assert low is not None and high is not None  # checked with the deployment
        value = Value(bound.signal, low, high, bound.config.timeout_ms)
        self._values.append(value)
        return value

    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Take each value of an accepted frame; in any frame a code that is no value is a fault."""
        faults = [value.take(raw, arrived_ns, accepted) for value in self._values]
        return next(filter(None, faults), GOOD)

    def invalidate(self) -> None:
        """Invalidate everything received so far."""
        super().invalidate()
        for value in self._values:
            value.measured_ns = None


class ValueInput(Value, Input):
    """A message of which one signal is read.

    Args:
        bound: its message.
        signal: the signal.
        low: smallest valid value; by default every number is valid.
        high: largest valid value.
    """

    def __init__(
        self, bound: BoundInput, signal: Signal, low: float = -LARGEST, high: float = LARGEST
    ) -> None:
        Input.__init__(self, bound)
        Value.__init__(self, signal, low, high, bound.config.timeout_ms)

    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Take the value of an accepted frame; in any frame a code that is no value is a fault."""
        return self.take(raw, arrived_ns, accepted)

    def invalidate(self) -> None:
        """Invalidate everything received so far."""
        super().invalidate()
        self.measured_ns = None


def measurable(signal: Signal) -> tuple[float, float]:
    """Return the range of a signal's measurements, a millionth wider; all numbers without one."""
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or high <= low:
        return -LARGEST, LARGEST
    return low - 1e-6 * (high - low), high + 1e-6 * (high - low)


OWN = "normal"
"""Name shown for the axes' own filters, whose name in the program is ""."""


class ProfileChoice(Protocol):
    """The operator's choice of a profile."""

    def name(self, now_ns: int) -> str:
        """Return the name of the chosen profile; "" for the axis' own filter."""


class ProfileSwitch:
    """Choice by a switch or display that sends the code of the profile in every frame.

    Args:
        value: signal of the code.
        codes: codes of the profiles by name.
    """

    def __init__(self, value: ValueInput, codes: Mapping[str, int]) -> None:
        self._value = value
        self._names = {float(code): name for name, code in codes.items()}

    def name(self, now_ns: int) -> str:
        """Return the name of the code; "" for any other code, and while it is silent."""
        code = self._value.fresh(now_ns)
        # Scale and offset of the signal may leave a trace of rounding.
        return "" if code is None else self._names.get(round(code, 6), "")


class ProfileButtons:
    """Choice by buttons of joysticks: each press chooses the next profile, in a circle.

    Args:
        joysticks: joysticks that have such a button.
        names: the profiles in their order, beginning with "", the axis' own filter.
    """

    def __init__(self, joysticks: Sequence[JoystickInput], names: Sequence[str]) -> None:
        self._joysticks = tuple(joysticks)
        self._names = tuple(names)

    def name(self, _now_ns: int) -> str:
        """Return the name after all presses since start or reload; a lost joystick adds none."""
        presses = sum(joystick.presses for joystick in self._joysticks)
        return self._names[presses % len(self._names)]


def profile_names(config: DeploymentConfig) -> list[str]:
    """Return every profile, in the order of the file, after "", the axes' own filters."""
    return ["", *dict.fromkeys(name for axis in config.axes.values() for name in axis.profiles)]


class Following(Enum):
    """State of a valve by its feedback."""

    UNKNOWN = "unknown"
    """Nothing was received yet, and it is not late."""
    YES = "following"
    NO = "not-following"
    """The spool is where no setpoint of the settling time asks it to be."""
    LOST = "lost"


class Feedback(ValueInput):
    """Feedback of one valve: estimated flow, or position of the spool.

    Args:
        bound: its message.
        period_s: time between two setpoints, seconds.

    Attributes:
        following: state of the valve by its feedback.
    """

    def __init__(self, bound: BoundValue[FeedbackConfig], period_s: float) -> None:
        config, signal = bound.config, bound.signal
        super().__init__(bound, signal, *measurable(signal))
        self._full = config.full if config.full is not None else float(signal.maximum or 0.0)
        self._tolerance = config.tolerance_pct / 100.0
        self._commands = deque([0.0], maxlen=1 + math.ceil(config.settle_ms / 1000.0 / period_s))
        self._waited_for_ns: int | None = None  # when the wait for the first frame began
        self.following = Following.UNKNOWN

    @property
    def part(self) -> float:
        """The last value as a part of full."""
        return self.value / self._full

    def check(self, sent: float, now_ns: int) -> bool:
        """Compare feedback and recent setpoints; return whether ``following`` has changed.

        Args:
            sent: the setpoint of this tick as a part of full, without the deadband of the valve.
            now_ns: monotonic time.
        """
        # The feedback of now may answer any setpoint of the settling time.
        self._commands.append(sent)
        before = self.following
        if self._waited_for_ns is None:
            self._waited_for_ns = now_ns
        last_ns = self._waited_for_ns if self.measured_ns is None else self.measured_ns
        if now_ns - last_ns > self._timeout_ns:
            self.following = Following.LOST
        elif self.measured_ns is not None:
            low = min(self._commands) - self._tolerance
            high = max(self._commands) + self._tolerance
            self.following = Following.YES if low <= self.part <= high else Following.NO
        return self.following is not before

    def copy_state(self, before: Self) -> None:
        """Keep ``following``, so that a reload does not report the same state again."""
        super().copy_state(before)
        self.following = before.following

    def invalidate(self) -> None:
        """Invalidate everything received so far."""
        super().invalidate()
        self._waited_for_ns = None
