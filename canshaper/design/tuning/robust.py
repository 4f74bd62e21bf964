"""The robust shaper: a non-negative impulse response for a range of pendulum lengths, by LP.

Taps h_k >= 0 with sum 1 keep the output within the range of the commands, so no limit clips it;
taps below the valve's rate times the tick keep a press or a release within the rate. Among these
the programme finds the one with the least worst residual |H(p)| over the range (``least_residual``)
or the shortest one below a given residual (``shortest``).

Without a floor of the taps no shaper of this kind can beat the optimum, which is also the limit in
the comparison. But its taps stand in a few groups, and a tap of the joystick moves the crane once
for each group. A least tap turns them into one movement, for a little more residual.

A second mode (grapple and rotator with long logs) adds rows.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from canshaper.design.tuning.modes import (
    FINE,
    LENGTHS,
    MOST_RANGE_PCT,
    Responses,
    SecondMode,
    responses_of,
    second_residual,
    second_responses,
)
from canshaper.errors import DesignError
from canshaper.shaping.sway import SwayMode

# |H| <= r is a disc; a polygon of so many sides around it is at most 0.3 % larger.
_SIDES = 40
# Least tap, as a part of the mean one: from about here on a tap of the joystick is one movement.
LEAST_TAP = 0.3
# That of a second mode comes on top, whatever the length of the first: at twice its weight the
# first one pays a percent, at five times 1.5 and more.
_SECOND_COUNTS = 2.0


@dataclass(frozen=True)
class RobustShaper:
    """A designed impulse response.

    Attributes:
        taps: impulse response at the tick, sum 1.
        residual: largest |H(p)| over the range of lengths, fraction of the unshaped swing.
        second_residual: residual of the second mode; 0 without a second mode.
        duration_s: time from the first to the last tap.
        mean_delay_s: centre of the taps: lag of the crane behind the joystick.
    """

    taps: tuple[float, ...]
    residual: float
    second_residual: float
    duration_s: float
    mean_delay_s: float


def least_residual(
    mode: SwayMode,
    *,
    tick_s: float,
    duration_s: float,
    range_pct: float,
    rate_per_s: float,
    swing: Sequence[tuple[float, float]] = ((0.0, 1.0),),
    least_tap: float = LEAST_TAP,
    second: SecondMode | None = None,
    first: Sequence[float] = (),
) -> RobustShaper:
    """Return the shaper with the least worst residual over the range, for this duration and rate.

    Args:
        mode: nominal sway mode.
        tick_s: tick of the axis.
        duration_s: length of the impulse response.
        range_pct: error of the pendulum length that the taps cover, +- percent, 0 to 60.
        rate_per_s: rate of the valve, full speeds per second.
        swing: unshaped swing as (length error in percent, swing), rising in the error, linear
            between; by default 1 at every length. The residual has the unit of the swing.
        least_tap: least tap, as a part of the mean tap, 0 to 1.
        second: second mode, whose residual counts twice.
        first: taps with which the response begins, shared with the shaper of another load: during
            these a change between both shapers changes no output.

    Raises:
        DesignError: a value is out of range, or the rate cannot reach full speed in the duration.
    """
    _check(tick_s, duration_s, range_pct, rate_per_s)
    count = round(duration_s / tick_s) + 1
    if count * tick_s * rate_per_s < 1.0:
        raise DesignError(
            f"duration: expected {1.0 / rate_per_s:g} s or more, got {duration_s:g} s:"
            f" the valve takes that long to full speed at {rate_per_s:g} /s"
        )
    weights = _weights(swing, range_pct, LENGTHS)
    rows = _disc_rows(responses_of(mode, range_pct, tick_s, count), weights)
    if second is not None:
        rows = np.vstack(
            [rows, _disc_rows(second_responses(second, tick_s, count), _SECOND_COUNTS)]
        )
    bounds = [(least_tap / count, rate_per_s * tick_s)] * count
    bounds[: len(first)] = [(tap, tap) for tap in first]
    taps = _least_taps(rows, tick_s, bounds)
    left = np.abs(responses_of(mode, range_pct, tick_s, count, FINE) @ taps)
    used = np.flatnonzero(taps > 1e-9)
    return RobustShaper(
        tuple(float(t) for t in taps[: used[-1] + 1]),
        float(np.max(left * _weights(swing, range_pct, FINE))),
        second_residual(taps, second, tick_s) if second else 0.0,
        float((used[-1] - used[0]) * tick_s),
        float(np.sum(np.arange(count) * taps) * tick_s),
    )


def _least_taps(
    rows: NDArray[np.float64], tick_s: float, bounds: list[tuple[float, float]]
) -> NDArray[np.float64]:
    """Return the taps with the least largest row, each within its bounds, with sum 1.

    Raises:
        DesignError: the solver finds no such taps.
    """
    # Variables h_0 ... h_(n-1), r. A little weight on the delay picks the quicker of equals.
    count = rows.shape[1]
    solution = linprog(
        np.append(1e-6 * np.arange(count) * tick_s, 1.0),
        A_ub=np.hstack([rows, -np.ones((len(rows), 1))]),
        b_ub=np.zeros(len(rows)),
        A_eq=np.append(np.ones(count), 0.0)[None, :],
        b_eq=[1.0],
        bounds=[*bounds, (0.0, None)],
        method="highs",
    )
    if not solution.success:
        raise DesignError(f"no impulse response found: {solution.message}")
    taps = np.clip(solution.x[:count], 0.0, None)
    return np.asarray(taps / taps.sum(), dtype=np.float64)


def shortest(
    mode: SwayMode,
    *,
    tick_s: float,
    residual_pct: float,
    range_pct: float,
    rate_per_s: float,
    second: SecondMode | None = None,
) -> RobustShaper:
    """Return the shortest response that leaves at most this part of either mode (bisection).

    Raises:
        DesignError: no response of five swings is good enough, or a value is out of range.
    """
    longest = 5.0 * mode.period_s
    _check(tick_s, longest, range_pct, rate_per_s)
    low = math.ceil(1.0 / rate_per_s / tick_s)
    high = round(longest / tick_s)

    def design(ticks: int) -> RobustShaper:
        return least_residual(
            mode,
            tick_s=tick_s,
            duration_s=ticks * tick_s,
            range_pct=range_pct,
            rate_per_s=rate_per_s,
            second=second,
        )

    def left_pct(candidate: RobustShaper) -> float:
        return 100.0 * max(candidate.residual, candidate.second_residual)

    best = design(high)
    if left_pct(best) > residual_pct:
        raise DesignError(
            f"residual: expected {left_pct(best):.2g} % or more for +-{range_pct:g} % length"
            f" with a valve rate of {rate_per_s:g} /s, got {residual_pct:g} %"
        )
    while low < high:
        middle = (low + high) // 2
        candidate = design(middle)
        if left_pct(candidate) <= residual_pct:
            high, best = middle, candidate
        else:
            low = middle + 1
    return best


def time_optimal_s(
    mode: SwayMode, *, tick_s: float, rate_per_s: float, low: float = 0.0, high: float = 1.0
) -> float:
    """Return the least time in s of a speed change by 1 without residual, output in [low, high].

    The output is a limit for shapers, not a shaper for moving joysticks: it may go back. Three
    swings where no shorter time does.
    """
    n_low, n_high = 1, round(3.0 * mode.period_s / tick_s)

    def feasible(n: int) -> bool:
        # Steps d_0 ... d_n, free in sign; the output is their running sum.
        count = n + 1
        angle = np.exp(-mode.pole * tick_s * np.arange(count))
        sums = np.tril(np.ones((count, count)))
        result = linprog(
            np.zeros(count),
            A_ub=np.vstack([sums, -sums]),
            b_ub=np.concatenate([np.full(count, high), np.full(count, -low)]),
            A_eq=np.vstack([angle.real, angle.imag, np.ones(count)]),
            b_eq=[0.0, 0.0, 1.0],
            bounds=[(-rate_per_s * tick_s, rate_per_s * tick_s)] * count,
            method="highs",
        )
        return bool(result.success)

    while n_low < n_high:
        middle = (n_low + n_high) // 2
        if feasible(middle):
            n_high = middle
        else:
            n_low = middle + 1
    return n_high * tick_s


Swing = Sequence[tuple[float, float]]


def _weights(swing: Swing, range_pct: float, count: int) -> NDArray[np.float64]:
    errors, swings = zip(*swing, strict=True)
    weights: NDArray[np.float64] = np.interp(
        np.linspace(-range_pct, range_pct, count), errors, swings
    )
    return weights


def _disc_rows(
    responses: Responses, weights: float | NDArray[np.float64] = 1.0
) -> NDArray[np.float64]:
    """Return rows whose product with the taps is Re(H e^(-i phi)), by length and direction."""
    turns = np.exp(-2j * np.pi * np.arange(_SIDES) / _SIDES)
    weighted = responses * np.reshape(weights, (-1, 1))
    rows: NDArray[np.float64] = (turns[None, :, None] * weighted[:, None, :]).real
    return rows.reshape(-1, responses.shape[1])


def _check(tick_s: float, duration_s: float, range_pct: float, rate_per_s: float) -> None:
    for name, value, low, high, unit in (
        ("tick", tick_s, 1e-3, 0.2, "s"),
        ("duration", duration_s, 0.02, 60.0, "s"),
        ("range of length", range_pct, 0.0, MOST_RANGE_PCT, "%"),
        ("valve rate", rate_per_s, 0.2, 1000.0, "1/s"),
    ):
        if not low <= value <= high:
            expected = f"{low:g} to {high:g} {unit}"
            raise DesignError(f"{name}: expected {expected}, got {value:g} {unit}")
