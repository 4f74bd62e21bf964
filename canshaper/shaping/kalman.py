"""Gains of a Kalman filter that corrects a few states by one number measured."""

from collections.abc import Sequence
from operator import mul

# The gains are within a thousandth of the steady ones then, some 10 ms later.
MOST_STEPS = 5000


def kalman_gains(
    step: Sequence[Sequence[float]],
    shown: Sequence[float],
    noise: Sequence[float],
    first: Sequence[float],
) -> tuple[tuple[float, ...], ...]:
    """Gains for one measurement after the other; the last ones are those of the steady state.

    Args:
        step: what the states become until the next measurement, a row for each.
        shown: how much of each the measurement shows, whose noise has a variance of 1.
        noise: variance that each gets until the next one.
        first: variance of each before the first one.
    """
    states = range(len(shown))
    covariance = [[first[k] if k == other else 0.0 for other in states] for k in states]
    gains = [(0.0,) * len(shown)]
    for _ in range(MOST_STEPS):
        half = [[sum(map(mul, row, column)) for column in covariance] for row in step]
        covariance = [[sum(map(mul, row, other)) for other in step] for row in half]
        for k in states:
            covariance[k][k] += noise[k]
        seen = [sum(map(mul, row, shown)) for row in covariance]
        spread = sum(map(mul, seen, shown)) + 1.0
        gains.append(tuple(one / spread for one in seen))
        covariance = [
            [old - gain * other for old, other in zip(row, seen, strict=True)]
            for row, gain in zip(covariance, gains[-1], strict=True)
        ]
        if max(abs(new - old) for new, old in zip(gains[-1], gains[-2], strict=True)) < 1e-9:
            break
    return tuple(gains[1:])
