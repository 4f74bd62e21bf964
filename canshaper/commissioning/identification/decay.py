"""Period and damping of free swings, fitted together, with their intervals.

In a free swing of a pendulum with small damping

    y = exp(-s t) (a cos p + b sin p) + c + d t,    p = w (t - A^2/16 * integral exp(-2 s t) dt)

with the amplitude A in rad: a large swing takes longer (T = T0 (1 + A^2/16)). Frequency w and decay
s are common to all segments; a, b, c and d belong to each and are eliminated (variable projection,
Golub and Pereyra 1973), so two unknowns remain.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import least_squares
from scipy.stats import t as student

from canshaper.commissioning.identification.series import Array, Segment, Value

CONFIDENCE: Final = 0.95
# Errors of the model, which the noise does not show: a tool on two joints is not quite this
# pendulum, and a swing in the other direction exchanges energy with it. With them the intervals
# hold the truth in 95 % of simulated cranes that swing in both directions: python -m
# tests.commissioning.identification.coverage.
MODEL_PERIOD: Final = 0.002
MODEL_RATIO: Final = 0.02
MODEL_RATIO_ABS: Final = 0.001
# No tool swings farther: the unit of the signal is wrong.
LARGEST_RAD: Final = math.radians(100.0)
# Most frequencies at which the noise is computed; more do not improve it.
MOST_FREQUENCIES: Final = 80


class DecayProblem:
    """Least squares of several segments over common parameters.

    The parameters are the frequency w (rad/s), the decay s (1/s) and on request dry friction, which
    takes the same amount off the amplitude in every second. Friction, and the approximate
    amplitudes at the start of each segment, are in the unit of the data.
    """

    def __init__(self, segments: Sequence[Segment], amplitudes: Sequence[float]) -> None:
        self.segments = segments
        self.amplitudes = list(amplitudes)
        self.weights = [1.0] * len(segments)

    def basis(self, i: int, x: Array, at: Array | None = None) -> tuple[Array, Array]:
        """Return the columns of the linear parameters of a segment, and its envelope from 1 on.

        ``at`` gives times from the start of the segment; by default they are its own.
        """
        time = self.segments[i].time_s if at is None else at
        omega, sigma = float(x[0]), float(x[1])
        envelope = np.exp(-sigma * time)
        if len(x) > 2:
            lost = -np.expm1(-sigma * time) / sigma if sigma else time
            envelope = np.maximum(envelope - float(x[2]) / self.amplitudes[i] * lost, 0.0)
        stretched = time
        angle = self.segments[i].kind.angle(self.amplitudes[i], math.hypot(omega, sigma))
        if angle < LARGEST_RAD:
            if len(x) > 2:
                slower = cumulative_trapezoid(envelope**2, time, initial=0.0)
            else:
                slower = -np.expm1(-2.0 * sigma * time) / (2.0 * sigma) if sigma else time
            stretched = time - angle**2 / 16.0 * slower
        return free_columns(time, omega * stretched, envelope), envelope

    def linear(self, i: int, x: Array) -> tuple[Array, Array, Array]:
        """Return columns, best linear parameters and residual of a segment."""
        basis, _ = self.basis(i, x)
        best, *_ = np.linalg.lstsq(basis, self.segments[i].value, rcond=None)
        return basis, np.asarray(best), self.segments[i].value - basis @ best

    def residual(self, x: Array) -> Array:
        """Return the weighted residuals of all segments."""
        parts = [self.linear(i, x)[2] * weight for i, weight in enumerate(self.weights)]
        return np.concatenate(parts)

    def solve(self, x: Sequence[float], *, roughly: bool = False) -> Array:
        """Fit parameters from a start, and set amplitudes and weights; ``roughly``: to 1e-4."""
        omega = float(x[0])
        low = np.array([0.6 * omega, -0.2 * omega, -np.inf])[: len(x)]
        high = np.array([1.6 * omega, omega, np.inf])[: len(x)]
        now = np.clip(np.asarray(x, dtype=np.float64), low, high)
        scale = np.array([0.01 * now[0], 0.01 * now[0], 0.01 * max(self.amplitudes)])[: len(x)]
        ftol, most = (1e-4, 30) if roughly else (1e-8, 100)
        for _ in range(1 if roughly else 3):  # amplitudes and weights follow, and converge quickly
            now = least_squares(
                self.residual, now, x_scale=scale, bounds=(low, high), ftol=ftol, max_nfev=most
            ).x
            for i, segment in enumerate(self.segments):
                _, best, residual = self.linear(i, now)
                size = math.hypot(best[0], best[1])
                self.amplitudes[i] = max(size, 1e-12)
                if len(self.segments) > 1:
                    noise = math.sqrt(density(segment.time_s, residual, float(now[0]))[0])
                    self.weights[i] = 1.0 / max(noise, 1e-4 * size, 1e-12)
        return now


def free_columns(time: Array, phase: Array, envelope: Array) -> Array:
    """Return the columns of a free swing's linear parameters: cosine, sine, offset, drift."""
    columns = [envelope * np.cos(phase), envelope * np.sin(phase), np.ones_like(time), time]
    return np.stack(columns, axis=1)


