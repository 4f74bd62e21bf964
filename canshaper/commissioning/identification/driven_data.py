"""Stretches of a log in which an axis is driven, and the model of its swing there.

The tip follows its command after a delay, with a lag of first order, and drives the pendulum; a
free swing, an offset and a drift of each stretch come on top.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import lfilter

from canshaper.commissioning.identification.commands import STANDS
from canshaper.commissioning.identification.decay import density
from canshaper.commissioning.identification.series import (
    BIN_S,
    Array,
    Command,
    Kind,
    Segment,
    Series,
    binned,
)
from canshaper.shaping.sway import GRAVITY_M_S2

# A stretch begins so many periods before its first command, to know the swing that is there
# already, goes on so many after the last, and is at most about so many long.
BEFORE, AFTER, LONGEST = 1.0, 2.0, 8.0
# So much earlier than a stretch a command may still matter: a second of the filter's past, and the
# longest delay of a valve.
EARLIER_S = 2.0
SHORTEST_LAG_S: Final = 0.005  # of the model: without one it is another


@dataclass(frozen=True, slots=True)
class Driven(Segment):
    """One stretch: its data, and the commands that drove it, on the clock of the log."""

    command: Command


def driven_s(series: Series) -> float:
    """Seconds in which the axis of a series was commanded to move."""
    if series.command is None or not len(series.command.time_s):
        return 0.0
    held = np.diff(series.command.time_s, append=series.command.time_s[-1])
    return float(held[np.abs(series.command.speed) > STANDS].sum())


def stretches(series: Series, period: float) -> list[Driven]:
    """Stretches of a series with commands, each with some periods before and after them."""
    command = series.command
    if command is None or not len(command.time_s):
        return []
    moving = np.abs(command.speed) > STANDS
    ends = np.append(command.time_s[1:], command.time_s[-1])
    spans: list[list[float]] = []
    for a, b in zip(command.time_s[moving], ends[moving], strict=True):
        first, last = float(a) - BEFORE * period, float(b) + AFTER * period
        if spans and last - spans[-1][0] <= LONGEST * period:
            spans[-1][1] = last
        elif not spans or first >= spans[-1][1] - (BEFORE + AFTER) * period:
            spans.append([max(first, spans[-1][1]) if spans else first, last])
    time, value = binned(series.time_s, series.value)
    result = []
    for first, last in spans:
        inside = (time >= first) & (time <= last)
        t, v = time[inside], value[inside]
        if len(t) > 20 and t[-1] - t[0] > period and np.diff(t).max() < period / 3.0:
            start = float(t[0])
            low, high = np.searchsorted(
                command.time_s, [start - EARLIER_S, start + float(t[-1])], side="right"
            )
            part = slice(max(0, low - 1), high)  # with what holds at the start
            held = Command(command.time_s[part], command.speed[part])
            result.append(Driven(series.source, start, t - start, v, series.unit.kind, held))
    return result


def free_columns(one: Segment, omega: float, sigma: float) -> Array:
    """Return the columns of a stretch without a command: free swing, offset, drift."""
    t = one.time_s
    decay = np.exp(-sigma * t)
    return np.stack(
        [decay * np.cos(omega * t), decay * np.sin(omega * t), np.ones_like(t), t], axis=1
    )


def responses(
    data: Sequence[Driven], omega: float, sigma: float, delay: float, lag: float
) -> list[tuple[Array, Array]]:
    """Return for each stretch: swing by its commands at 1 m/s full speed, and commanded speed."""
    filters = {
        kind: swing_filter(omega, sigma, max(lag, SHORTEST_LAG_S), kind)
        for kind in {one.kind for one in data}
    }
    pairs = []
    for one in data:
        grid = np.arange(0.0, float(one.time_s[-1]) + 1.0 + 2.0 * BIN_S, BIN_S)
        at = np.searchsorted(one.command.time_s, one.start_s - 1.0 + grid - delay, side="right") - 1
        speed = np.where(at >= 0, one.command.speed[np.maximum(at, 0)], 0.0)
        # From rest at the first command's level; a swing before it is a free one.
        swing = lfilter(*filters[one.kind], speed - speed[0])
        time = one.time_s + 1.0
        pairs.append((np.interp(time, grid, swing), np.interp(time, grid, speed)))
    return pairs


def swing_filter(
    omega: float, sigma: float, lag: float, kind: Kind, step_s: float = BIN_S
) -> tuple[Array, Array]:
    """Swing by the speed that is commanded, sampled with a zero-order hold: b and a of z^-1.

    By partial fractions of the step response, as a matrix exponential for every try of the solver
    takes most of its time. The three poles differ: one is real, two are not.
    """
    square = omega**2 + sigma**2
    poles = np.array([-1.0 / lag, complex(-sigma, omega), complex(-sigma, -omega)])
    apart = np.array([np.prod(pole - np.delete(poles, i)) for i, pole in enumerate(poles)])
    residues = square / (GRAVITY_M_S2 * lag * apart)
    if kind is Kind.RATE:
        residues = residues * poles
    decays = np.exp(poles * step_s)
    parts = [residue * np.poly(np.delete(decays, i)) for i, residue in enumerate(residues)]
    b = np.convolve([1.0, -1.0], np.sum(parts, axis=0)).real
    return b, np.asarray(np.poly(decays).real, dtype=np.float64)


Projected = Sequence[tuple[Array, Array]]  # swing and data of each stretch, without free swings


def gain_of(projected: Projected) -> float:
    """Gain of least squares between swing and data."""
    square = sum(float(h @ h) for h, _ in projected)
    return sum(float(h @ y) for h, y in projected) / max(square, 1e-30)


def squares_of(projected: Projected) -> tuple[float, float]:
    """Sum of the squares of the data, and of what the swing leaves of them."""
    gain = gain_of(projected)
    left = sum(float(np.sum((y - gain * h) ** 2)) for h, y in projected)
    return sum(float(y @ y) for _, y in projected), left


def covariance_of(slope: Array, residual: Array, data: Sequence[Segment], omega: float) -> Array:
    """Covariance of parameters by the slopes of the residuals, and the noise around the swing."""
    meat, first = np.zeros((slope.shape[1],) * 2), 0
    for one in data:
        part = slice(first, first + len(one.time_s))
        noise, _ = density(one.time_s, residual[part], omega)
        meat += noise * slope[part].T @ slope[part]
        first = part.stop
    inverse = np.linalg.pinv(slope.T @ slope)
    return np.asarray(inverse @ meat @ inverse)
