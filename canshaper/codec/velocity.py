"""Velocities in frames: decodes the signals of a joystick, encodes the signals of a valve."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cantools.database.can import Signal

from canshaper.codec.message import SentMessage
from canshaper.codec.signals import ROUNDING, full_scale, special_codes, valve_steps
from canshaper.shaping.states import Reason

# Largest position that the neutral flag permits, as part of full scale: neutral switch and position
# sensor are two parts and do not switch at one angle. More means a broken sensor.
SMALL_IN_NEUTRAL = 0.05
# Flags (neutral, negative, positive) to sign and largest position; every other set is
# contradictory. No flag at all means neutral while the position is 0: a joystick may stand between
# the neutral switch and a direction's switch, and 0 moves nothing whatever the direction.
_DIRECTIONS = {
    (0, 0, 1): (1.0, 1.0),
    (0, 1, 0): (-1.0, 1.0),
    (1, 0, 0): (0.0, SMALL_IN_NEUTRAL),
    (0, 0, 0): (0.0, ROUNDING),
}
# Code of two bits in J1939-71 for a signal that does not exist; 2 and all above 3 are errors.
_NOT_AVAILABLE = 3


@dataclass(frozen=True, slots=True)
class VelocitySignal:
    """Reads the signed velocity of a joystick: raw value to command or fault.

    ``full`` is the value at full command, in the signal's unit; ``low`` and ``high`` bound the
    accepted parts of full scale, and ``special`` has the reason of each code.
    """

    name: str
    scale: float
    offset: float
    full: float
    special: dict[Any, Reason]
    low: float = -1.0 - ROUNDING
    high: float = 1.0 + ROUNDING

    @classmethod
    def of(cls, signal: Signal) -> "VelocitySignal":
        """Return the reader of a DBC signal.

        ``symmetrical_range`` or ``magnitude_range`` has found no fault in its range.
        """
        full = full_scale(signal)
        low, high = (signal.minimum or 0.0) / full, (signal.maximum or 0.0) / full
        ends = min(low, -1.0) - ROUNDING, high + ROUNDING
        return cls(signal.name, signal.scale, signal.offset, full, special_codes(signal), *ends)

    def read(self, raw: dict[str, Any]) -> float | Reason:
        """Return the part of full scale in [-1, 1] from a frame's raw values, or its fault."""
        code: float = raw[self.name]
        fault = self.special.get(code)
        if fault is not None:
            return fault
        value: float = (code * self.scale + self.offset) / self.full
        if -1.0 <= value <= 1.0:
            return value
        if not math.isfinite(value):
            return Reason.JOYSTICK_NOT_A_NUMBER
        if not self.low <= value <= self.high:
            return Reason.JOYSTICK_OUT_OF_RANGE
        return math.copysign(1.0, value)


@dataclass(frozen=True, slots=True)
class FlaggedVelocity:
    """Velocity of a joystick with direction flags: raw values of a frame to command or fault.

    Attributes:
        magnitude: signal of the magnitude (``magnitude_range``).
        neutral: name of the flag that the joystick is in neutral.
        negative: name of the flag that the command is negative.
        positive: name of the flag that the command is positive.
    """

    magnitude: VelocitySignal
    neutral: str
    negative: str
    positive: str

    @property
    def name(self) -> str:
        """Name of the signal of the magnitude."""
        return self.magnitude.name

    def read(self, raw: dict[str, Any]) -> float | Reason:
        """Return the command in [-1, 1] from a frame's raw values, or why it has none.

        Position and flags come from separate sensors: where they disagree, neither counts.
        """
        size = self.magnitude.read(raw)
        if isinstance(size, Reason):
            return size
        if size < -ROUNDING:
            return Reason.JOYSTICK_OUT_OF_RANGE
        flags = raw[self.neutral], raw[self.negative], raw[self.positive]
        direction = _DIRECTIONS.get(flags)
        if direction is None:
            return _fault(flags)
        sign, largest = direction
        if size > largest:
            return Reason.JOYSTICK_CONTRADICTORY
        return sign * size if size > ROUNDING else 0.0


@dataclass(frozen=True, slots=True)
class RockerVelocity:
    """Velocity of a rocker with a signal for each direction: proportional signals or two buttons.

    Attributes:
        positive: signal of the positive direction (``magnitude_range``).
        negative: signal of the negative direction.
    """

    positive: VelocitySignal
    negative: VelocitySignal

    @property
    def name(self) -> str:
        """Name of the signal of the positive direction."""
        return self.positive.name

    def read(self, raw: dict[str, Any]) -> float | Reason:
        """Return the command in [-1, 1] from a frame's raw values, or why it has none.

        A rocker cannot be pressed both ways: where both signals say so, neither counts.
        """
        positive, negative = self.positive.read(raw), self.negative.read(raw)
        if isinstance(positive, Reason):
            return positive
        if isinstance(negative, Reason):
            return negative
        if min(positive, negative) < -ROUNDING:
            return Reason.JOYSTICK_OUT_OF_RANGE
        if min(positive, negative) > SMALL_IN_NEUTRAL:
            return Reason.JOYSTICK_CONTRADICTORY
        return positive - negative