def covariance_of(
    residual: Callable[[Array], Array],
    x: Array,
    steps: Array,
    data: Sequence[Segment],
    omega: float,
) -> tuple[Array, float]:
    """Return the covariance of the parameters of a fit, and its degrees of freedom.

    Only noise near the frequency of the swing matters. Its density comes from the spectrum of the
    residual there, so that noise which is not white gives right intervals too.

    Args:
        residual: of all data, one after the other, by the parameters.
        x, steps: the best parameters, and a small change of each for the derivative.
        data: in the order of the residual.
        omega: frequency of the swing, rad/s.
    """
    changes = zip(np.diag(steps), steps, strict=True)
    slope = np.stack(
        [(residual(x + to) - residual(x - to)) / (2.0 * step) for to, step in changes], axis=1
    )
    left, meat, freedom, first = residual(x), np.zeros((len(x),) * 2), 0.0, 0
    for one in data:
        part = slice(first, first + len(one.time_s))
        power, count = density(one.time_s, left[part], omega)
        meat += power * slope[part].T @ slope[part]
        first, freedom = part.stop, freedom + count
    inverse = np.linalg.pinv(slope.T @ slope)
    return inverse @ meat @ inverse, max(freedom, 3.0)


def density(time: Array, residual: Array, omega: float) -> tuple[float, float]:
    """Return the power of the residual around a frequency, rad/s, and its degrees of freedom.

    The power of white noise is its variance.
    """
    length = float(time[-1] - time[0])
    resolution = 2.0 * math.pi / length
    near = np.arange(0.5 * omega, 1.8 * omega, 0.5 * resolution)
    near = near[np.abs(near - omega) > 0.75 * resolution]
    if len(near) < 4:
        near = np.arange(omega + 0.75 * resolution, 3.0 * omega + 3.0 * resolution, resolution / 2)
    if len(near) > MOST_FREQUENCIES:
        near = near[:: len(near) // MOST_FREQUENCIES + 1]
    spectrum = np.abs(np.exp(-1j * np.outer(near, time)) @ residual) ** 2 / len(time)
    # The fitted parameters have taken their part out of the residual.
    lost = len(time) / max(len(time) - 6, 1)
    return float(np.mean(spectrum)) * lost, len(near)


@dataclass(frozen=True, slots=True)
class SegmentFit:
    """One segment of a fit."""

    segment: Segment
    fitted: Array  # the model at its times, offset and drift included
    base: Array  # offset and drift alone
    envelope: Array  # amplitude of the swing at its times, in the unit of the data
    noise: float  # standard deviation of what is left
    period_s: float  # of this segment alone

    @property
    def angle_rad(self) -> float:
        """Amplitude at its start, 0 where it is not known."""
        return self.segment.kind.angle(float(self.envelope[0]), 2.0 * math.pi / self.period_s)


Damping = tuple[float, float]  # an amplitude in the unit of the data, and the damping ratio there


@dataclass(frozen=True, slots=True)
class DecayFit:
    """Period of small damped swings, as a stopwatch shows it, and damping ratio."""

    period_s: Value
    damping_ratio: Value
    segments: list[SegmentFit]
    swings: float  # full swings that were seen
    # At the largest and the smallest amplitude, where the damping surely differs; else None.
    friction: tuple[Damping, Damping] | None


def fit_decay(segments: Sequence[Segment], period_s: float, damping_ratio: float) -> DecayFit:
    """Fit one period and one damping to free swings, each of a swing and a half or more.

    The search starts at these values; the period has to be right to some 10 %.
    """
    omega = 2.0 * math.pi / period_s
    amplitudes = [float(np.ptp(s.value[: max(8, len(s.value) // 4)])) / 2.0 for s in segments]
    problem = DecayProblem(segments, amplitudes)
    x = problem.solve([omega, damping_ratio * omega])
    covariance, freedom = _covariance(problem, x)
    common, sure = swing_values(*map(float, x)), deviations(x, covariance)
    alone = []  # period and damping ratio of each segment by itself, and their deviations
    for segment, amplitude in zip(segments, problem.amplitudes, strict=True):
        one = DecayProblem([segment], [amplitude])
        best = one.solve(list(x)) if len(segments) > 1 else x
        alone.append((swing_values(*map(float, best)), deviations(best, _covariance(one, best)[0])))
    factor = float(student.ppf(0.5 + CONFIDENCE / 2.0, freedom))
    model = MODEL_PERIOD * common[0], math.hypot(MODEL_RATIO * common[1], MODEL_RATIO_ABS)
    values = []
    for k in (0, 1):
        between = _between([(a[k], d[k]) for a, d in alone], common[k])
        values.append(Value(common[k], math.hypot(factor * max(sure[k], between), model[k])))
    fits = []
    for i, segment in enumerate(segments):
        basis, best, residual = problem.linear(i, x)
        envelope = problem.basis(i, x)[1] * math.hypot(best[0], best[1])
        base, noise = basis[:, 2:] @ best[2:], float(np.std(residual))
        fits.append(SegmentFit(segment, basis @ best, base, envelope, noise, alone[i][0][0]))
    swings = sum(float(s.time_s[-1]) for s in segments) / common[0]
    return DecayFit(values[0], values[1], fits, swings, _friction(problem, x))


def _covariance(problem: DecayProblem, x: Array) -> tuple[Array, float]:
    steps = np.full(len(x), 1e-5 * x[0])
    return covariance_of(problem.residual, x, steps, problem.segments, float(x[0]))


def swing_values(omega: float, sigma: float) -> tuple[float, float]:
    """Return period (s) and damping ratio of frequency (rad/s) and decay (1/s)."""
    return 2.0 * math.pi / omega, sigma / math.hypot(omega, sigma)


def deviations(x: Array, covariance: Array) -> tuple[float, float]:
    """Return the standard deviations of period (s) and damping ratio.

    ``x`` begins with frequency (rad/s) and decay (1/s); ``covariance`` is that of ``x``.
    """
    omega, sigma = float(x[0]), float(x[1])
    cube = math.hypot(omega, sigma) ** 3
    slopes = np.array([[-2.0 * math.pi / omega**2, 0.0], [-sigma * omega / cube, omega**2 / cube]])
    both = slopes @ covariance[:2, :2] @ slopes.T
    return math.sqrt(max(both[0, 0], 0.0)), math.sqrt(max(both[1, 1], 0.0))


def _between(alone: Sequence[tuple[float, float]], common: float) -> float:
    """Return the deviation of the mean of (value, deviation) by how values differ; 0 for one."""
    weights = [1.0 / max(deviation, 1e-9) ** 2 for _, deviation in alone]
    terms = [(w * (value - common)) ** 2 for w, (value, _) in zip(weights, alone, strict=True)]
    count = len(alone)
    return math.sqrt(sum(terms) * count / (count - 1)) / sum(weights) if count > 1 else 0.0


def _friction(problem: DecayProblem, x: Array) -> tuple[Damping, Damping] | None:
    """Return the damping at largest and smallest amplitude where it surely differs, else None."""
    if len({s.kind for s in problem.segments}) > 1:
        return None
    ends = [float(problem.basis(i, x)[1][-1]) * a for i, a in enumerate(problem.amplitudes)]
    large = max(problem.amplitudes)
    small = max(min(ends), 0.05 * large)
    if small > 0.7 * large:
        return None
    y = problem.solve([*x, 0.0])
    covariance, freedom = _covariance(problem, y)
    omega, sigma, loss = (float(v) for v in y)
    sure = abs(loss) > float(student.ppf(0.999, freedom)) * math.sqrt(max(covariance[2, 2], 0.0))
    at_large, at_small = ((sigma + loss / a) / omega for a in (large, small))
    if not sure or abs(at_small - at_large) < 0.4 * abs(float(x[1])) / omega:
        return None
    return (large, at_large), (small, at_small)
