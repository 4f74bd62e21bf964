"""Figures of many drives, and how sure they are: no distribution is assumed of anything."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

CONFIDENCE = 0.95
# A factor is cut into so many parts, with as many drives each, to see what it explains.
_PARTS = 10


@dataclass(frozen=True)
class Quantile:
    """A quantile of a measure, with the bounds that hold for its true value.

    Attributes:
        value: of the drives that were made.
        low: the true one is not below; None where there are too few drives to say.
        high: nor above; the same.
    """

    value: float
    low: float | None
    high: float | None


def quantile(values: Sequence[float], share: float, confidence: float = CONFIDENCE) -> Quantile:
    """Quantile by order statistics: the number of drives below the true one is binomial.

    Args:
        values: one a drive, in any order.
        share: which quantile, such as 0.99.
        confidence: that the true one lies between the bounds, at least.

    Raises:
        ValueError: there are no values.
    """
    ordered = sorted(values)
    count = len(ordered)
    if not count:
        raise ValueError("expected a value, got none")
    tail = 0.5 * (1.0 - confidence)
    lower = int(stats.binom.ppf(tail, count, share))
    upper = int(stats.binom.ppf(1.0 - tail, count, share)) + 1
    return Quantile(
        ordered[max(math.ceil(count * share), 1) - 1],
        ordered[lower - 1] if lower >= 1 else None,
        ordered[upper - 1] if upper <= count else None,
    )


def most_of(events: int, count: int, confidence: float = CONFIDENCE) -> float:
    """Largest share of all drives that may have an event (one-sided, Clopper and Pearson).

    Without any event it is 1 - (1 - confidence)^(1 / count), for .95 nearly 3 / count.

    Args:
        events: drives that had it.
        count: drives that were made.
        confidence: that the true share is not larger.
    """
    if events >= count:
        return 1.0
    return float(stats.beta.ppf(confidence, events + 1, count - events))


@dataclass(frozen=True)
class Influence:
    """Influence of one factor on a measure.

    Attributes:
        name: the factor.
        explained: part of the variance of the measure's ranks that it explains by itself, whatever
            the shape; corrected for chance.
        trend: Spearman's rank correlation, whose sign says the direction; None of a word.
    """

    name: str
    explained: float
    trend: float | None


def influences(
    factors: Mapping[str, Sequence[Any]], measure: Sequence[float | None]
) -> list[Influence]:
    """Factors by what they explain of a measure, the largest first.

    Args:
        factors: of each factor a number or a word for every drive.
        measure: of every drive; those without one are left out.
    """
    keep = [k for k, value in enumerate(measure) if value is not None]
    if len(keep) < 2 * _PARTS:
        return []
    ranks = stats.rankdata([measure[k] for k in keep])
    rows = [_influence(name, [column[k] for k in keep], ranks) for name, column in factors.items()]
    return sorted((row for row in rows if row), key=lambda row: -row.explained)


def _influence(name: str, column: Sequence[Any], ranks: Any) -> Influence | None:
    if len({*column}) < 2:
        return None
    total = float(((ranks - ranks.mean()) ** 2).sum())
    if not total:  # every drive has the same measure
        return Influence(name, 0.0, None)
    trend: float | None = None
    if isinstance(column[0], str):
        _, part = np.unique(np.array(column), return_inverse=True)
    else:
        own = stats.rankdata(column)
        part = np.minimum((own - 1) * _PARTS / len(column), _PARTS - 1).astype(int)
        trend = float(np.corrcoef(own, ranks)[0, 1])
    sums = np.bincount(part, ranks)
    counts = np.bincount(part)
    used = counts > 0
    between = float((sums[used] ** 2 / counts[used]).sum()) - ranks.sum() ** 2 / len(ranks)
    free, parts = len(ranks) - 1, int(used.sum())
    within = (total - between) / (free + 1 - parts)
    return Influence(name, max(0.0, 1.0 - within * free / total), trend)
