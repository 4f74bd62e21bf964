"""The driven swing: full speed of the tip, and the swing itself where it never was free.

The tip follows its command after a delay, with a lag of first order, and drives the pendulum. Each
stretch has a free swing, an offset and a drift of its own, which are eliminated. The full speed is
common to all stretches; its sign is that of the sensor, and is dropped.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import t as student

from canshaper.commissioning.identification.decay import (
    CONFIDENCE,
    DecayFit,
    covariance_of,
    deviations,
    free_columns,
    swing_values,
)
from canshaper.commissioning.identification.series import (
    BIN_S,
    STANDS,
    Array,
    Command,
    Kind,
    Segment,
    Series,
    Value,
    binned,
)
from canshaper.shaping.sway import GRAVITY_M_S2

# In periods: a stretch begins so long before its first command, as a swing may be there already,
# ends so long after its last one, and lasts about so long at most.
BEFORE, AFTER, LONGEST = 1.0, 2.0, 8.0
# Commands so long before a stretch still matter: a second of the filter's past, and the longest
# delay of a valve.
EARLIER_S = 2.0
SHORTEST_LAG_S: Final = 0.005  # the model has no form without a lag
# Longest delay and lag of a valve that are looked for, s.
LONGEST_DELAY_S, LONGEST_LAG_S = 0.5, 0.6
# Of a long log so many stretches, spread over it, are solved from every start; then all of them
# from the best solution.
FIRST_STRETCHES: Final = 16
# Error of the full speed by the linear model of the valve, as a part: with the rate limit of the
# simulated crane it comes out up to 11 % too low.
MODEL_PART = 0.12
# Errors of the period, as a part, and of the damping ratio: large swings are slower, and the other
# direction swings too. See canshaper.commissioning.identification.decay.
MODEL_PERIOD, MODEL_RATIO_ABS = 0.013, 0.009


@dataclass(frozen=True, slots=True)
class Driven(Segment):
    """One stretch: its data, timed from its start; the commands that drove it, timed by the log."""

    command: Command


class Stretch(NamedTuple):
    """A stretch, its fitted swing, and the delayed command at its times, part of full speed."""

    data: Driven
    fitted: Array
    speed: Array


@dataclass(frozen=True, slots=True)
class DrivenFit:
    """Result of fitting the driven swing."""

    full_speed_m_s: Value | None  # of the tip at full command; None where the signal is no angle
    period_s: Value | None  # of the damped swing, where it was looked for
    damping_ratio: Value | None  # where it was looked for
    explained: float  # part of the swing that the commands explain, free swings left out
    delay_s: float  # delay and lag of the valve together
    stretches: list[Stretch]


def stretches(series: Series, period: float) -> list[Driven]:
    """Return the driven stretches with some periods around them; those with gaps are left out."""
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


@lru_cache(maxsize=8)
def swing_filter(
    omega: float, sigma: float, lag: float, kind: Kind, step_s: float = BIN_S
) -> tuple[Array, Array]:
    """Return b and a (of z^-1) of the filter from speed, m/s, to swing, zero-order hold.

    They come from partial fractions of the step response: a matrix exponential would take most of
    the solver's time. The three poles always differ: one is real, two are complex.
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


@dataclass(frozen=True, slots=True)
class DrivenProblem:
    """Least squares over the model of a driven swing, whose linear parameters are eliminated.

    Attributes:
        model: returns for each stretch, by the parameters, its swing at 1 m/s full speed, and the
            columns of its free swing and offset.
        low, high, scale: bounds of the parameters, and the size of a step of each.
        starts: parameters that the solver starts from.
    """

    data: Sequence[Driven]
    model: Callable[[Array], list[tuple[Array, Array]]]
    low: list[float]
    high: list[float]
    scale: list[float]
    starts: list[list[float]]

    def solved(self, *starts: Sequence[float] | Array) -> Array:
        """Return the best solution from some starts."""
        solve = partial(least_squares, self.residual, bounds=(self.low, self.high), max_nfev=60)
        fits = [solve(x, x_scale=self.scale) for x in starts]
        return np.asarray(min(fits, key=lambda fit: float(fit.cost)).x)

    def projected(self, x: Array) -> list[tuple[Array, Array]]:
        """Return for each stretch swing and data, both without what its columns explain."""
        pairs = []
        for one, (swing, free) in zip(self.data, self.model(x), strict=True):
            q, _ = np.linalg.qr(free)
            pairs.append((swing - q @ (q.T @ swing), one.value - q @ (q.T @ one.value)))
        return pairs

    def residual(self, x: Array, gain: float | None = None) -> Array:
        """Return the residual of all data, with a given full speed (gain, m/s) or the best one."""
        projected = self.projected(x)
        gain = gain_of(projected) if gain is None else gain
        return np.concatenate([y - gain * h for h, y in projected])

    def squares(self, x: Array) -> tuple[float, float]:
        """Return the sums of squares: of the data without free swings, and of their residual."""
        left = self.residual(x)
        return sum(float(y @ y) for _, y in self.projected(x)), float(left @ left)

    def explained(self, x: Array) -> float:
        """Return the part of the data, without free swings, that the commands explain."""
        total, left = self.squares(x)
        return 1.0 - left / max(total, 1e-30)

    def fitted(self, x: Array) -> list[tuple[Array, Array]]:
        """Return for each stretch its fitted swing, and the factors of its columns."""
        gain, fits = gain_of(self.projected(x)), list[tuple[Array, Array]]()
        for one, (swing, free) in zip(self.data, self.model(x), strict=True):
            amounts, *_ = np.linalg.lstsq(free, one.value - gain * swing, rcond=None)
            fits.append((gain * swing + free @ amounts, np.asarray(amounts)))
        return fits


