"""The limits that no filter of its kind can beat, for the picture of the comparison."""

from collections.abc import Sequence

from canshaper.design.comparison.candidates import nominal_mode
from canshaper.design.comparison.measure import Outcome
from canshaper.design.tuning.robust import least_residual, time_optimal_s
from canshaper.machine.deployment import Deployment
from canshaper.report.pareto import Limits
from canshaper_sim.crane import CraneParameters

_DURATIONS_IN_PERIODS = (0.55, 0.65, 0.75, 0.85, 0.95, 1.05, 1.15, 1.25)
_RANGE_PCT = 30.0
# After the last tap the speed falls by the lag of the valve: to 5 % of full speed this takes 1.5
# time constants where the command ends in a ramp of the valve's rate.
_LAGS_TO_STOP = 1.5


def limits_for(deployment: Deployment, axis: str, outcomes: Sequence[Outcome]) -> Limits:
    """Limits for an axis of a deployment on these manoeuvres.

    Linear theory: of the swing that each manoeuvre makes with the filter off at each length, a
    shaper leaves the part |H(p)|. Run-on: duration of the command and lag of the valve.
    """
    swing: dict[int, float] = {}
    for o in outcomes:
        if o.candidate == "off" and not o.manoeuvre.startswith(("random", "initial")):
            swing[o.length_pct] = max(swing.get(o.length_pct, 0.0), o.residual_deg)
    bound = deployment.axes[axis]
    mode = nominal_mode(deployment, axis)
    tick_s = bound.period_ticks * deployment.config.tick_ms / 1000.0
    rate = bound.config.limits.slowest_per_s
    lag_s = _LAGS_TO_STOP * getattr(CraneParameters(), axis).lag_s
    curve = []
    for periods in _DURATIONS_IN_PERIODS:
        found = least_residual(
            mode,
            tick_s=tick_s,
            duration_s=round(periods * mode.period_s / tick_s) * tick_s,
            range_pct=_RANGE_PCT,
            rate_per_s=rate,
            swing=sorted(swing.items()),
            least_tap=0.0,  # a floor would be a bound of our own
        )
        curve.append((found.duration_s + lag_s, found.residual))
    return Limits(curve, time_optimal_s(mode, tick_s=tick_s, rate_per_s=rate) + lag_s)
