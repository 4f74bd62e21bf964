"""Period and damping of free swings, several at once, with an honest interval."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import t as student

from canshaper.commissioning.identification.decay_problem import DecayProblem, Segment
from canshaper.commissioning.identification.series import Array

CONFIDENCE: Final = 0.95
# What the noise does not show: a tool on two joints is not quite the pendulum of the model, and a
# swing in the other direction takes from it and gives back. So the intervals hold the truth in 95 %
# of simulated cranes that swing in both directions: python -m
# tests.commissioning.identification.coverage.
MODEL_PERIOD: Final = 0.002
MODEL_RATIO: Final = 0.02
MODEL_RATIO_ABS: Final = 0.001


@dataclass(frozen=True, slots=True)
class Value:
    """A number with its confidence interval: ``value`` +- ``half``."""

    value: float
    half: float

    @property
    def relative(self) -> float:
        """Half width as a part of the value."""
        return self.half / abs(self.value) if self.value else math.inf


@dataclass(frozen=True, slots=True)
class SegmentFit:
    """One segment of a fit.

    Attributes:
        segment: its data.
        fitted: the model at its times, offset and drift included.
        base: offset and drift alone.
        envelope: amplitude of the swing at its times, in the unit of the data.
        noise: standard deviation of what is left.
        explained: part of the swing's variance that the model explains.
        period_s: period of this segment alone.
        damping_ratio: damping ratio of this segment alone.
    """

    segment: Segment
    fitted: Array
    base: Array
    envelope: Array
    noise: float
    explained: float
    period_s: Value
    damping_ratio: Value


@dataclass(frozen=True, slots=True)
class DecayFit:
    """Period and damping of a swing.

    Attributes:
        period_s: period of small damped swings, as a stopwatch shows it.
        damping_ratio: damping ratio over the amplitudes that were seen.
        segments: the segments.
        swings: full swings that were seen.
        friction: damping ratios at the largest and the smallest amplitude seen, with these
            amplitudes in the unit of the data, where the damping surely changes with it.
    """

    period_s: Value
    damping_ratio: Value
    segments: list[SegmentFit]
    swings: float
    friction: tuple[tuple[float, float], tuple[float, float]] | None


def fit_decay(segments: Sequence[Segment], period_s: float, damping_ratio: float) -> DecayFit:
    """Fit one period and one damping to free swings.

    Args:
        segments: at least one, each at least a swing and a half long.
        period_s: start of the search, within some 10 %.
        damping_ratio: start of the search.
    """
    omega = 2.0 * math.pi / period_s
    start = [omega, damping_ratio * omega]
    amplitudes = [float(np.ptp(s.value[: max(8, len(s.value) // 4)])) / 2.0 for s in segments]
    problem = DecayProblem(segments, amplitudes)
    x = problem.solve(start)
    covariance, freedom = problem.covariance(x)
    alone = []
    for segment, amplitude in zip(segments, problem.amplitudes, strict=True):
        one = DecayProblem([segment], [amplitude])
        best = one.solve(list(x)) if len(segments) > 1 else x
        alone.append((swing_values(best), deviations(best, one.covariance(best)[0])))
    period, ratio = swing_values(x)
    sure = deviations(x, covariance)
    factor = float(student.ppf(0.5 + CONFIDENCE / 2.0, freedom))
    model = MODEL_PERIOD * period, math.hypot(MODEL_RATIO * ratio, MODEL_RATIO_ABS)
    noise = [
        factor * max(deviation, _between([(a[k], d[k]) for a, d in alone], common))
        for k, (deviation, common) in enumerate(zip(sure, (period, ratio), strict=True))
    ]
    halves = [math.hypot(*both) for both in zip(noise, model, strict=True)]
    fits = [
        _segment_fit(problem, i, x, [Value(v, factor * d) for v, d in zip(*alone[i], strict=True)])
        for i in range(len(segments))
    ]
    swings = sum(float(s.time_s[-1]) for s in segments) / period
    friction = _friction(problem, x)
    return DecayFit(Value(period, halves[0]), Value(ratio, halves[1]), fits, swings, friction)


def swing_values(x: Array) -> tuple[float, float]:
    """Period and damping ratio."""
    omega, sigma = float(x[0]), float(x[1])
    return 2.0 * math.pi / omega, sigma / math.hypot(omega, sigma)


def deviations(x: Array, covariance: Array) -> tuple[float, float]:
    """Standard deviations of period and damping ratio."""
    omega, sigma = float(x[0]), float(x[1])
    cube = math.hypot(omega, sigma) ** 3
    slopes = np.array([[-2.0 * math.pi / omega**2, 0.0], [-sigma * omega / cube, omega**2 / cube]])
    both = slopes @ covariance[:2, :2] @ slopes.T
    return math.sqrt(max(both[0, 0], 0.0)), math.sqrt(max(both[1, 1], 0.0))


def _between(alone: Sequence[tuple[float, float]], common: float) -> float:
    """Standard deviation of the weighted mean by how the segments differ; 0 for one segment."""
    weights = [1.0 / max(deviation, 1e-9) ** 2 for _, deviation in alone]
    terms = [(w * (value - common)) ** 2 for w, (value, _) in zip(weights, alone, strict=True)]
    count = len(alone)
    return math.sqrt(sum(terms) * count / (count - 1)) / sum(weights) if count > 1 else 0.0


def _segment_fit(problem: DecayProblem, i: int, x: Array, own: list[Value]) -> SegmentFit:
    basis, best, residual = problem.linear(i, x)
    base = basis[:, 2:] @ best[2:]
    swing = problem.segments[i].value - base
    noise = float(np.std(residual))
    return SegmentFit(
        problem.segments[i],
        basis @ best,
        base,
        problem.basis(i, x)[1] * math.hypot(best[0], best[1]),
        noise,
        1.0 - noise**2 / max(float(np.var(swing)), 1e-30),
        own[0],
        own[1],
    )


def _friction(
    problem: DecayProblem, x: Array
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """(amplitude, damping ratio) at both ends, where the damping surely depends on amplitude."""
    if len({s.kind for s in problem.segments}) > 1:
        return None
    ends = [float(problem.basis(i, x)[1][-1]) * a for i, a in enumerate(problem.amplitudes)]
    large = max(problem.amplitudes)
    small = max(min(ends), 0.05 * large)
    if small > 0.7 * large:
        return None
    y = problem.solve([*x, 0.0])
    covariance, freedom = problem.covariance(y)
    omega, sigma, loss = (float(v) for v in y)
    sure = abs(loss) > float(student.ppf(0.999, freedom)) * math.sqrt(max(covariance[2, 2], 0.0))
    at_large, at_small = ((sigma + loss / a) / omega for a in (large, small))
    if not sure or abs(at_small - at_large) < 0.4 * abs(float(x[1])) / omega:
        return None
    return (large, at_large), (small, at_small)
