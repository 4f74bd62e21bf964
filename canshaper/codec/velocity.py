"""Velocities in frames: what the signals of a joystick say, and what those of a valve are given."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cantools.database.can import Signal

from canshaper.codec.message import SentMessage
from canshaper.codec.signals import ROUNDING, full_scale, special_codes, valve_steps
from canshaper.shaping.states import Reason

# The position that may stand next to the neutral flag, as a part of full: neutral switch and
# position sensor are two parts and do not meet at one angle. More is a sensor that is broken.
SMALL_IN_NEUTRAL = 0.05
# (neutral, negative, positive) to sign and largest position; every other set is contradictory. No
# flag at all is none while the position is 0: a joystick may stand between the neutral switch and
# the switch of a direction, and 0 moves nothing whatever the direction.
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
    """Signed velocity of a joystick: raw value to command or fault."""

    name: str
    scale: float
    offset: float
    full: float
    special: dict[Any, Reason]
    low: float = -1.0 - ROUNDING
    high: float = 1.0 + ROUNDING

    @classmethod
    def of(cls, signal: Signal) -> "VelocitySignal":
        """Return the reader of a DBC signal as a part of full scale.

        Its range has to be one of ``symmetrical_range`` or ``magnitude_range``.
        """
        full = full_scale(signal)
        low, high = (signal.minimum or 0.0) / full, (signal.maximum or 0.0) / full
        ends = min(low, -1.0) - ROUNDING, high + ROUNDING
        return cls(signal.name, signal.scale, signal.offset, full, special_codes(signal), *ends)

    def read(self, raw: dict[str, Any]) -> float | Reason:
        """Part of full scale in [-1, 1] from the raw values of a frame, or why there is none."""
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
        """Command in [-1, 1] from the raw values of a frame, or why there is none.

        Position and flags come from sensors of their own: where they do not agree, neither counts.
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
        negative: signal of the negative one.
    """

    positive: VelocitySignal
    negative: VelocitySignal

    @property
    def name(self) -> str:
        """Name of the signal of the positive direction."""
        return self.positive.name

    def read(self, raw: dict[str, Any]) -> float | Reason:
        """Command in [-1, 1] from the raw values of a frame, or why there is none.

        One part cannot be pressed both ways: then neither counts.
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
    """Why these flags show no direction."""
    codes = {flag for flag in flags if flag > 1}
    if not codes:
        return Reason.JOYSTICK_CONTRADICTORY
    return Reason.JOYSTICK_NOT_AVAILABLE if codes == {_NOT_AVAILABLE} else Reason.JOYSTICK_ERROR


Velocity = VelocitySignal | FlaggedVelocity | RockerVelocity
"""Reads the velocity that moves an axis from the raw values of a joystick's frame."""


@dataclass(frozen=True, slots=True)
class DirectionCodec:
    """Signal that carries the direction of a magnitude, as the valve state of ISO 11783-7 does.

    Attributes:
        signal: its name.
        codes: raw codes of neutral, of positive and of negative commands, in this order.
    """

    signal: str
    codes: tuple[int, int, int]

    def put(self, raw: dict[str, Any], sign: int) -> None:
        """Write a sign: 0 for neutral, 1 or -1."""
        raw[self.signal] = self.codes[sign]  # the last one is that of -1

    def read(self, raw: Mapping[str, Any]) -> int | None:
        """Return the sign; None where the code is no direction."""
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
        """Return the sign; None where the flags are no direction."""
        signs = [of for n, of in zip(self.signals, (0, 1, -1), strict=True) if raw[n] == 1]
        return signs[0] if len(signs) == 1 else None


Direction = DirectionCodec | FlagsCodec
"""Signals that carry the direction of a magnitude."""


class ValveCodec:
    """Command of one axis: a whole number of steps, to its signals and back.

    Args:
        message: the message it is sent in.
        signal: the command; with a direction its magnitude.
        direction: where the direction stands, if not by the sign.
        negative: magnitude of negative commands, where they have a signal of their own, which is
            like that of the positive ones.
        also: signals that carry the same in another resolution.

    Attributes:
        steps: steps from zero to full command.
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
        self._zero, self._sign = _zero(signal), 1 if signal.scale > 0 else -1
        self._direction = direction
        self._negative = negative.name if negative else None
        self._also = [(s.name, _zero(s), _steps(s) * (1 if s.scale > 0 else -1)) for s in also]
        self._plain = not (direction or negative or also)  # nearly every valve
        self.put(message.start, 0)

    def put(self, raw: dict[str, Any], steps: int) -> None:
        """Put a command into the message.

        Args:
            raw: raw values of the message, by signal.
            steps: the command; negative for the negative direction.

        Raises:
            ValueError: it is beyond full command.
        """
        if not -self.steps <= steps <= self.steps:
            raise ValueError(f"valve command: expected up to +-{self.steps} steps, got {steps}")
        if self._plain:
            raw[self._signal] = self._zero + self._sign * steps
            return
        size = steps
        if self._direction is not None:
            self._direction.put(raw, (steps > 0) - (steps < 0))
            size = abs(steps)
        elif self._negative is not None:
            size = max(steps, 0)
            raw[self._negative] = self._zero + self._sign * max(-steps, 0)
        raw[self._signal] = self._zero + self._sign * size
        for name, zero, full in self._also:
            raw[name] = zero + round(full * size / self.steps)

    def read(self, raw: Mapping[str, Any]) -> int | None:
        """Return the steps of a command from raw values; None where they are no command."""
        steps = self._sign * (int(raw[self._signal]) - self._zero)
        if self._direction is not None:
            sign = self._direction.read(raw)
            if sign is None or steps < 0:
                return None
            steps *= sign
        elif self._negative is not None:
            back = self._sign * (int(raw[self._negative]) - self._zero)
            if min(steps, back) != 0:
                return None
            steps -= back
        return steps if abs(steps) <= self.steps else None


def _steps(signal: Signal) -> int:
    return valve_steps(full_scale(signal), abs(signal.scale))


def _zero(signal: Signal) -> int:
    return round(-signal.offset / signal.scale)
