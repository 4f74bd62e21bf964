"""Every filter that an axis may run, by the name it has in a deployment file."""

import math
from collections.abc import Callable, Sequence
from typing import Protocol

from canshaper.shaping.fir import Fir, convolved, ei_taps, zv_taps
from canshaper.shaping.gff import Gff
from canshaper.shaping.limit_aware import LimitAware
from canshaper.shaping.smoothing import FirstOrder, SCurve
from canshaper.shaping.sway import SwayMode, SwayModel


class Shaper(Protocol):
    """What the axis asks of a filter."""

    def wanted(self, command: float) -> float:
        """Return the output the filter asks for, before limits; ``command`` in [-1, 1].

        Called once a tick, also while the axis is neutral (then with command 0).
        """
        ...


class Off:
    """No shaping: the output limits alone stand between stick and valve."""

    __slots__ = ()

    def wanted(self, command: float) -> float:
        """Return the command itself."""
        return command


def _gff(
    sway: SwayModel,
    *,
    a1: float | None = None,
    a2: float | None = None,
    poles_rad_s: Sequence[float] | None = None,
    third_pole_rad_s: float | None = None,
) -> Shaper:
    if poles_rad_s is not None:
        return Gff(sway, (poles_rad_s[0], poles_rad_s[1]), third_pole_rad_s)
    if a1 is not None and a2 is not None:
        return Gff.from_denominator(sway, a1, a2, third_pole_rad_s)
    raise ValueError("allowed are a1 and a2, or poles_rad_s")


def _zvd(sway: SwayModel) -> Shaper:
    zv = zv_taps(sway.mode, sway.tick_s)
    return Fir(convolved(zv, zv))


def _two_mode(sway: SwayModel, *, period_s: float, damping_ratio: float) -> Shaper:
    try:
        second = SwayModel(SwayMode.from_period(period_s, damping_ratio), sway.tick_s).mode
    except ValueError as error:
        raise ValueError(f"second mode: {error}") from None
    return Fir(convolved(zv_taps(sway.mode, sway.tick_s), zv_taps(second, sway.tick_s)))


# Filters that need the sway of their axis.
_OF_SWAY: dict[str, Callable[..., Shaper]] = {
    "gff": _gff,
    "zv": lambda sway: Fir(zv_taps(sway.mode, sway.tick_s)),
    "zvd": _zvd,
    "ei": lambda sway, *, residual_pct: Fir(ei_taps(sway.mode, sway.tick_s, residual_pct / 100.0)),
    "two_mode": _two_mode,
    "robust": lambda sway, *, taps, rate_per_s: LimitAware(sway, Fir(taps), rate_per_s),
}
# Filters that need the tick only.
_OF_TICK: dict[str, Callable[..., Shaper]] = {
    "off": lambda _tick_s: Off(),
    "first_order": FirstOrder,
    "s_curve": SCurve,
}
KINDS_OF_SWAY = frozenset(_OF_SWAY)
KINDS = (*_OF_TICK, *_OF_SWAY)


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
        kind: its name, one of ``KINDS``.
        tick_s: time between two ticks of the axis.
        sway: sway model of the axis; the filter may keep it, its owner steps it.
        valve_rate_per_s: rate of the valve, full speeds per second, for filters that feed back.
        parameters: those of the filter, by their names in the deployment file.

    Raises:
        ValueError: the parameters make no filter, or it needs sway data and there is none.
    """
    if kind in _OF_TICK:
        return _OF_TICK[kind](tick_s, **parameters)
    if sway is None:
        raise ValueError(f"filter {kind} needs the sway data of the axis; found no sway")
    if kind == "robust":
        parameters["rate_per_s"] = valve_rate_per_s
    return _OF_SWAY[kind](sway, **parameters)
