"""Sets of sway data and filter: one for an empty grapple, one for a full one, and all between."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from canshaper.shaping.registry import KINDS
from canshaper.shaping.sway import SwayMode

# Positions between two sets that differ: 1 to 2 % of their difference.
STEPS_BETWEEN = 64


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """Sway of an axis and its filter.

    Attributes:
        at: value of the signal at which it holds.
        mode: the sway.
        kind: name of the filter in the registry.
        parameters: its parameters by the names of the registry.
    """

    at: float
    mode: SwayMode
    kind: str
    parameters: dict[str, Any]


def position(sets: Sequence[ParameterSet], value: float) -> int:
    """Where a value lies among sets in rising order, in steps; beyond the ends at the ends."""
    values = [one.at for one in sets]
    if value <= values[0]:
        return 0
    if value >= values[-1]:
        return (len(sets) - 1) * STEPS_BETWEEN
    low = bisect_right(values, value) - 1
    share = (value - values[low]) / (values[low + 1] - values[low])
    return low * STEPS_BETWEEN + round(share * STEPS_BETWEEN)


def at_position(sets: Sequence[ParameterSet], steps: int) -> ParameterSet:
    """The set at a position, between two of them interpolated.

    Period, damping ratio, poles, taps and every other number run in straight lines; so poles stay
    real and negative, and taps stay taps with the sum 1.
    """
    low, part = divmod(steps, STEPS_BETWEEN)
    if not part:
        return sets[low]
    first, second = sets[low], sets[low + 1]
    share = part / STEPS_BETWEEN
    mode = first.mode.towards(second.mode, share)
    one, two = first.parameters, second.parameters
    if (interpolable := KINDS[first.kind].interpolable) is not None:
        one, two = interpolable(one), interpolable(two)
    parameters = {name: _between(one[name], two[name], share) for name in one.keys() & two.keys()}
    whole = (name for name, value in one.items() if isinstance(value, int))
    parameters |= {name: round(parameters[name]) for name in whole if name in parameters}
    at = _between(first.at, second.at, share)
    return ParameterSet(at, mode, first.kind, parameters)


def _between(first: Any, second: Any, share: float) -> Any:
    if isinstance(first, Sequence):
        pairs = zip_longest(first, second, fillvalue=0.0)
        return [a + share * (b - a) for a, b in pairs]
    return first + share * (second - first)
