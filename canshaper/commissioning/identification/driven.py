"""The driven swing: full speed of the tip, and the swing itself where it never was free.

The tip follows its command with a delay and a lag; its acceleration drives the pendulum,

    theta'' + 2 z w0 theta' + w0^2 theta = (w0^2 / g) V v',     v: command, V: full speed of the tip

as in `canshaper.shaping.sway`. Each stretch of driving has a free swing, an offset and a drift of
its own, which are eliminated; V is common to all, and its sign, which is that of the sensor, goes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import t as student

from canshaper.commissioning.identification.decay import (
    CONFIDENCE,
    DecayFit,
    Value,
    deviations,
    swing_values,
)
from canshaper.commissioning.identification.decay_problem import density
from canshaper.commissioning.identification.driven_data import Driven, stretches
from canshaper.commissioning.identification.series import (
    BIN_S,
    Array,
    Kind,
    Series,
)
from canshaper.shaping.sway import GRAVITY_M_S2

# Longest delay and lag of a valve that are looked for, s.
LONGEST_DELAY_S: Final = 0.5
LONGEST_LAG_S: Final = 0.6
SHORTEST_LAG_S: Final = 0.005  # of the model: without one it is another
# Stretches of a long log, spread over it, that are tried first from every start; all of them then
# from the best one.
FIRST_STRETCHES: Final = 16
# What a linear model with a delay and a lag leaves wrong of the full speed of a real valve: on the
# simulated crane, with a rate limit, it comes out up to 11 % too low.
MODEL_PART = 0.12
# The same of the period, and of the damping ratio itself, as large swings are slower and the other
# direction swings too: as in canshaper.commissioning.identification.decay.
MODEL_PERIOD, MODEL_RATIO_ABS = 0.013, 0.009


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of driving and what it fits.

    Attributes:
        source: file and signal.
        start_s: its start in the log.
        time_s: times from there.
        value: the data.
        fitted: the model.
        command: speed of the tip that is commanded at these times, part of full speed.
        kind: what the data is of the swing.
    """

    source: str
    start_s: float
    time_s: Array
    value: Array
    fitted: Array
    command: Array
    kind: Kind


@dataclass(frozen=True, slots=True)
class DrivenFit:
    """What the driven swing tells.

    Attributes:
        full_speed_m_s: speed of the tip at full command; None where the signal is no angle.
        period_s: period of the damped swing, where it was looked for.
        damping_ratio: damping ratio, where it was looked for.
        explained: part of what the commands could have made that they explain.
        delay_s: delay and lag of the valve together.
        stretches: the stretches.
    """

    full_speed_m_s: Value | None
    period_s: Value | None
    damping_ratio: Value | None
    explained: float
    delay_s: float
    stretches: list[Stretch]


def fit_driven(
    series: Sequence[Series], periods: Sequence[float], free: DecayFit | None
) -> DrivenFit | None:
    """Fit the driven swing of an axis.

    Args:
        series: its signals, of which those count that have commands.
        periods: periods that it may have, about, s; the one that explains most counts.
        free: period and damping as the free swings show them; None looks for them here.

    Returns:
        None where no axis was driven, or no command is known.
    """
    found = [f for period in periods if (f := _first_fit(series, period, free))]
    if not found:
        return None
    problem, x, low, high, _ = max(found, key=lambda f: f[-1])
    if len(problem.data) > FIRST_STRETCHES:
        x = _solved(problem, x, low, high).x
    return problem.result(x)


