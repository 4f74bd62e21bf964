"""Every filter that an axis may run, by the name it has in a deployment file.

The kinds of this package stand in ``canshaper.shaping.shapers``. Another package adds one by an
entry point of the group ``canshaper.shapers`` that names a ``ShaperKind``.
"""

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from itertools import zip_longest
from typing import Any

from canshaper.shaping.shapers import fir, gff, limit_aware, smoothing
from canshaper.shaping.shapers.kind import Shaper, ShaperKind
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import OFF

GROUP = "canshaper.shapers"
BUILT_IN = (OFF, *gff.KINDS, *smoothing.KINDS, *fir.KINDS, *limit_aware.KINDS)


def with_entry_points(
    kinds: Iterable[ShaperKind], points: Iterable[EntryPoint]
) -> tuple[dict[str, ShaperKind], dict[str, EntryPoint], list[tuple[str, str]]]:
    """Return all kinds by name: the given ones, then those of other packages.

    Returns:
        (kinds by name, entry points of the added kinds by name, and (package, fault) of each entry
        point that gives no kind).
    """
    known, added, faults = {kind.name: kind for kind in kinds}, {}, []
    for point in sorted(points):
        package = point.dist.name if point.dist else point.value
        try:
            kind = point.load()
            if not isinstance(kind, ShaperKind):
                raise ValueError(
                    f"expected a ShaperKind, got a value of type {type(kind).__name__}"
                )
            if kind.name in known:
                raise ValueError(f"the kind {kind.name!r} is there already")
        except Exception as error:  # a module of another package may raise anything
            text = " ".join(f"{type(error).__name__}: {error}".split())
            faults.append((f"package {package}", f"entry point {point.name} of {GROUP}: {text}"))
        else:
            known[kind.name], added[kind.name] = kind, point
    return known, added, faults


KINDS, ADDED, FAULTS = with_entry_points(BUILT_IN, entry_points(group=GROUP))
"""Every kind by its name; entry points of kinds of other packages; faults of such packages, which
keep every deployment from loading."""


def build_shaper(
    kind: str,
    tick_s: float,
    sway: SwayModel | None,
    *,
    valve_rate_per_s: float = math.inf,
    **parameters: object,
) -> Shaper:
    """Make a filter.

    Args:
        kind: name of the filter, one of ``KINDS``.
        tick_s: time between two ticks of the axis, seconds.
        sway: sway model of the axis, or None; the filter may keep it, its owner steps it.
        valve_rate_per_s: rate of the valve, full speeds per second, for filters that feed back.
        parameters: parameters of the filter, by their names in the deployment file.

    Raises:
        KeyError: there is no such kind.
        ValueError: the parameters make no filter, or the filter needs sway data and has none.

    Returns:
        The filter, in neutral.

    Examples:
        A joystick that is moved at once, through a lag with a time constant of 0.1 s:

        >>> from canshaper import SwayMode, SwayModel, build_shaper
        >>> sway = SwayModel(SwayMode.from_period(2.4, 0.02), tick_s=0.02)
        >>> shaper = build_shaper("first_order", 0.02, sway, time_constant_s=0.1)
        >>> [round(shaper.step(1.0), 2) for _ in range(4)]
        [0.18, 0.33, 0.45, 0.55]
    """
    declared = KINDS[kind]
    if declared.needs_valve_rate:
        parameters["valve_rate_per_s"] = valve_rate_per_s
    if not declared.needs_sway:
        return declared.build(tick_s, **parameters)
    if sway is None:
        raise ValueError(f"expected sway data for filter {kind}, got none")
    return declared.build(sway, **parameters)


# Positions between two sets that differ: 1 to 2 % of their difference.
STEPS_BETWEEN = 64


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """Sway mode and filter of an axis at one value of the load state.

    Attributes:
        at: value of the load state.
        mode: sway mode.
        kind: name of the filter in the registry.
        parameters: parameters of the filter, by their names in the registry.
    """

    at: float
    mode: SwayMode
    kind: str
    parameters: dict[str, Any]


def position(sets: Sequence[ParameterSet], value: float) -> int:
    """Return a value's position among rising sets, ``STEPS_BETWEEN`` from set to set, clamped."""
    values = [one.at for one in sets]
    if value <= values[0]:
        return 0
    if value >= values[-1]:
        return (len(sets) - 1) * STEPS_BETWEEN
    low = bisect_right(values, value) - 1
    share = (value - values[low]) / (values[low + 1] - values[low])
    return low * STEPS_BETWEEN + round(share * STEPS_BETWEEN)


def at_position(sets: Sequence[ParameterSet], steps: int) -> ParameterSet:
    """Return the set at ``steps``, a result of ``position``, interpolated between two sets.

    Period, damping ratio, poles, taps and every other number are interpolated linearly; so poles
    stay real and negative, and taps keep the sum 1. Whole numbers are rounded.
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
