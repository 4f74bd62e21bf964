"""The driven swing: full speed of the tip, and the swing itself where it never was free.

The model is that of `driven_model`. The free swing, the offset and the drift of each stretch are
eliminated; the full speed is common to all, and its sign, which is that of the sensor, goes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from canshaper.commissioning.identification.decay import (
    CONFIDENCE,
    DecayFit,
    Value,
    deviations,
    swing_values,
)
from canshaper.commissioning.identification.decay_problem import density
from canshaper.commissioning.identification.driven_data import (
    Driven,
    bases_of,
    free_columns,
    responses,
    stretches,
)
from canshaper.commissioning.identification.series import Array, Kind, Series

# Longest delay and lag of a valve that are looked for, s.
LONGEST_DELAY_S: Final = 0.5
LONGEST_LAG_S: Final = 0.6
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
    """Result of fitting the driven swing.

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
    fits = [fit for period in periods if (fit := _first_fit(series, period, free))]
    if not fits:
        return None
    problem, x, _ = max(fits, key=lambda fit: fit.explained)
    if len(problem.data) > FIRST_STRETCHES:
        x = problem.solved(x).x
    return problem.result(x)


class _FirstFit(NamedTuple):
    """The problem of a period, its solution on a part of the stretches, and what that explains."""

    problem: "_Problem"
    x: Array
    explained: float


def _first_fit(
    series: Sequence[Series], period_s: float, free: DecayFit | None
) -> _FirstFit | None:
    data = [part for one in series for part in stretches(one, period_s)]
    if not data:
        return None
    omega, known = 2.0 * math.pi / period_s, None
    # A delay and a lag of the valve do nearly the same; from two starts the better one.
    starts = [[0.1, 0.1], [0.3, 0.02]]
    if free:
        known = _pole(free.period_s.value, max(free.damping_ratio.value, 0.0))
    else:
        starts = [[*start, omega, 0.05 * omega] for start in starts]
    problem = _Problem(data, known, omega)
    every = -(-len(data) // FIRST_STRETCHES)
    first = _Problem(data[::every], known, omega) if every > 1 else problem
    best = min((first.solved(np.array(s)) for s in starts), key=lambda fit: float(fit.cost))
    return _FirstFit(problem, best.x, first.explained(best.x))


def _pole(period_s: float, ratio: float) -> tuple[float, float]:
    """Frequency and decay of a damped swing."""
    omega = 2.0 * math.pi / period_s
    return omega, omega * ratio / math.sqrt(1.0 - ratio * ratio)


class _Problem:
    """Least squares over delay and lag of the valve and, unless known, frequency and decay.

    Args:
        data: the stretches.
        known: frequency and decay.
        omega: frequency, about.
    """

    def __init__(
        self, data: Sequence[Driven], known: tuple[float, float] | None, omega: float
    ) -> None:
        self.data = data
        self.known = known
        self._low, self._high = [0.0, 0.0], [LONGEST_DELAY_S, LONGEST_LAG_S]
        if known is None:
            self._low += [0.75 * omega, 0.0]
            self._high += [1.35 * omega, 0.6 * omega]
        self._known_bases = bases_of(data, *known) if known else None

    def parts(self, x: Array) -> list[tuple[Array, Array, Array]]:
        """Return for each stretch: swing by unit commands, free columns, commanded speed."""
        omega, sigma = self.known or (float(x[2]), float(x[3]))
        driven = responses(self.data, omega, sigma, float(x[0]), float(x[1]))
        columns = [free_columns(one, omega, sigma) for one in self.data]
        return [(swing, free, speed) for (swing, speed), free in zip(driven, columns, strict=True)]

    def projected(self, x: Array) -> list[tuple[Array, Array]]:
        """Return for each stretch: unit swing and data, both without what free swings explain."""
        omega, sigma = self.known or (float(x[2]), float(x[3]))
        driven = responses(self.data, omega, sigma, float(x[0]), float(x[1]))
        bases = self._known_bases or bases_of(self.data, omega, sigma)
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

    def solved(self, start: Array) -> Any:
        """Return the solution of SciPy from a start."""
        bounds, scale = (self._low, self._high), self._high
        return least_squares(self.residual, start, bounds=bounds, x_scale=scale, max_nfev=60)

    def explained(self, x: Array) -> float:
        """Part of what the commands could have made that they explain."""
        projected = self.projected(x)
        return self._explained(projected, self.speed(projected))

    @staticmethod
    def _explained(projected: Sequence[tuple[Array, Array]], gain: float) -> float:
        total = sum(float(y @ y) for _, y in projected)
        left = sum(float(np.sum((y - gain * h) ** 2)) for h, y in projected)
        return 1.0 - left / max(total, 1e-30)

    def result(self, x: Array) -> DrivenFit:
        """Return the fit at a solution."""
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
            self._explained(projected, gain),
            float(x[0] + x[1]),
            stretches,
        )

    def _gain_deviation(
        self, projected: Sequence[tuple[Array, Array]], gain: float, omega: float
    ) -> float:
        """Return the deviation of the gain: by the noise or by the stretches, the larger one."""
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
        """Return the deviations of period and damping ratio, by the noise around the swing."""
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