def _first_fit(
    series: Sequence[Series], period_s: float, free: DecayFit | None
) -> tuple["_Problem", Array, list[float], list[float], float] | None:
    """The problem of a period, its solution on a part of the stretches, bounds, part explained."""
    data = [part for one in series for part in stretches(one, period_s)]
    if not data:
        return None
    if free:
        known = _pole(free.period_s.value, max(free.damping_ratio.value, 0.0))
        start, low, high = [0.1, 0.1], [0.0, 0.0], [LONGEST_DELAY_S, LONGEST_LAG_S]
    else:
        known = None
        omega = 2.0 * math.pi / period_s
        start = [0.1, 0.1, omega, 0.05 * omega]
        low = [0.0, 0.0, 0.75 * omega, 0.0]
        high = [LONGEST_DELAY_S, LONGEST_LAG_S, 1.35 * omega, 0.6 * omega]
    problem = _Problem(data, known)
    every = -(-len(data) // FIRST_STRETCHES)
    first = _Problem(data[::every], known) if every > 1 else problem
    # A delay and a lag of the valve do nearly the same; from two starts the better one.
    starts = [np.array(start), np.array([0.3, 0.02, *start[2:]])]
    found = min((_solved(first, s, low, high) for s in starts), key=lambda f: float(f.cost))
    return problem, found.x, low, high, first.explained(found.x)


def _solved(problem: "_Problem", start: Array, low: list[float], high: list[float]) -> Any:
    return least_squares(problem.residual, start, bounds=(low, high), x_scale=high, max_nfev=60)


def _pole(period_s: float, ratio: float) -> tuple[float, float]:
    """Frequency and decay of a damped swing."""
    omega = 2.0 * math.pi / period_s
    return omega, omega * ratio / math.sqrt(1.0 - ratio * ratio)


class _Problem:
    """Least squares over delay and lag of the valve and, unless known, frequency and decay."""

    def __init__(self, data: Sequence[Driven], known: tuple[float, float] | None) -> None:
        self.data = data
        self.known = known
        self._known_bases = _bases(data, *known) if known else None

    def parts(self, x: Array) -> list[tuple[Array, Array, Array]]:
        """Of each stretch: swing by commands at unit speed, free columns, commanded speed."""
        omega, sigma = self.known or (float(x[2]), float(x[3]))
        driven = _responses(self.data, omega, sigma, float(x[0]), float(x[1]))
        columns = [_free_columns(one, omega, sigma) for one in self.data]
        return [(swing, free, speed) for (swing, speed), free in zip(driven, columns, strict=True)]

    def projected(self, x: Array) -> list[tuple[Array, Array]]:
        """Of each stretch: unit swing and data, both without what free swings explain."""
        omega, sigma = self.known or (float(x[2]), float(x[3]))
        driven = _responses(self.data, omega, sigma, float(x[0]), float(x[1]))
        bases = self._known_bases or _bases(self.data, omega, sigma)
        return [
            (swing - q @ (q.T @ swing), rest)
            for (swing, _), (q, rest) in zip(driven, bases, strict=True)
        ]

    @staticmethod
    def speed(projected: Sequence[tuple[Array, Array]]) -> float:
        """Full speed of least squares."""
        square = sum(float(h @ h) for h, _ in projected)
        return sum(float(h @ y) for h, y in projected) / max(square, 1e-30)

    def residual(self, x: Array) -> Array:
        """Residual of all stretches."""
        projected = self.projected(x)
        gain = self.speed(projected)
        return np.concatenate([y - gain * h for h, y in projected])

    def explained(self, x: Array) -> float:
        """Part of what the commands could have made that they explain."""
        projected = self.projected(x)
        gain = self.speed(projected)
        total = sum(float(y @ y) for _, y in projected)
        left = sum(float(np.sum((y - gain * h) ** 2)) for h, y in projected)
        return 1.0 - left / max(total, 1e-30)

    def result(self, x: Array) -> DrivenFit:
        """What was found."""
        projected = self.projected(x)
        gain = self.speed(projected)
        omega, sigma = self.known or (float(x[2]), float(x[3]))
        deviation = self._gain_deviation(projected, gain, omega)
        factor = float(student.ppf(0.5 + CONFIDENCE / 2.0, max(3, 4 * len(self.data))))
        angles = all(one.kind is not Kind.OTHER for one in self.data)
        period = ratio = None
        if self.known is None:
            halves = [factor * d for d in self._swing_deviations(x)]
            values = swing_values(np.array([omega, sigma]))
            parts = MODEL_PERIOD * values[0], MODEL_RATIO_ABS
            period, ratio = (
                Value(v, math.hypot(h, part))
                for v, h, part in zip(values, halves, parts, strict=True)
            )
        stretches = []
        for one, (driven, free, speed) in zip(self.data, self.parts(x), strict=True):
            rest, *_ = np.linalg.lstsq(free, one.value - gain * driven, rcond=None)
            fitted = gain * driven + free @ rest
            stretches.append(
                Stretch(one.source, one.start_s, one.time_s, one.value, fitted, speed, one.kind)
            )
        return DrivenFit(
            Value(abs(gain), math.hypot(factor * deviation, MODEL_PART * gain)) if angles else None,
            period,
            ratio,
            self.explained(x),
            float(x[0] + x[1]),
            stretches,
        )

    def _gain_deviation(
        self, projected: Sequence[tuple[Array, Array]], gain: float, omega: float
    ) -> float:
        """By the noise at the frequency of the swing, or by how the stretches differ."""
        squares = [float(h @ h) for h, _ in projected]
        noise = 0.0
        for one, (h, y), square in zip(self.data, projected, squares, strict=True):
            noise += density(one.time_s, y - gain * h, omega)[0] * square
        own = math.sqrt(noise) / sum(squares)
        if len(projected) < 2:
            return own
        spread = sum(float(h @ (y - gain * h)) ** 2 for h, y in projected)
        count = len(projected)
        return max(own, math.sqrt(spread * count / (count - 1)) / sum(squares))

    def _swing_deviations(self, x: Array) -> tuple[float, float]:
        """Of period and damping ratio, by the noise at the frequency of the swing."""
        columns = []
        for j, value in enumerate(x):
            step = np.zeros(len(x))
            step[j] = 1e-4 * max(abs(float(value)), 0.05)
            columns.append((self.residual(x + step) - self.residual(x - step)) / (2.0 * step[j]))
        slope = np.stack(columns, axis=1)
        residual = self.residual(x)
        meat, first = np.zeros((len(x), len(x))), 0
        for one in self.data:
            part = slice(first, first + len(one.time_s))
            noise, _ = density(one.time_s, residual[part], float(x[2]))
            meat += noise * slope[part].T @ slope[part]
            first = part.stop
        inverse = np.linalg.pinv(slope.T @ slope)
        covariance = inverse @ meat @ inverse
        return deviations(x[2:4], covariance[2:4, 2:4])


def _free_columns(one: Driven, omega: float, sigma: float) -> Array:
    """What a stretch may show without a command: a free swing, an offset, a drift."""
    t = one.time_s
    decay = np.exp(-sigma * t)
    return np.stack(
        [decay * np.cos(omega * t), decay * np.sin(omega * t), np.ones_like(t), t], axis=1
    )


def _bases(data: Sequence[Driven], omega: float, sigma: float) -> list[tuple[Array, Array]]:
    """Of each stretch: an orthonormal basis of the free columns, and the data without them."""
    found = []
    for one in data:
        q, _ = np.linalg.qr(_free_columns(one, omega, sigma))
        found.append((q, one.value - q @ (q.T @ one.value)))
    return found


def _responses(
    data: Sequence[Driven], omega: float, sigma: float, delay: float, lag: float
) -> list[tuple[Array, Array]]:
    """Of each stretch: swing by its commands at a full speed of 1 m/s, and the commanded speed."""
    filters = {
        kind: _swing_filter(omega, sigma, max(lag, SHORTEST_LAG_S), kind)
        for kind in {one.kind for one in data}
    }
    return [_response(one, filters[one.kind], delay) for one in data]


def _response(one: Driven, swing_filter: tuple[Array, Array], delay: float) -> tuple[Array, Array]:
    grid = np.arange(0.0, float(one.time_s[-1]) + 1.0 + 2.0 * BIN_S, BIN_S)
    at = np.searchsorted(one.command.time_s, one.start_s - 1.0 + grid - delay, side="right") - 1
    speed = np.where(at >= 0, one.command.speed[np.maximum(at, 0)], 0.0)
    # From rest at the first command's level; a swing before it is a free one.
    swing = lfilter(*swing_filter, speed - speed[0])
    time = one.time_s + 1.0
    return np.interp(time, grid, swing), np.interp(time, grid, speed)


def _swing_filter(omega: float, sigma: float, lag: float, kind: Kind) -> tuple[Array, Array]:
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
    decays = np.exp(poles * BIN_S)
    parts = [residue * np.poly(np.delete(decays, i)) for i, residue in enumerate(residues)]
    b = np.convolve([1.0, -1.0], np.sum(parts, axis=0)).real
    return b, np.asarray(np.poly(decays).real, dtype=np.float64)
