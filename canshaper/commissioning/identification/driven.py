"""The driven swing: full speed of the tip, and the swing itself where it never was free.

What free swings explain is eliminated; the full speed is common to all stretches, and its sign,
which is that of the sensor, goes.
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
    density,
    deviations,
    swing_values,
)
from canshaper.commissioning.identification.driven_data import (
    Driven,
    covariance_of,
    free_columns,
    gain_of,
    responses,
    squares_of,
    stretches,
)
from canshaper.commissioning.identification.series import Array, Kind, Series, Value

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


class Stretch(NamedTuple):
    """A stretch of driving, the model of it, and the speed that is commanded at its times."""

    data: Driven
    fitted: Array
    speed: Array


@dataclass(frozen=True, slots=True)
class DrivenFit:
    """Result of fitting the driven swing."""

    full_speed_m_s: Value | None  # of the tip at full command; None where the signal is no angle
    period_s: Value | None  # of the damped swing, where it was looked for
    damping_ratio: Value | None  # where it was looked for
    explained: float  # part of what the commands could have made that they explain
    delay_s: float  # delay and lag of the valve together
    stretches: list[Stretch]


def fit_driven(
    series: Sequence[Series], periods: Sequence[float], free: DecayFit | None
) -> DrivenFit | None:
    """Fit the driven swing of an axis; None where no axis was driven, or no command is known.

    Args:
        series: its signals, of which those count that have commands.
        periods: periods that it may have, about, s; the one that explains most counts.
        free: period and damping as the free swings show them; None looks for them here.
    """
    fits = []
    for period in periods:
        data = [part for one in series for part in stretches(one, period)]
        if data:
            problem = _Problem(data, 2.0 * math.pi / period, free)
            fits.append((problem, *problem.solved_first()))
    if not fits:
        return None
    problem, x, _ = max(fits, key=lambda fit: fit[2])
    if len(problem.data) > FIRST_STRETCHES:
        x = problem.solved(x).x
    return problem.result(x)


class _Problem:
    """Least squares over delay and lag of the valve and, without a free swing, frequency and decay.

    ``omega``: the frequency, about.
    """

    def __init__(self, data: Sequence[Driven], omega: float, free: DecayFit | None) -> None:
        self.data = data
        self._omega, self._free = omega, free
        self._low, self._high = [0.0, 0.0], [LONGEST_DELAY_S, LONGEST_LAG_S]
        # A delay and a lag of the valve do nearly the same; from two starts the better one.
        self._starts = [[0.1, 0.1], [0.3, 0.02]]
        if free:
            known, ratio = 2.0 * math.pi / free.period_s.value, max(free.damping_ratio.value, 0.0)
            self._known = known, known * ratio / math.sqrt(1.0 - ratio * ratio)
            self._known_bases = self._bases(*self._known)
        else:
            self._low += [0.75 * omega, 0.0]
            self._high += [1.35 * omega, 0.6 * omega]
            self._starts = [[*start, omega, 0.05 * omega] for start in self._starts]

    def _pole(self, x: Array) -> tuple[float, float]:
        """Frequency and decay."""
        return self._known if self._free else (float(x[2]), float(x[3]))

    def _bases(self, omega: float, sigma: float) -> list[tuple[Array, Array]]:
        """Return for each stretch: orthonormal basis of free swings, and data without them."""
        bases = []
        for one in self.data:
            q, _ = np.linalg.qr(free_columns(one, omega, sigma))
            bases.append((q, one.value - q @ (q.T @ one.value)))
        return bases

    def _projected(self, x: Array) -> list[tuple[Array, Array]]:
        """Return for each stretch: unit swing and data, both without what free swings explain."""
        pole = self._pole(x)
        swings = responses(self.data, *pole, float(x[0]), float(x[1]))
        bases = self._known_bases if self._free else self._bases(*pole)
        return [
            (swing - q @ (q.T @ swing), rest)
            for (swing, _), (q, rest) in zip(swings, bases, strict=True)
        ]

    def _residual(self, x: Array) -> Array:
        projected = self._projected(x)
        gain = gain_of(projected)
        return np.concatenate([y - gain * h for h, y in projected])

    def solved(self, start: Sequence[float] | Array) -> Any:
        """Return the solution of SciPy from a start."""
        bounds, scale = (self._low, self._high), self._high
        return least_squares(self._residual, start, bounds=bounds, x_scale=scale, max_nfev=60)

    def solved_first(self) -> tuple[Array, float]:
        """Return the best solution on a part of the stretches, and what it explains of these."""
        every = -(-len(self.data) // FIRST_STRETCHES)
        first = _Problem(self.data[::every], self._omega, self._free) if every > 1 else self
        best = min(map(first.solved, self._starts), key=lambda fit: float(fit.cost)).x
        return best, first._explained(best)

    def _explained(self, x: Array) -> float:
        """Part of what the commands could have made that they explain."""
        total, left = squares_of(self._projected(x))
        return 1.0 - left / max(total, 1e-30)

    def result(self, x: Array) -> DrivenFit:
        """Return the fit at a solution."""
        projected, pole = self._projected(x), self._pole(x)
        gain = gain_of(projected)
        factor = float(student.ppf(0.5 + CONFIDENCE / 2.0, max(3, 4 * len(self.data))))
        speed = period = ratio = None
        if all(one.kind is not Kind.OTHER for one in self.data):
            half = factor * self._gain_deviation(projected, gain, pole[0])
            speed = Value(abs(gain), math.hypot(half, MODEL_PART * gain))
        if not self._free:
            values = swing_values(*pole)
            parts = MODEL_PERIOD * values[0], MODEL_RATIO_ABS
            period, ratio = (
                Value(v, math.hypot(factor * d, part))
                for v, d, part in zip(values, self._swing_deviations(x), parts, strict=True)
            )
        fitted = []
        swings = responses(self.data, *pole, float(x[0]), float(x[1]))
        for one, (swing, command) in zip(self.data, swings, strict=True):
            free = free_columns(one, *pole)
            rest, *_ = np.linalg.lstsq(free, one.value - gain * swing, rcond=None)
            fitted.append(Stretch(one, gain * swing + free @ rest, command))
        return DrivenFit(speed, period, ratio, self._explained(x), float(x[0] + x[1]), fitted)

    def _gain_deviation(
        self, projected: Sequence[tuple[Array, Array]], gain: float, omega: float
    ) -> float:
        """Return the deviation of the gain: by the noise or by the stretches, the larger one."""
        noise = spread = square = 0.0
        for one, (h, y) in zip(self.data, projected, strict=True):
            residual, own = y - gain * h, float(h @ h)
            noise += density(one.time_s, residual, omega)[0] * own
            spread += float(h @ residual) ** 2
            square += own
        count = len(projected)
        spread = math.sqrt(spread * count / (count - 1)) if count > 1 else 0.0
        return max(math.sqrt(noise), spread) / square

    def _swing_deviations(self, x: Array) -> tuple[float, float]:
        """Return the deviations of period and damping ratio, by the noise around the swing."""
        columns = []
        for step in np.diag(1e-4 * np.maximum(np.abs(x), 0.05)):
            columns.append((self._residual(x + step) - self._residual(x - step)) / 2.0 / step.max())
        slope = np.stack(columns, axis=1)
        covariance = covariance_of(slope, self._residual(x), self.data, float(x[2]))
        return deviations(x[2:4], covariance[2:4, 2:4])
