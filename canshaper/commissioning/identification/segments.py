"""Free swings found in a signal: by the commands where they are known, and by their own shape.

In windows of one period a sinusoid is fitted. Where the windows agree, so that phase goes on at one
frequency and the amplitude decays, the tool swings freely; where somebody drives, or wind pushes,
they do not.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.signal import find_peaks

from canshaper.commissioning.identification.series import (
    Array,
    Segment,
    Series,
    Span,
    binned,
    common,
    pieces,
    runs,
)
from canshaper.commissioning.identification.swing import (
    SAMPLES,
    SHORTEST_SWINGS,
    Run,
    Swing,
    cut,
    refined,
)

SHORTEST_S, LONGEST_S = 0.3, 12.0
# The spectrum is computed of parts of a signal: least values of a part, and its length, s.
LEAST_VALUES, PART_S = 24, 30.0
# Width of the smoothing window, part of a period.
SMOOTHED = 0.6
# Windows in a period; the ends of a segment are known to this part of it.
STEPS = 16
# A window counts when its sinusoid explains all but this part of its own amplitude.
ROUGHEST = 0.25
# A segment has at least this part of the best one's worth, which is energy times time.
LEAST_WORTH = 0.04
# By how much the frequency of a weak segment may differ from that of the best one.
ALIKE = 0.03
# Runs of windows that are looked at for a period, the best first.
MOST_RUNS = 200
# Settling of the valve after its last command, s.
SETTLING_S = 0.5


class FreeSwings(NamedTuple):
    """Free swings of a signal, approximate period and damping ratio, and energy times time."""

    segments: list[Segment]
    period_s: float
    damping_ratio: float
    worth: float


def find_free(series: Series, about_s: float | None = None) -> FreeSwings | None:
    """Return the free swings of a series, each of a period and a half or more; None without any.

    ``about_s`` is the approximate period, s, from which the search goes some 30 % either way.
    """
    time, value = binned(series.time_s, series.value)
    if about_s:
        time, value = _smoothed(time, value, about_s)
    signal = Segment(series.source, 0.0, time, value, series.unit.kind)
    idle = [(-math.inf, math.inf)]
    if series.idle is not None:
        idle = [(begin + SETTLING_S, end) for begin, end in series.idle]
    best: FreeSwings | None = None
    for period in _candidates(time, value, about_s):
        # What swings far less than the best so far is not worth a fit.
        least = LEAST_WORTH * best.worth if best else 0.0
        swings = _with_period(signal, idle, period, least)
        # The period of the windows may be some percent off at first.
        if swings:
            swings = _with_period(signal, idle, swings.period_s, least) or swings
        if swings and (best is None or swings.worth > best.worth):
            best = swings
    return best


def _smoothed(time: Array, value: Array, period: float) -> tuple[Array, Array]:
    """Return a signal without what swings more than twice as fast as a period.

    A weighted mean changes amplitude and phase of a damped swing, and neither its frequency nor its
    decay; the amplitude is put right again.
    """
    times, values = [time[:0]], [value[:0]]
    for piece in pieces(time, period / 3.0):
        t, v = time[piece], value[piece]
        step = float(np.median(np.diff(t)))
        grid = np.arange(t[0], t[-1], step)
        window = np.hanning(round(SMOOTHED * period / step) + 2)[1:-1]
        if len(grid) <= len(window) or len(window) < 2:
            continue
        window /= window.sum()
        local = (np.arange(len(window)) - 0.5 * (len(window) - 1)) * step
        gain = float(window @ np.cos(2.0 * math.pi / period * local))
        mean = np.convolve(np.interp(grid, t, v), window, mode="valid")
        times.append(grid[: len(mean)] + 0.5 * (len(window) - 1) * step)
        values.append(mean / gain)
    return np.concatenate(times), np.concatenate(values)


def _candidates(time: Array, value: Array, about_s: float | None) -> list[float]:
    """Return up to four periods, s, at which a signal swings most, the strongest first."""
    low, high = (0.7 * about_s, 1.4 * about_s) if about_s else (SHORTEST_S, LONGEST_S)
    frequencies = np.geomspace(1.0 / high, 1.0 / low, 160)
    power = np.zeros_like(frequencies)
    for piece in pieces(time, high / 2.0):
        length_s = time[piece][-1] - time[piece][0]
        ends = np.linspace(0, piece.stop - piece.start, max(1, round(length_s / PART_S)) + 1)
        for begin, end in pairwise(piece.start + ends.astype(int)):
            t, v = time[begin:end], value[begin:end]
            if len(t) < LEAST_VALUES or t[-1] - t[0] < 1.5 * low:
                continue
            base = np.polynomial.Polynomial.fit(t, v, 2)
            window = np.hanning(len(t) + 2)[1:-1]
            waves = np.exp(-2j * np.pi * np.outer(frequencies, t - t[0]))
            power += np.abs(waves @ ((v - base(t)) * window)) ** 2 / len(t)
    if not power.any():
        return []
    # A drift has most power at low frequencies; weighted by frequency a resonance stands out.
    weighed = power * frequencies
    peaks, _ = find_peaks(np.concatenate([[0.0], weighed, [0.0]]))
    strongest = sorted(peaks - 1, key=lambda k: -weighed[k])[:4]
    return [float(1.0 / frequencies[k]) for k in strongest]


def _with_period(
    signal: Segment, idle: list[Span], period: float, least: float
) -> FreeSwings | None:
    """Return the free swings of about that period, each of at least this worth; None for none."""
    time = signal.time_s
    unbroken = [(float(t[0]), float(t[-1])) for t in (time[p] for p in pieces(time, period / 3.0))]
    wholes = [cut(signal, begin, end, 0.0) for begin, end in common(unbroken, idle)]
    candidates = [
        (whole, run) for whole in wholes for run in _runs(whole.time_s, whole.value, period)
    ]
    candidates.sort(key=lambda pair: -pair[1].worth)
    kept: list[Swing] = []
    for whole, run in candidates[:MOST_RUNS]:
        if run.worth < max(LEAST_WORTH * candidates[0][1].worth, least):
            break
        middle, half = 0.5 * (run.start_s + run.end_s), 0.5 * (run.end_s - run.start_s)
        parts = (k.segment for k in kept)
        if any(min(run.end_s, p.end_s) - max(run.start_s, p.start_s) > half for p in parts):
            continue
        low = max((e for k in kept if (e := k.segment.end_s) <= middle), default=-math.inf)
        high = min((b for k in kept if (b := k.segment.start_s) >= middle), default=math.inf)
        if swing := refined(whole, run, low, high):
            kept.append(swing)
    if not kept:
        return None
    kept = sorted(_like_the_best(kept), key=lambda swing: swing.segment.start_s)
    kept = _like_the_best(_joined(kept, period))
    worths = np.array([s.worth for s in kept])
    omega = float(np.average([s.omega for s in kept], weights=worths))
    sigma = float(np.average([s.sigma for s in kept], weights=worths))
    worth = sum(s.worth for s in kept)
    segments = [s.segment for s in kept]
    return FreeSwings(segments, 2.0 * math.pi / omega, max(sigma / omega, 1e-3), worth)


def _like_the_best(swings: Sequence[Swing]) -> list[Swing]:
    """Return the swings that may be of the best one's pendulum; weak ones by their period."""
    best = max(swings, key=lambda swing: swing.worth)
    return [
        one
        for one in swings
        if one.worth > 0.3 * best.worth
        or (one.worth >= LEAST_WORTH * best.worth and abs(one.omega / best.omega - 1.0) < ALIKE)
    ]


