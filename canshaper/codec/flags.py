"""Commands without a sign: a magnitude with flags as in J1939-71, or a signal a direction."""

from dataclasses import dataclass
from typing import Any, Protocol

from canshaper.codec.signals import ROUNDING, VelocitySignal
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


class Velocity(Protocol):
    """Reads the velocity that moves an axis from the raw values of a joystick's frame."""

    @property
    def name(self) -> str:
        """Name of its signal."""

    def read(self, raw: dict[str, Any], /) -> float | Reason:
        """Command in [-1, 1], or why there is none."""


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
