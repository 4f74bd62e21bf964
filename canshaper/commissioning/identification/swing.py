"""One damped swing in a stretch of a signal: where it begins and ends."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.signal import find_peaks

from canshaper.commissioning.identification.decay_problem import DecayProblem, Segment
from canshaper.commissioning.identification.series import Array, pieces

# Least samples a period.
SAMPLES = 8
# A segment has at least so many swings.
SHORTEST_SWINGS = 1.5
# Periods that a segment may reach beyond the windows that found it.
FURTHER = 1.5
# What is left of a segment at the frequency of the swing, part of its amplitude; in noise more.
ROUGHEST_FIT = 0.15
ROUGHEST_IN_NOISE = 0.35


class Run(NamedTuple):
    """Windows in a row that may swing freely; worth is the energy of the swing times its time."""

    start_s: float
    end_s: float
    omega: float
    sigma: float
    worth: float


class Swing(NamedTuple):
    """A free swing, with frequency and decay of its own."""

    segment: Segment
    omega: float
    sigma: float
    worth: float

    @property
    def start_s(self) -> float:
        """Its start in the log."""
        return self.segment.start_s

    @property
    def end_s(self) -> float:
        """Its end in the log."""
        return self.segment.start_s + float(self.segment.time_s[-1])


def refined(whole: Segment, run: Run) -> Swing | None:
    """The part of a run that one damped swing describes; None where there is none.

    What drives the tool reaches into the first and the last window of a run. So the middle is
    fitted first, and grows from there as long as the data follow the model.
    """
    period = 2.0 * math.pi / run.omega
    spare = max(0.0, run.end_s - run.start_s - 2.0 * period)
    first, last = run.start_s + min(period, 0.7 * spare), run.end_s - min(period / 4, 0.2 * spare)
    core = cut(whole, first, last)
    if len(core.time_s) < SAMPLES:
        return None
    problem, x = _solved(core, run.omega, run.sigma)
    inside = whole.time_s >= run.start_s - FURTHER * period
    inside &= whole.time_s <= run.end_s + FURTHER * period
    at = whole.time_s[inside] - core.start_s
    basis, envelope = problem.basis(0, x, at)
    _, best, residual = problem.linear(0, x)
    size = envelope * math.hypot(best[0], best[1])
    off = (whole.value[inside] - basis @ best) ** 2
    dt = float(np.median(np.diff(at)))
    width = max(2, round(period / 4.0 / dt))
    allowed = _tolerance(residual, width) + (0.06 * size) ** 2
    mean = np.convolve(off - allowed, np.ones(width) / width, mode="same")
    wrong = at[mean > 0.0]
    before, after = wrong[wrong < 0.0], wrong[wrong > last - core.start_s]
    begins = before[-1] + period / 8 if len(before) else at[0]
    ends = after[0] - period / 8 if len(after) else at[-1]
    segment = cut(whole, core.start_s + float(begins), core.start_s + float(ends))
    if len(segment.time_s) < SAMPLES or segment.time_s[-1] < SHORTEST_SWINGS * period:
        return None
    problem, x = _solved(segment, float(x[0]), float(x[1]))
    basis, best, residual = problem.linear(0, x)
    size = problem.basis(0, x)[1] * math.hypot(best[0], best[1])
    omega, sigma = float(x[0]), float(x[1])
    near = moving_amplitude(residual, segment.time_s, omega)
    noise = 1.5 * moving_amplitude(residual, segment.time_s, 2.0 * omega)
    mean_size = float(np.sqrt(np.mean(size**2)))
    if near > min(math.hypot(ROUGHEST_FIT * mean_size, noise), ROUGHEST_IN_NOISE * mean_size):
        return None
    energy = float(np.mean(size**2)) * float(segment.time_s[-1])
    return Swing(segment, omega, sigma, energy)


def _tolerance(noise: Array, width: int) -> float:
    """Mean square over so many values that noise of this kind hardly ever has."""
    square = float(np.mean(noise**2))
    alike = float(np.mean(noise[1:] * noise[:-1])) / max(square, 1e-30)
    alike = min(max(alike, 0.0), 0.98) ** 2
    independent = max(width * (1.0 - alike) / (1.0 + alike), 1.0)
    return square * (1.0 + 6.0 * math.sqrt(2.0 / independent))


def moving_amplitude(residual: Array, time: Array, omega: float) -> float:
    """Amplitude that the residual has at a frequency, root of the mean square over windows."""
    wave = residual * np.exp(-1j * omega * time)
    width = max(1, round(2.0 * math.pi / omega / float(np.median(np.diff(time)))))
    if len(wave) < width:
        return 2.0 * abs(complex(np.mean(wave)))
    means = np.convolve(wave, np.ones(width) / width, mode="valid")
    return 2.0 * float(np.sqrt(np.mean(np.abs(means) ** 2)))


def _solved(segment: Segment, omega: float, sigma: float) -> tuple[DecayProblem, Array]:
    """One segment alone, from a start."""
    problem = DecayProblem([segment], [float(np.ptp(segment.value)) / 2.0 + 1e-12])
    return problem, problem.solve([omega, sigma], roughly=True)


def cut(whole: Segment, first: float, last: float, start: float | None = None) -> Segment:
    """A part of a segment, its times from its own start or from another."""
    inside = (whole.time_s >= first) & (whole.time_s <= last)
    time = whole.time_s[inside]
    if start is None:
        start = float(time[0]) if len(time) else first
    return Segment(whole.source, start, time - start, whole.value[inside], whole.kind)


SHORTEST_S, LONGEST_S = 0.3, 12.0
# Values of a part of a signal from which on its spectrum shows something, and its length.
LEAST_VALUES, PART_S = 24, 30.0
# Width of the window that smooths, part of a period.
SMOOTHED = 0.6


def smoothed(time: Array, value: Array, period: float) -> tuple[Array, Array]:
    """A signal without what swings more than twice as fast as a period.

    A weighted mean changes amplitude and phase of a damped swing, and neither its frequency nor its
    decay; the amplitude is put right again.
    """
    times, values = [], []
    for piece in pieces(time, period / 3.0):
        t, v = time[piece], value[piece]
        if len(t) < 2:
            continue
        step = float(np.median(np.diff(t)))
        grid = np.arange(t[0], t[-1], step)
        window = np.hanning(round(SMOOTHED * period / step) + 2)[1:-1]
        if len(grid) <= len(window) or len(window) < 2:
            continue
        window /= window.sum()
        local = (np.arange(len(window)) - 0.5 * (len(window) - 1)) * step
        gain = float(window @ np.cos(2.0 * math.pi / period * local))
        mean = np.convolve(np.interp(grid, t, v), window, mode="valid")
        middle = 0.5 * (len(window) - 1) * step
        times.append(grid[: len(mean)] + middle)
        values.append(mean / gain)
    if not times:
        return time[:0], value[:0]
    return np.concatenate(times), np.concatenate(values)


def candidates(time: Array, value: Array, about_s: float | None) -> list[float]:
    """Periods at which a signal swings most, the strongest first, s."""
    low, high = (0.7 * about_s, 1.4 * about_s) if about_s else (SHORTEST_S, LONGEST_S)
    frequencies = np.geomspace(1.0 / high, 1.0 / low, 160)
    power = np.zeros_like(frequencies)
    for piece in pieces(time, high / 2.0):
        for part in _parts(time[piece], PART_S):
            t, v = time[piece][part], value[piece][part]
            if len(t) < LEAST_VALUES or t[-1] - t[0] < 1.5 * low:
                continue
            base = np.polynomial.Polynomial.fit(t, v, 2)
            window = np.hanning(len(t) + 2)[1:-1]
            waves = np.exp(-2j * np.pi * np.outer(frequencies, t - t[0]))
            power += np.abs(waves @ ((v - base(t)) * window)) ** 2 / len(t)
    if not power.any():
        return []
    # What drifts has most power at the bottom; weighed by frequency a resonance stands out.
    weighed = power * frequencies
    peaks, _ = find_peaks(np.concatenate([[0.0], weighed, [0.0]]))
    strongest = sorted(peaks - 1, key=lambda k: -weighed[k])[:4]
    return [float(1.0 / frequencies[k]) for k in strongest]


def _parts(time: Array, length_s: float) -> list[slice]:
    """Equal parts of about so many seconds."""
    count = max(1, round((time[-1] - time[0]) / length_s))
    ends = np.linspace(0, len(time), count + 1).astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]
