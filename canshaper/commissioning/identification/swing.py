"""One damped swing in a stretch of a signal: where it begins and ends; how good its data are."""

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from canshaper.commissioning.identification.decay import DecayFit, DecayProblem, free_columns
from canshaper.commissioning.identification.series import Array, Segment, Series, runs

# Least samples a period.
SAMPLES = 8
# A segment has at least so many swings.
SHORTEST_SWINGS = 1.5
# Periods that a segment may reach beyond the windows that found it.
FURTHER = 1.5
# A fit leaves at most this part of the amplitude at the frequency of the swing; in noise more.
ROUGHEST_FIT = 0.15
ROUGHEST_IN_NOISE = 0.35


class Run(NamedTuple):
    """Windows in a row that may swing freely; other fields as of ``Swing``."""

    start_s: float
    end_s: float
    omega: float
    sigma: float
    worth: float


class Swing(NamedTuple):
    """A free swing: ``segment`` is the fitted part of ``whole``.

    omega (rad/s) and sigma (1/s) are its own; worth is energy times duration, to rank swings.
    """

    segment: Segment
    omega: float
    sigma: float
    worth: float
    whole: Segment


def refined(whole: Segment, run: Run, low_s: float, high_s: float) -> Swing | None:
    """Return the part of a run, between two times, that is one damped swing; None for none.

    The tool is still driven in the first and the last window of a run. So the middle is fitted
    first; from there the part grows as long as the data follow the model.
    """
    part = cut(whole, low_s, high_s, 0.0)
    period = 2.0 * math.pi / run.omega
    spare = max(0.0, run.end_s - run.start_s - 2.0 * period)
    first, last = run.start_s + min(period, 0.7 * spare), run.end_s - min(period / 4, 0.2 * spare)
    core = cut(part, first, last)
    if len(core.time_s) < SAMPLES:
        return None
    problem, x = _solved(core, run.omega, run.sigma)
    around = cut(part, run.start_s - FURTHER * period, run.end_s + FURTHER * period, 0.0)
    at = around.time_s - core.start_s
    basis, envelope = problem.basis(0, x, at)
    _, best, residual = problem.linear(0, x)
    size = envelope * math.hypot(best[0], best[1])
    off = (around.value - basis @ best) ** 2
    width = max(2, round(period / 4.0 / float(np.median(np.diff(at)))))
    allowed = _tolerance(residual, width) + (0.06 * size) ** 2
    wrong = at[np.convolve(off - allowed, np.ones(width) / width, mode="same") > 0.0]
    before, after = wrong[wrong < 0.0], wrong[wrong > last - core.start_s]
    begins = before[-1] + period / 8 if len(before) else at[0]
    ends = after[0] - period / 8 if len(after) else at[-1]
    segment = cut(part, core.start_s + float(begins), core.start_s + float(ends))
    if len(segment.time_s) < SAMPLES or segment.time_s[-1] < SHORTEST_SWINGS * period:
        return None
    problem, x = _solved(segment, float(x[0]), float(x[1]))
    omega, sigma = float(x[0]), float(x[1])
    _, best, residual = problem.linear(0, x)
    square = float(np.mean((problem.basis(0, x)[1] * math.hypot(best[0], best[1])) ** 2))
    mean_size = math.sqrt(square)
    near = moving_amplitude(residual, segment.time_s, omega)
    noise = 1.5 * moving_amplitude(residual, segment.time_s, 2.0 * omega)
    if near > min(math.hypot(ROUGHEST_FIT * mean_size, noise), ROUGHEST_IN_NOISE * mean_size):
        return None
    return Swing(segment, omega, sigma, square * float(segment.time_s[-1]), whole)


def _tolerance(noise: Array, width: int) -> float:
    """Return a mean square over so many values that such noise hardly ever exceeds."""
    square = float(np.mean(noise**2))
    alike = float(np.mean(noise[1:] * noise[:-1])) / max(square, 1e-30)
    alike = min(max(alike, 0.0), 0.98) ** 2
    independent = max(width * (1.0 - alike) / (1.0 + alike), 1.0)
    return square * (1.0 + 6.0 * math.sqrt(2.0 / independent))


def moving_amplitude(residual: Array, time: Array, omega: float) -> float:
    """Return the amplitude of a residual at a frequency, rad/s, root mean square over periods."""
    wave = residual * np.exp(-1j * omega * time)
    width = max(1, round(2.0 * math.pi / omega / float(np.median(np.diff(time)))))
    if len(wave) < width:
        return 2.0 * abs(complex(np.mean(wave)))
    means = np.convolve(wave, np.ones(width) / width, mode="valid")
    return 2.0 * float(np.sqrt(np.mean(np.abs(means) ** 2)))


def _solved(segment: Segment, omega: float, sigma: float) -> tuple[DecayProblem, Array]:
    """Return the problem of one segment, and its rough solution from a start."""
    problem = DecayProblem([segment], [float(np.ptp(segment.value)) / 2.0 + 1e-12])
    return problem, problem.solve([omega, sigma], roughly=True)


def cut(whole: Segment, first: float, last: float, start: float | None = None) -> Segment:
    """Return a segment from first to last, s; its times count from its own start, or another."""
    inside = (whole.time_s >= first) & (whole.time_s <= last)
    time = whole.time_s[inside]
    if start is None:
        start = float(time[0]) if len(time) else first
    return Segment(whole.source, start, time - start, whole.value[inside], whole.kind)


# Starts of the frequencies of two swings, as parts of the one that was fitted.
_PAIRS = ((1.0, 1.06), (1.0, 0.94), (0.97, 1.03))


def clipped(series: Series, fit: DecayFit | None) -> str | None:
    """Return the fault of a signal that is too coarse, or clipped at its end; None for none."""
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
    """Return the fault where the longest segment has two swings of different periods; else None."""
    longest = max(fit.segments, key=lambda s: float(s.segment.time_s[-1]) * float(s.envelope[0]))
    segment = longest.segment
    time, omega = segment.time_s, 2.0 * math.pi / fit.period_s.value
    left = moving_amplitude(segment.value - longest.fitted, time, omega)
    size = float(np.sqrt(np.mean(longest.envelope**2)))
    if left < 0.03 * size:
        return None
    sigma = fit.damping_ratio.value * omega

    def linear(x: Array) -> tuple[Array, Array]:
        pair = [free_columns(time, w * time, np.exp(-s * time)) for w, s in x.reshape(2, 2)]
        basis = np.hstack([pair[0], pair[1][:, :2]])
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
    first, second = sorted((math.hypot(*best[:2]), math.hypot(*best[4:])), reverse=True)
    better = float(np.sum(residual**2)) < 0.6 * float(np.sum((segment.value - longest.fitted) ** 2))
    if not better or second < 0.1 * first or abs(x[0] - x[2]) < 0.02 * omega:
        return None
    periods = sorted((2.0 * math.pi / x[0], 2.0 * math.pi / x[2]))
    return (
        f"two swings are mixed, of {periods[0]:.2f} and {periods[1]:.2f} s: the signal shows both"
        " directions; swing in one direction only, or turn the sensor to it"
    )
