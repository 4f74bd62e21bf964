"""The limits that no filter of its kind can beat, for the picture of the comparison."""

from canshaper.can.binding import Deployment
from canshaper.report.pareto import Limits
from canshaper.tuning.robust import least_residual, time_optimal_s
from canshaper_sim.comparison.candidates import nominal_mode
from canshaper_sim.crane import CraneParameters

_DURATIONS_IN_PERIODS = (0.55, 0.65, 0.75, 0.85, 0.95, 1.05, 1.15, 1.25)
_RANGE_PCT = 30.0
# After the last tap the speed falls by the lag of the valve: to 5 % of full speed this takes 1.5
# time constants where the command ends in a ramp of the valve's rate.
_LAGS_TO_STOP = 1.5


def limits_for(deployment: Deployment, axis: str, unshaped_deg: float) -> Limits:
    """Limits for an axis of a deployment, in degrees for this unshaped swing.

    Linear theory: the part of the swing that is left times the unshaped swing; run-on: duration of
    the command and lag of the valve.
    """
    bound = deployment.axes[axis]
    mode = nominal_mode(deployment, axis)
    tick_s = bound.period_ticks * deployment.config.tick_ms / 1000.0
    rate = min(bound.config.limits.rise_per_s, bound.config.limits.fall_per_s)
    lag_s = _LAGS_TO_STOP * getattr(CraneParameters(), axis).lag_s
    curve = []
    for periods in _DURATIONS_IN_PERIODS:
        found = least_residual(
            mode,
            tick_s=tick_s,
            duration_s=round(periods * mode.period_s / tick_s) * tick_s,
            range_pct=_RANGE_PCT,
            rate_per_s=rate,
        )
        curve.append((found.duration_s + lag_s, found.residual * unshaped_deg))
    return Limits(curve, time_optimal_s(mode, tick_s=tick_s, rate_per_s=rate) + lag_s)
