"""Modes over a range of pendulum lengths, and the part of their swing that a response leaves.

The residual of the first mode is |H(p)|. The residual of a second mode is its swing at the end of
the response, as a part of its unshaped swing at the beginning: |H(p)| compares with a swing that
has died away by then, and a damped mode would spoil the response for the first mode.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from canshaper.errors import DesignError
from canshaper.shaping.sway import SwayMode

# Lengths at which the residual is bounded; between them it rises by far less than a percent of it.
LENGTHS = 25
FINE = 4 * LENGTHS + 1  # at which the result is measured
MOST_RANGE_PCT = 60.0
# A second mode: with more damping it has died away after a swing; a faster one hardly swings, as
# the valve takes two thirds of its period to full speed, and has no room between two ticks; for one
# beyond 0.4 of its period the first pays up to an eighth, or a response that is longer by a third.
_SECOND_DAMPING = 0.4
_SECOND_RISES, _SECOND_TICKS, SECOND_PERIODS = 1.5, 10, 0.8
_SHORTEST_S = 0.25  # the fastest mode that can be modelled, with the largest range


@dataclass(frozen=True)
class SecondMode:
    """Another mode that the taps must not excite.

    Attributes:
        mode: nominal mode.
        range_pct: error of the mode's pendulum length that the taps cover, +- percent, 0 to 60.
    """

    mode: SwayMode
    range_pct: float


def modes_over_range(mode: SwayMode, range_pct: float, count: int = LENGTHS) -> list[SwayMode]:
    """Return modes for pendulum lengths of -range ... +range percent, with one damping ratio."""
    lengths = np.linspace(1.0 - range_pct / 100.0, 1.0 + range_pct / 100.0, count)
    return [SwayMode(mode.omega_rad_s / math.sqrt(x), mode.damping_ratio) for x in lengths]


def second_mode(
    first: SwayMode,
    period_s: float,
    damping_ratio: float,
    range_pct: float,
    *,
    tick_s: float,
    rate_per_s: float,
) -> SecondMode:
    """Return a second mode that taps can spare without spoiling the first mode.

    Args:
        first: nominal mode of the axis.
        period_s, damping_ratio: those of the second mode.
        range_pct: error of its pendulum length that the taps cover, +- percent.
        rate_per_s: rate of the valve, full speeds per second.

    Raises:
        DesignError: a value is out of range: overdamped, too fast or too slow.
    """
    fastest_s = max(_SECOND_RISES / rate_per_s, _SECOND_TICKS * tick_s, _SHORTEST_S)
    slowest_s = SECOND_PERIODS * first.period_s
    if fastest_s > slowest_s:
        raise DesignError(f"expected none with a valve of {rate_per_s:g} /s, got {period_s:g} s")
    for name, value, low, high, unit in (
        ("period", period_s, fastest_s, slowest_s, " s"),
        ("damping ratio", damping_ratio, 0.0, _SECOND_DAMPING, ""),
        ("range of length", range_pct, 0.0, MOST_RANGE_PCT, " %"),
    ):
        if not low <= value <= high:
            allowed = f"expected a {name} of {low:.3g} to {high:.3g}{unit}"
            raise DesignError(f"{allowed}, got {value:g}{unit}")
    return SecondMode(SwayMode.from_period(period_s, damping_ratio), range_pct)


def second_residual(
    taps: Sequence[float] | NDArray[np.float64], second: SecondMode, tick_s: float
) -> float:
    """Return the largest swing of a second mode after the taps, part of its unshaped swing."""
    responses = second_responses(second, tick_s, len(taps), FINE)
    return float(np.max(np.abs(responses @ np.asarray(taps))))


Responses = NDArray[np.complex128]
"""A row a length: what an impulse at each tap leaves of the unshaped swing."""


def responses_of(
    mode: SwayMode, range_pct: float, tick_s: float, count: int, lengths: int = LENGTHS
) -> Responses:
    """Return the responses of a mode, one row for each length over its range."""
    poles = np.array([one.pole for one in modes_over_range(mode, range_pct, lengths)])
    return np.exp(-np.outer(poles, np.arange(count)) * tick_s)


def second_responses(
    second: SecondMode, tick_s: float, count: int, lengths: int = LENGTHS
) -> Responses:
    """Return the responses of a second mode, each with its decay from the tap to the last one."""
    responses = responses_of(second.mode, second.range_pct, tick_s, count, lengths)
    return responses / np.abs(responses[:, -1:])
