"""Period and damping by stopwatch: swings counted and timed, first and last amplitude read."""

import math

from canshaper.commissioning.identification.decay import Value
from canshaper.errors import IdentificationError

# What a hand adds at either end, and an eye to an angle, as standard deviations.
_HAND_S = 0.15
_EYE_PART = 0.1
_FACTOR = 1.96


def stopwatch(
    swings: float, seconds: float, first_deg: float, last_deg: float
) -> tuple[Value, Value]:
    """Period of small swings in s, and damping ratio.

    Args:
        swings: full swings (there and back) that were counted.
        seconds: that they took.
        first_deg: amplitude at the start, from rest to one side, degrees.
        last_deg: amplitude at the end.

    Raises:
        IdentificationError: a number makes no swing, or too few swings were counted.
    """
    if not swings >= 3:
        raise IdentificationError(f"--swings: expected 3 or more, better 10, got {swings:g}")
    if not 0.15 <= seconds / swings <= 12.0:
        text = f"{seconds / swings:g} s, of {seconds:g} s for {swings:g} swings"
        raise IdentificationError(f"--seconds: expected 0.15 to 12 s a swing, got {text}")
    if not 0.0 < last_deg <= first_deg <= 60.0:
        raise IdentificationError(
            "--first, --last: expected up to 60 degrees, the last one above 0 and not larger than"
            f" the first, got {first_deg:g} and {last_deg:g}"
        )
    decrement = (math.log(first_deg) - math.log(last_deg)) / swings
    ratio = decrement / math.hypot(2.0 * math.pi, decrement)
    # Mean of (1 + A^2/16) over the counted swings: the amplitude falls exponentially.
    square = math.radians(first_deg) ** 2
    if decrement > 0.0:
        square *= -math.expm1(-2.0 * decrement * swings) / (2.0 * decrement * swings)
    period = seconds / swings / (1.0 + square / 16.0)
    period_half = _FACTOR * math.sqrt(2.0) * _HAND_S / swings
    ratio_half = _FACTOR * math.sqrt(2.0) * _EYE_PART / (2.0 * math.pi * swings)
    return Value(period, period_half), Value(ratio, ratio_half)