def gain_of(projected: Sequence[tuple[Array, Array]]) -> float:
    """Return the best full speed, m/s with the sensor's sign, of (swing, data) of each stretch."""
    square = sum(float(h @ h) for h, _ in projected)
    return sum(float(h @ y) for h, y in projected) / max(square, 1e-30)


def fit_driven(
    series: Sequence[Series], periods: Sequence[float], free: DecayFit | None
) -> DrivenFit | None:
    """Fit the driven swing of an axis; None where it was not driven, or no command is known.

    Args:
        series: its signals, of which those count that have commands.
        periods: approximate periods to try, s; the one that explains most counts.
        free: fit of the free swings, which fixes period and damping; None to fit them here.
    """
    fits = []
    for period in periods:
        data = [part for one in series for part in stretches(one, period)]
        if data:
            every, omega = -(-len(data) // FIRST_STRETCHES), 2.0 * math.pi / period
            first = _problem(data[::every], omega, free)
            x = first.solved(*first.starts)
            fits.append((first.explained(x), _problem(data, omega, free), x))
    if not fits:
        return None
    _, problem, x = max(fits, key=lambda fit: fit[0])
    if len(problem.data) > FIRST_STRETCHES:
        x = problem.solved(x)
    return _result(problem, x, free)


def _problem(data: Sequence[Driven], omega: float, free: DecayFit | None) -> DrivenProblem:
    """Return the problem over delay and lag of the valve; without ``free``, the swing's too."""
    low, high = [0.0, 0.0], [LONGEST_DELAY_S, LONGEST_LAG_S]
    # Delay and lag of a valve act nearly alike: of two starts the better solution counts.
    starts = [[0.1, 0.1], [0.3, 0.02]]
    if free is None:
        low += [0.75 * omega, 0.0]
        high += [1.35 * omega, 0.6 * omega]
        starts = [[*start, omega, 0.05 * omega] for start in starts]
    return DrivenProblem(data, partial(_model, data, free), low, high, high, starts)


def _pole(free: DecayFit | None, x: Array) -> tuple[float, float]:
    """Return frequency, rad/s, and decay, 1/s."""
    if free is None:
        return float(x[2]), float(x[3])
    omega, ratio = 2.0 * math.pi / free.period_s.value, max(free.damping_ratio.value, 0.0)
    return omega, omega * ratio / math.sqrt(1.0 - ratio * ratio)


def _model(data: Sequence[Driven], free: DecayFit | None, x: Array) -> list[tuple[Array, Array]]:
    omega, sigma = _pole(free, x)
    delay, lag = float(x[0]), max(float(x[1]), SHORTEST_LAG_S)
    parts = []
    for one in data:
        grid = np.arange(-1.0, float(one.time_s[-1]) + 2.0 * BIN_S, BIN_S)
        speed = one.command.at(one.start_s + grid - delay)
        # From rest at the first command's level; a swing before it is a free one.
        swing = lfilter(*swing_filter(omega, sigma, lag, one.kind), speed - speed[0])
        time = one.time_s
        columns = free_columns(time, omega * time, np.exp(-sigma * time))
        parts.append((np.interp(time, grid, swing), columns))
    return parts


def _result(problem: DrivenProblem, x: Array, free: DecayFit | None) -> DrivenFit:
    data, gain, (omega, sigma) = problem.data, gain_of(problem.projected(x)), _pole(free, x)
    factor = float(student.ppf(0.5 + CONFIDENCE / 2.0, max(3, 4 * len(data))))
    speed = period = ratio = None
    if all(one.kind is not Kind.OTHER for one in data):
        half = factor * _gain_deviation(problem, x, gain, omega)
        speed = Value(abs(gain), math.hypot(half, MODEL_PART * gain))
    if free is None:
        steps = 1e-4 * np.maximum(np.abs(x), 0.05)
        covariance, _ = covariance_of(problem.residual, x, steps, data, omega)
        values = swing_values(omega, sigma)
        parts = MODEL_PERIOD * values[0], MODEL_RATIO_ABS
        period, ratio = (
            Value(v, math.hypot(factor * d, part))
            for v, d, part in zip(values, deviations(x[2:], covariance[2:, 2:]), parts, strict=True)
        )
    fitted = [
        Stretch(one, model, one.command.at(one.start_s + one.time_s - float(x[0])))
        for one, (model, _) in zip(data, problem.fitted(x), strict=True)
    ]
    explained = problem.explained(x)
    return DrivenFit(speed, period, ratio, explained, float(x[0] + x[1]), fitted)


def _gain_deviation(problem: DrivenProblem, x: Array, gain: float, omega: float) -> float:
    """Return the deviation of the gain, m/s: by noise or by the stretches, the larger one."""
    one, data = np.array([gain]), problem.data
    noise, _ = covariance_of(lambda g: problem.residual(x, g[0]), one, np.ones(1), data, omega)
    pairs = problem.projected(x)
    spread = sum(float(h @ (y - gain * h)) ** 2 for h, y in pairs) / max(len(pairs) - 1, 1)
    square = sum(float(h @ h) for h, _ in pairs)
    by_stretches = math.sqrt(len(pairs) * spread) / square if len(pairs) > 1 else 0.0
    return max(math.sqrt(noise[0, 0]), by_stretches)
