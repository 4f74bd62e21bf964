"""Summary of a comparison: a row for each candidate, recommendations, limits of any filter."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

import numpy as np
from scipy.optimize import linprog

from canshaper.design.comparison.manoeuvres import Candidate, tick_s
from canshaper.design.comparison.measure import Outcome
from canshaper.design.profiles import swinging_axis
from canshaper.design.tuning.modes import responses_of
from canshaper.design.tuning.robust import LEAST_TAP, least_residual, time_optimal_s
from canshaper.machine.deployment import Deployment
from canshaper.report.pareto import Limits
from canshaper.shaping.sway import SwayMode
from canshaper_sim.crane import CraneParameters

# A filter that leaves more than this part of the unshaped swing, at lengths within 15 %, is not
# recommended as "fast": the operator would still wait for the grapple.
FAST_LEAVES = 0.12
# "Balanced" may stop later than the fast one, up to this share of a swing in all.
BALANCED_PERIODS = 0.9
# The operator feels a larger dip of the speed while the joystick is held.
FELT_DIP = 0.05
# Run-on is read from feedback every 20 ms.
HALF_TICK_S = 0.01
# Another grapple or valve than the deployment has, or swing at the start: columns of their own.
_OTHER_CRANES = ("load", "gain", "pump", "end", "start")


@dataclass(frozen=True)
class Row:
    """Measures of a candidate over all manoeuvres.

    Attributes:
        worst_deg: by kind of work, largest residual at the right length, degrees.
        mean_deg: by kind of work, mean residual at the right length, degrees.
        worst_15_deg, worst_30_deg: largest residual at length errors up to 15 and 30 %.
        worst_case: manoeuvre and length error of ``worst_30_deg``.
        still_s: longer of both pulses' times from release until the grapple is still.
        swings_on: ``still_s`` is a lower bound.
        stop_s, rise_s, run_on_m: ``Outcome`` of near-far's pulse at the right length.
        slew_run_on_m: travel after release of the pulse of slew, on its largest radius.
        dip, re_rise: larger value of the two pulses.
        peak_deg: largest swing with both joysticks at the right length.
        tap_part: travel of the shortest tap of near-far, as a part of that without filter.
        tap_movements: largest number of movements of a tap.
        path_part: way of the tip in random drives and cycle, as a part of that without filter.
    """

    name: str
    ours: bool
    worst_deg: dict[str, float]
    mean_deg: dict[str, float]
    worst_15_deg: float
    worst_30_deg: float
    worst_case: str
    still_s: float
    swings_on: bool
    stop_s: float
    rise_s: float
    run_on_m: float
    slew_run_on_m: float
    dip: float
    re_rise: float
    peak_deg: float
    tap_part: float
    tap_movements: int
    path_part: float


def rows(compared: list[Candidate], outcomes: list[Outcome]) -> list[Row]:
    """Return one row for each candidate, in their order; ``outcomes`` include those of "off"."""
    raw = [o for o in outcomes if o.candidate == "off"]
    return [_row(c, [o for o in outcomes if o.candidate == c.name], raw) for c in compared]


def _row(candidate: Candidate, outcomes: list[Outcome], raw: list[Outcome]) -> Row:
    right = [o for o in outcomes if o.length_pct == 0]
    works = {o.work: [p.residual_deg for p in right if p.work == o.work] for o in right}
    pulses = {o.axis: o for o in right if o.work == "pulse"}
    pulse = pulses["near_far"]

    def worst(range_pct: int) -> Outcome:
        near = (o for o in outcomes if abs(o.length_pct) <= range_pct)
        return max((o for o in near if o.work not in _OTHER_CRANES), key=lambda o: o.residual_deg)

    case = worst(30)
    return Row(
        candidate.name,
        candidate.ours,
        worst_deg={work: max(left) for work, left in works.items()},
        mean_deg={work: fmean(left) for work, left in works.items()},
        worst_15_deg=worst(15).residual_deg,
        worst_30_deg=case.residual_deg,
        worst_case=f"{case.manoeuvre} {case.length_pct:+d} %"
        if case.length_pct
        else case.manoeuvre,
        still_s=max(_number(o.still_s) for o in pulses.values()),
        swings_on=any(o.swings_on for o in pulses.values()),
        stop_s=_number(pulse.stop_s),
        rise_s=_number(pulse.rise_s),
        run_on_m=_number(pulse.run_on_m),
        slew_run_on_m=_number(pulses["slew"].run_on_m),
        dip=max(o.dip or 0.0 for o in pulses.values()),
        re_rise=max(o.re_rise or 0.0 for o in pulses.values()),
        peak_deg=max(o.peak_deg for o in right if o.work == "both"),
        tap_part=_shortest_tap(right) / _shortest_tap(raw),
        tap_movements=max(o.movements or 0 for o in right if o.work == "tap"),
        path_part=_path(right) / _path(raw),
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def _shortest_tap(outcomes: list[Outcome]) -> float:
    first = next(o for o in outcomes if o.work == "tap" and o.axis == "near_far")
    return first.travel or 0.0


def _path(outcomes: list[Outcome]) -> float:
    works = ("random", "cycle")
    return sum(o.path for o in outcomes if o.work in works and o.length_pct == 0)


def beaten_by(row: Row, table: list[Row]) -> Row | None:
    """Return the best of our filters that stops as soon and leaves less at +-30 %, or None."""
    better = [
        r
        for r in table
        if r.ours and r.stop_s <= row.stop_s + HALF_TICK_S and r.worst_30_deg < row.worst_30_deg
    ]
    return min(better, key=lambda r: r.worst_30_deg, default=None)


def recommendations(table: list[Row], period_s: float) -> dict[str, tuple[Row, str]]:
    """Return the filter to take by three priorities: its row, and a sentence with the reason.

    All three leave out filters that an operator feels dip (``FELT_DIP``); "off" never does. "fast"
    stops soonest of those that leave little (of all, if none does), "balanced" leaves least of
    those that stop in time (of all, if none does), "calm" leaves least.

    Args:
        table: rows of the comparison, one of them "off".
        period_s: period of the swing of near-far.
    """
    off = next(r for r in table if r.name == "off")
    even = [r for r in table if r.dip <= FELT_DIP]
    quiet = [r for r in even if r.worst_15_deg <= FAST_LEAVES * off.worst_15_deg]
    fast = min(quiet or even, key=lambda r: (r.stop_s, r.worst_15_deg))
    in_time = [r for r in even if r.stop_s <= BALANCED_PERIODS * period_s]
    balanced = min(in_time or even, key=lambda r: (r.worst_15_deg, r.stop_s))
    calm = min(even, key=lambda r: (r.worst_30_deg, r.stop_s))
    little = ", of all that leave" if quiet else "; none leaves"
    timely = " of all that stop" if in_time else "; none stops"
    return {
        "fast": (
            fast,
            f"fast: {fast.name} stops soonest, {fast.stop_s:.1f} s after release{little}"
            f" at most {100 * FAST_LEAVES:.0f} % of the unshaped swing at lengths within 15 %"
            f" ({fast.worst_15_deg:.1f} of {off.worst_15_deg:.1f} degrees)",
        ),
        "balanced": (
            balanced,
            f"balanced: {balanced.name} leaves least at lengths within 15 %"
            f" ({balanced.worst_15_deg:.1f} degrees){timely} within"
            f" {BALANCED_PERIODS:g} of a swing ({balanced.stop_s:.1f} s)",
        ),
        "calm": (
            calm,
            f"calm: {calm.name} leaves least at lengths within 30 %"
            f" ({calm.worst_30_deg:.1f} of {off.worst_30_deg:.1f} degrees);"
            f" it stops {calm.stop_s:.1f} s after release",
        ),
    }


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
