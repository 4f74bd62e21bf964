"""The limits that no filter of one axis can beat, for the table and the picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from canshaper.design.comparison.manoeuvres import tick_s
from canshaper.design.comparison.measure import Outcome
from canshaper.design.profiles import swinging_axis
from canshaper.design.tuning.modes import responses_of
from canshaper.design.tuning.robust import LEAST_TAP, least_residual, time_optimal_s
from canshaper.machine.deployment import Deployment
from canshaper.report.pareto import Limits
from canshaper.shaping.sway import SwayMode
from canshaper_sim.crane import CraneParameters

AXIS = "near_far"
_DURATIONS_IN_PERIODS = (0.55, 0.64, 0.73, 0.82, 0.91, 1.0, 1.09, 1.18)
_RANGE_PCT = 30.0
_SIDES = 40  # sides of the polygon around a disc
# After the last tap the speed falls by the lag of the valve: to 5 % of full speed this takes 1.5
# time constants where the command ends in a ramp of the valve's rate.
_LAGS_TO_STOP = 1.5


@dataclass(frozen=True)
class Least:
    """Least worst residual that filters of this duration leave, parts of the unshaped swing.

    Attributes:
        duration_s: from the first to the last change of the output after a step.
        ours_15: least of our filters, whose taps have a floor, at lengths within 15 %.
        no_dip_15, no_dip_30: least of filters whose output never goes back, within 15 and 30 %.
        any_15: least of filters whose output stays between 0 and the command, within 15 %.
    """

    duration_s: float
    ours_15: float
    no_dip_15: float
    any_15: float
    no_dip_30: float


def least(deployment: Deployment) -> list[Least]:
    """Return the least residuals of near-far by duration, within the rate of its valve."""
    mode, tick, rate = _axis(deployment)

    def taps(duration_s: float, range_pct: float, least_tap: float = 0.0) -> float:
        return least_residual(
            mode,
            tick_s=tick,
            duration_s=duration_s,
            range_pct=range_pct,
            rate_per_s=rate,
            least_tap=least_tap,
        ).residual

    return [
        Least(
            duration_s,
            taps(duration_s, 15.0, LEAST_TAP),
            taps(duration_s, 15.0),
            _least_of_any(mode, tick, duration_s, 15.0, rate),
            taps(duration_s, 30.0),
        )
        for duration_s in (round(p * mode.period_s, 1) for p in _DURATIONS_IN_PERIODS)
    ]


def limits_for(deployment: Deployment, outcomes: Sequence[Outcome]) -> Limits:
    """Return the limits of near-far alone on these manoeuvres, for the picture.

    Linear theory: at each length a filter leaves the part |H(p)| of the swing that the manoeuvre
    makes without a filter. Run-on is the duration of the filter plus the lag of the valve.
    """
    swing: dict[int, float] = {}
    for o in outcomes:
        if o.candidate == "off" and o.axis == AXIS and o.work in ("pulse", "reversal"):
            swing[o.length_pct] = max(swing.get(o.length_pct, 0.0), o.residual_deg)
    mode, tick, rate = _axis(deployment)
    lag_s = _LAGS_TO_STOP * CraneParameters().near_far.lag_s
    curve = []
    for periods in _DURATIONS_IN_PERIODS:
        least = least_residual(
            mode,
            tick_s=tick,
            duration_s=round(periods * mode.period_s / tick) * tick,
            range_pct=_RANGE_PCT,
            rate_per_s=rate,
            swing=sorted(swing.items()),
            least_tap=0.0,  # a floor would be a bound of our own
        )
        curve.append((least.duration_s + lag_s, least.residual))
    return Limits(curve, time_optimal_s(mode, tick_s=tick, rate_per_s=rate) + lag_s)


def _axis(deployment: Deployment) -> tuple[SwayMode, float, float]:
    """Return sway mode, tick in s and slowest valve rate (1/s) of near-far."""
    bound, sway = swinging_axis(deployment, AXIS)
    return sway.mode(), tick_s(deployment, AXIS), bound.config.limits.slowest_per_s


def _least_of_any(
    mode: SwayMode, tick: float, duration_s: float, range_pct: float, rate_per_s: float
) -> float:
    """Return the least residual of outputs that may go back, but stay between 0 and the command."""
    count = round(duration_s / tick) + 1
    turns = np.exp(-2j * np.pi * np.arange(_SIDES) / _SIDES)
    responses = responses_of(mode, range_pct, tick, count)
    discs = (turns[:, None] * responses[:, None, :]).real.reshape(-1, count)
    sums = np.tril(np.ones((count, count)))
    # Variables: changes of the output after a step, and the residual.
    rows = np.vstack([discs, sums, -sums])
    bounded = np.concatenate([np.zeros(len(discs)), np.ones(count), np.zeros(count)])
    residual = np.concatenate([-np.ones(len(discs)), np.zeros(2 * count)])
    solution = linprog(
        np.append(np.zeros(count), 1.0),
        A_ub=np.column_stack([rows, residual]),
        b_ub=bounded,
        A_eq=np.append(np.ones(count), 0.0)[None, :],
        b_eq=[1.0],
        bounds=[(-rate_per_s * tick, rate_per_s * tick)] * count + [(0.0, None)],
        method="highs",
    )
    return float(solution.fun)