def _fault(flags: tuple[int, int, int]) -> Reason:
    """Return the reason why (neutral, negative, positive) show no direction."""
    codes = {flag for flag in flags if flag > 1}
    if not codes:
        return Reason.JOYSTICK_CONTRADICTORY
    return Reason.JOYSTICK_NOT_AVAILABLE if codes == {_NOT_AVAILABLE} else Reason.JOYSTICK_ERROR


Velocity = VelocitySignal | FlaggedVelocity | RockerVelocity
"""Reads the velocity that moves an axis from the raw values of a joystick's frame."""


@dataclass(frozen=True, slots=True)
class DirectionCodec:
    """Signal with a code for the direction of a magnitude, such as the valve state of ISO 11783-7.

    Attributes:
        signal: name of the signal.
        codes: raw codes of neutral, positive and negative commands, in this order.
    """

    signal: str
    codes: tuple[int, int, int]

    def put(self, raw: dict[str, Any], sign: int) -> None:
        """Write a sign: 0 for neutral, 1 or -1."""
        raw[self.signal] = self.codes[sign]  # the last one is that of -1

    def read(self, raw: Mapping[str, Any]) -> int | None:
        """Return the sign: 0, 1 or -1; None where the code is no direction."""
        return dict(zip(self.codes, (0, 1, -1), strict=True)).get(raw[self.signal])


@dataclass(frozen=True, slots=True)
class FlagsCodec:
    """Three flags that carry the direction of a magnitude, as joysticks of J1939-71 do.

    Attributes:
        signals: names of the flags of neutral, of positive and of negative, in this order.
    """

    signals: tuple[str, str, str]

    def put(self, raw: dict[str, Any], sign: int) -> None:
        """Write a sign: 0 for neutral, 1 or -1."""
        for name, of in zip(self.signals, (0, 1, -1), strict=True):
            raw[name] = int(of == sign)

    def read(self, raw: Mapping[str, Any]) -> int | None:
        """Return the sign: 0, 1 or -1; None unless exactly one flag is set."""
        signs = [of for n, of in zip(self.signals, (0, 1, -1), strict=True) if raw[n] == 1]
        return signs[0] if len(signs) == 1 else None


Direction = DirectionCodec | FlagsCodec
"""Signals that carry the direction of a magnitude."""


class ValveCodec:
    """Writes the command of one axis, a whole number of steps, into its signals, and reads it.

    Args:
        message: the message that carries the command; its start values become neutral.
        signal: signal of the command; with ``direction`` or ``negative`` of its magnitude.
        direction: signals that carry the direction; None where the command is signed.
        negative: signal of the magnitude of negative commands, scaled as ``signal``, where each
            direction has a signal of its own.
        also: signals that carry the same command in another resolution.

    Attributes:
        steps: steps from zero to full command.
        zero, sign: raw value at zero; -1 where the raw value falls as the command rises.
    """

    def __init__(
        self,
        message: SentMessage,
        signal: Signal,
        direction: Direction | None = None,
        also: Sequence[Signal] = (),
        negative: Signal | None = None,
    ) -> None:
        self.message = message
        self.steps = _steps(signal)
        self._signal = signal.name
        self.zero, self.sign = _zero(signal), 1 if signal.scale > 0 else -1
        self._direction = direction
        self._negative = negative.name if negative else None
        self._also = [(s.name, _zero(s), _steps(s) * (1 if s.scale > 0 else -1)) for s in also]
        self._plain = not (direction or negative or also)  # nearly every valve
        self.put(message.start, 0)

    def put(self, raw: dict[str, Any], steps: int) -> None:
        """Put a command into the raw values of the message.

        Args:
            raw: raw values, by signal; changed in place.
            steps: the command; negative for the negative direction.

        Raises:
            ValueError: the command is beyond full command.
        """
        if not -self.steps <= steps <= self.steps:
            raise ValueError(f"valve command: expected up to +-{self.steps} steps, got {steps}")
        if self._plain:
            raw[self._signal] = self.zero + self.sign * steps
            return
        size = steps
        if self._direction is not None:
            self._direction.put(raw, (steps > 0) - (steps < 0))
            size = abs(steps)
        elif self._negative is not None:
            size = max(steps, 0)
            raw[self._negative] = self.zero + self.sign * max(-steps, 0)
        raw[self._signal] = self.zero + self.sign * size
        for name, zero, full in self._also:
            raw[name] = zero + round(full * size / self.steps)

    def read(self, raw: Mapping[str, Any]) -> int | None:
        """Return the signed steps in raw values, without ``also``; None for no valid command."""
        steps = self.sign * (int(raw[self._signal]) - self.zero)
        if self._direction is not None:
            sign = self._direction.read(raw)
            if sign is None or steps < 0:
                return None
            steps *= sign
        elif self._negative is not None:
            back = self.sign * (int(raw[self._negative]) - self.zero)
            if min(steps, back) != 0:
                return None
            steps -= back
        return steps if abs(steps) <= self.steps else None


def _steps(signal: Signal) -> int:
    return valve_steps(full_scale(signal), abs(signal.scale))


def _zero(signal: Signal) -> int:
    return round(-signal.offset / signal.scale)
