"""Free swings found in a signal: by the commands where they are known, and by their own shape.

In windows of one period a sinusoid is fitted. Where the windows agree, so that phase goes on at one
frequency and the amplitude decays, the tool swings freely; where somebody drives, or wind pushes,
they do not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from canshaper.commissioning.identification.decay_problem import Segment
from canshaper.commissioning.identification.series import Array, Series, binned, pieces
from canshaper.commissioning.identification.swing import (
    SAMPLES,
    SHORTEST_SWINGS,
    Run,
    Swing,
    candidates,
    cut,
    refined,
    smoothed,
)

# Windows a period; a segment's end is known to this part of a period.
STEPS = 16
# A window counts when its sinusoid explains all but this part of its own amplitude.
ROUGHEST = 0.25
# Of the best segment's energy times time a segment has at least such a part.
LEAST_WORTH = 0.04
# By how much the frequency of a weak segment may differ from that of the best one.
ALIKE = 0.03
# Runs of windows that are looked at for a period, the best first.
MOST_RUNS = 200
# Settling of the valve after its last command, s.
SETTLING_S = 0.5


@dataclass(frozen=True, slots=True)
class FreeSwings:
    """Free swings of a signal.

    Attributes:
        segments: each at least a period and a half.
        period_s: about the period.
        damping_ratio: about the damping ratio.
        worth: energy times time of them all.
    """

    segments: list[Segment]
    period_s: float
    damping_ratio: float
    worth: float


def find_free(series: Series, about_s: float | None = None) -> FreeSwings | None:
    """The free swings of a series, or None where there is none.

    Args:
        series: the signal.
        about_s: the period as far as it is known, s; then 30 % around it is searched.
    """
    time, value = binned(series.time_s, series.value)
    if about_s:
        time, value = smoothed(time, value, about_s)
    best: FreeSwings | None = None
    for period in candidates(time, value, about_s):
        # What swings far less than the best so far need not be looked at.
        least = LEAST_WORTH * best.worth if best else 0.0
        swings = _with_period(series, time, value, period, least)
        # The period of the windows may be some percent off at first.
        if swings:
            swings = _with_period(series, time, value, swings.period_s, least) or swings
        if swings and (best is None or swings.worth > best.worth):
            best = swings
    return best


def _with_period(
    series: Series, time: Array, value: Array, period: float, least: float
) -> FreeSwings | None:
    """Free swings of about that period, and at least of such a worth."""
    runs: list[tuple[Segment, Run]] = []
    for piece in pieces(time, period / 3.0):
        t, v = time[piece], value[piece]
        for start, end in _idle(series, float(t[0]), float(t[-1])):
            inside = (t >= start) & (t <= end)
            whole = Segment(series.source, 0.0, t[inside], v[inside], series.unit.kind)
            if len(whole.time_s) >= SHORTEST_SWINGS * SAMPLES:
                runs += [(whole, run) for run in _runs(whole.time_s, whole.value, period)]
    runs.sort(key=lambda r: -r[1].worth)
    kept: list[Swing] = []
    wholes: dict[float, Segment] = {}
    for whole, run in runs[:MOST_RUNS]:
        if run.worth < max(LEAST_WORTH * runs[0][1].worth, least):
            break
        if any(_overlap(run, k) > 0.5 for k in kept):
            continue
        middle = 0.5 * (run.start_s + run.end_s)
        low = max((k.end_s for k in kept if k.end_s <= middle), default=-math.inf)
        high = min((k.start_s for k in kept if k.start_s >= middle), default=math.inf)
        if swing := refined(cut(whole, low, high, 0.0), run):
            kept.append(swing)
            wholes[swing.start_s] = whole
    if not kept:
        return None
    best = max(kept, key=lambda s: s.worth)
    kept = sorted((s for s in kept if _alike(s, best)), key=lambda s: s.start_s)
    kept = _joined(kept, wholes, period)
    best = max(kept, key=lambda s: s.worth)
    kept = [s for s in kept if _alike(s, best)]
    weights = np.array([s.worth for s in kept])
    omega = float(np.average([s.omega for s in kept], weights=weights))
    sigma = float(np.average([s.sigma for s in kept], weights=weights))
    ratio = max(sigma / omega, 1e-3)
    worth = sum(s.worth for s in kept)
    return FreeSwings([s.segment for s in kept], 2.0 * math.pi / omega, ratio, worth)


def _alike(swing: Swing, best: Swing) -> bool:
    """Whether a segment may be of the same pendulum as the best one; a weak one has to show it."""
    if swing.worth < LEAST_WORTH * best.worth:
        return False
    near = abs(swing.omega / best.omega - 1.0) < ALIKE
    return near or swing.worth > 0.3 * best.worth


def _joined(swings: Sequence[Swing], wholes: dict[float, Segment], period: float) -> list[Swing]:
    """Return the swings, with neighbours joined that are one swing parted by noise."""
    result: list[Swing] = []
    for swing in swings:
        if result and swing.start_s - result[-1].end_s < 1.5 * period:
            one = result[-1]
            better = one if one.worth > swing.worth else swing
            whole = wholes[better.start_s]
            run = Run(one.start_s, swing.end_s, better.omega, better.sigma, better.worth)
            both = refined(cut(whole, run.start_s, run.end_s, 0.0), run)
            if both and both.end_s - both.start_s > 0.9 * (run.end_s - run.start_s):
                wholes[both.start_s] = whole
                result[-1] = both
                continue
        result.append(swing)
    return result


def _overlap(one: Run, other: Swing) -> float:
    """Part of the first that is within the second."""
    common = min(one.end_s, other.end_s) - max(one.start_s, other.start_s)
    return common / (one.end_s - one.start_s)


def _idle(series: Series, start: float, end: float) -> list[tuple[float, float]]:
    """Return the parts of a stretch without commands; all of it where commands are not known."""
    if series.idle is None:
        return [(start, end)]
    inside = [(max(a + SETTLING_S, start), min(b, end)) for a, b in series.idle]
    return [(a, b) for a, b in inside if b > a]


def _runs(time: Array, value: Array, period: float) -> list[Run]:
    """Runs of windows that seem to swing freely."""
    dt = max(float(np.median(np.diff(time))), 1e-4)
    if period / dt < 0.9 * SAMPLES:
        return []
    step = period / max(STEPS, 1)
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
    runs = []
    for first, last in _stretches(free):
        a = float(grid[first * stride])
        b = float(grid[min((last + lag) * stride + width - 1, len(grid) - 1)])
        if b - a >= SHORTEST_SWINGS * period:
            part = slice(first, last + 1)
            weights = size[part] ** 2
            faster = float(np.average(turn[part], weights=weights))
            slower = float(np.average(decay[part], weights=weights))
            energy = float(np.mean(weights)) * (b - a)
            runs.append(Run(a, b, omega + faster, slower, energy))
    return runs


def _stretches(flags: Sequence[bool] | np.ndarray) -> list[tuple[int, int]]:
    """First and last of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(flags, dtype=int), [0]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
