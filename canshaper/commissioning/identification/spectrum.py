"""Which periods a signal swings at, and the signal without what is faster."""

import math
from itertools import pairwise

import numpy as np
from scipy.signal import find_peaks

from canshaper.commissioning.identification.series import Array, pieces

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