def _joined(swings: Sequence[Swing], period: float) -> list[Swing]:
    """Return the swings, with neighbours joined that are one swing parted by noise."""
    result: list[Swing] = []
    for swing in swings:
        if result and swing.segment.start_s - result[-1].segment.end_s < 1.5 * period:
            one = result[-1]
            better = one if one.worth > swing.worth else swing
            low, high = one.segment.start_s, swing.segment.end_s
            run = Run(low, high, better.omega, better.sigma, better.worth)
            both = refined(better.whole, run, low, high)
            if both and both.segment.time_s[-1] > 0.9 * (high - low):
                result[-1] = both
                continue
        result.append(swing)
    return result


def _runs(time: Array, value: Array, period: float) -> list[Run]:
    """Return the runs of windows that seem to swing freely."""
    if len(time) < SHORTEST_SWINGS * SAMPLES:
        return []
    dt = max(float(np.median(np.diff(time))), 1e-4)
    if period / dt < 0.9 * SAMPLES:
        return []
    step = period / STEPS
    per = max(1, round(step / dt))
    grid_dt = step / per if per > 1 else dt
    grid = np.arange(time[0], time[-1], grid_dt)
    stride = max(1, round(step / grid_dt))
    width = round(period / grid_dt) + 1
    if len(grid) < width + stride:
        return []
    y = np.interp(grid, time, value)
    omega = 2.0 * math.pi / period
    local = (np.arange(width) - 0.5 * (width - 1)) * grid_dt
    waves = [f(n * omega * local) for n in (1, 2) for f in (np.cos, np.sin)]
    basis = np.stack([*waves, np.ones(width), local], axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(y, width)[::stride]
    best = windows @ np.linalg.pinv(basis).T
    rough = np.sqrt(np.mean((windows - best @ basis.T) ** 2, axis=1))
    wave = best[:, 0] - 1j * best[:, 1]
    size = np.abs(wave)
    noise = float(np.quantile(rough, 0.1))
    # Deviation of a window's amplitude by noise alone: by white noise, or as seen at twice the
    # frequency, where no pendulum swings.
    blur = noise * math.sqrt(2.0 / width)
    blur = max(blur, float(np.median(np.hypot(best[:, 2], best[:, 3]))) / 1.18)
    good = (size > 6.0 * blur) & (rough < np.maximum(ROUGHEST * size, 3.0 * noise))
    lag = max(1, round(period / (stride * grid_dt)))
    if len(wave) <= lag:
        return []
    seconds = lag * stride * grid_dt
    ratio = wave[lag:] / np.where(size[:-lag] > 0.0, wave[:-lag], 1.0)
    turn = np.angle(ratio * np.exp(-1j * omega * seconds)) / seconds
    decay = -np.log(np.maximum(np.abs(ratio), 1e-9)) / seconds
    doubt = 3.0 * blur / np.maximum(size[lag:], 1e-30) / seconds
    free = good[:-lag] & good[lag:]
    free &= (np.abs(turn) < 0.09 * omega + doubt) & (decay > -0.012 * omega - doubt)
    free &= decay < 0.35 * omega + doubt
    swinging = []
    for first, end in runs(free):
        a = float(grid[first * stride])
        b = float(grid[min((end - 1 + lag) * stride + width - 1, len(grid) - 1)])
        if b - a >= SHORTEST_SWINGS * period:
            weights = size[first:end] ** 2
            faster = float(np.average(turn[first:end], weights=weights))
            slower = float(np.average(decay[first:end], weights=weights))
            worth = float(np.mean(weights)) * (b - a)
            swinging.append(Run(a, b, omega + faster, slower, worth))
    return swinging
