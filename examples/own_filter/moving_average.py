"""A filter of another package: the mean of the commands of the last seconds, one of each tick."""

from canshaper import Fir, Parameter, ShaperKind


def moving_average(tick_s: float, *, window_s: float) -> Fir:
    """As an impulse response. Over one period of the swing it ends without swing."""
    count = max(1, round(window_s / tick_s))
    return Fir([1.0 / count] * count)


KIND = ShaperKind(
    "moving_average",
    "Mean of the commands of the last seconds.",
    moving_average,
    lambda mode, _tick_s: {"mean over a swing": {"window_s": mode.period_s}},
    (Parameter("window_s", 0.1, 10, "s", "time over which the mean is taken"),),
    runs_ahead=False,  # it only spreads the demand: the gate allows it 0.4 s of full speed
)
