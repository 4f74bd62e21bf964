"""Quality of the data of a swing: a sensor at its end, two directions mixed in one signal."""

import math

import numpy as np
from scipy.optimize import least_squares

from canshaper.commissioning.identification.decay import DecayFit
from canshaper.commissioning.identification.series import Array, Series, runs
from canshaper.commissioning.identification.swing import moving_amplitude

# Starts of the frequencies of two swings, as parts of that of the one that was found.
_PAIRS = ((1.0, 1.06), (1.0, 0.94), (0.97, 1.03))


def clipped(series: Series, fit: DecayFit | None) -> str | None:
    """Whether a signal stands at its extreme again and again, as a sensor at its end does."""
    time, value = series.time_s, series.value
    span = float(np.ptp(value))
    period = fit.period_s.value if fit else 2.0
    steps = np.abs(np.diff(value))
    finest = float(steps[steps > 1e-9 * span].min()) if (steps > 1e-9 * span).any() else span
    if finest > 0.05 * span:
        return f"{series.source}: it has {span / finest:.0f} steps only; use a finer signal"
    for extreme in (float(value.max()), float(value.min())):
        flat = runs(np.abs(value - extreme) < 1e-9 * span)
        if sum(time[b - 1] - time[a] > period / 8.0 for a, b in flat) >= 3:
            shown = extreme / series.unit.factor
            return (
                f"{series.source}: it stands at {shown:.4g} {series.unit.text} again and again:"
                " the sensor is at the end of its range; swing less, or choose a larger range"
            )
    return None


def mixed(fit: DecayFit) -> str | None:
    """Whether a second swing of another period is in the longest segment."""
    longest = max(fit.segments, key=lambda s: float(s.segment.time_s[-1]) * float(s.envelope[0]))
    segment = longest.segment
    time, omega = segment.time_s, 2.0 * math.pi / fit.period_s.value
    left = moving_amplitude(segment.value - longest.fitted, time, omega)
    size = float(np.sqrt(np.mean(longest.envelope**2)))
    if left < 0.03 * size:
        return None
    sigma = fit.damping_ratio.value * omega

    def linear(x: Array) -> tuple[Array, Array]:
        columns = [np.ones_like(time), time]
        for w, s in ((x[0], x[1]), (x[2], x[3])):
            columns += [np.exp(-s * time) * np.cos(w * time), np.exp(-s * time) * np.sin(w * time)]
        basis = np.stack(columns, axis=1)
        best, *_ = np.linalg.lstsq(basis, segment.value, rcond=None)
        return np.asarray(best), np.asarray(segment.value - basis @ best)

    low = [0.7 * omega, 0.0, 0.7 * omega, 0.0]
    high = [1.4 * omega, 0.5 * omega, 1.4 * omega, 0.5 * omega]
    starts = [[omega * a, max(sigma, 1e-3), omega * b, max(sigma, 1e-3)] for a, b in _PAIRS]
    fits = [
        least_squares(lambda x: linear(x)[1], s, bounds=(low, high), max_nfev=60) for s in starts
    ]
    x = min(fits, key=lambda f: float(f.cost)).x
    best, residual = linear(x)
    first, second = sorted((math.hypot(*best[2:4]), math.hypot(*best[4:6])), reverse=True)
    better = float(np.sum(residual**2)) < 0.6 * float(np.sum((segment.value - longest.fitted) ** 2))
    if not better or second < 0.1 * first or abs(x[0] - x[2]) < 0.02 * omega:
        return None
    periods = sorted((2.0 * math.pi / x[0], 2.0 * math.pi / x[2]))
    return (
        f"two swings are mixed, of {periods[0]:.2f} and {periods[1]:.2f} s: the signal shows both"
        " directions; swing in one direction only, or turn the sensor to it"
    )
