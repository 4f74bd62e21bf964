"""Statistics of many drives, with confidence bounds that assume no distribution."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from canshaper.config.desk import MEASURES, QUANTILES

Columns = Mapping[str, Sequence[Any]]
"""A value of each drive, by the name of its column."""
CONFIDENCE = 0.95
# The range of a factor is divided into so many parts, each with the same number of drives.
_PARTS = 10


@dataclass(frozen=True)
class Quantile:
    """A quantile of a measure, with the confidence bounds of its true value.

    Attributes:
        value: quantile of the drives.
        low: lower bound; None where the drives are too few for one.
        high: upper bound; None where the drives are too few for one.
    """

    value: float
    low: float | None
    high: float | None

    def __str__(self) -> str:
        """Return the value with its bounds; "?" for a missing one."""
        low, high = ("?" if bound is None else f"{bound:.3g}" for bound in (self.low, self.high))
        return f"{self.value:.3g} ({low}..{high})"


def quantile(values: Sequence[float], share: float, confidence: float = CONFIDENCE) -> Quantile:
    """Return a quantile with its bounds by order statistics.

    The number of drives below the true quantile has a binomial distribution.

    Args:
        values: one value for each drive, in any order.
        share: the quantile, such as 0.99.
        confidence: least probability that the true quantile lies between the bounds.

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


def named_quantiles(values: Sequence[float]) -> dict[str, Quantile]:
    """Return the quantiles of a measure that a campaign states, by name."""
    return {name: quantile(values, share) for name, share in QUANTILES.items()}


def most_of(events: int, count: int, confidence: float = CONFIDENCE) -> float:
    """Return the largest share of all drives that may have an event (Clopper-Pearson, one-sided).

    Without an event it is 1 - (1 - confidence)^(1 / count): nearly 3 / count for 0.95.

    Args:
        events: number of drives with the event.
        count: number of drives.
        confidence: probability that the true share is not larger.
    """
    if events >= count:
        return 1.0
    return float(stats.beta.ppf(confidence, events + 1, count - events))


@dataclass(frozen=True)
class Influence:
    """Influence of one factor on a measure.

    Attributes:
        name: name of the factor.
        explained: part of the variance of the measure's ranks that the factor alone explains, by a
            relation of any shape; corrected for chance.
        trend: Spearman's rank correlation; its sign is the direction. None for a factor of words.
    """

    name: str
    explained: float
    trend: float | None


def influences(
    factors: Mapping[str, Sequence[Any]], measure: Sequence[float | None]
) -> list[Influence]:
    """Return the factors, ordered by how much of a measure they explain.

    A factor with one value only is left out; with fewer than 20 measured drives all are.

    Args:
        factors: by the name of the factor a number or a word for each drive.
        measure: the measure of each drive; a drive with None is left out.
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


@dataclass(frozen=True)
class Difference:
    """One measure of two files, over the same drives.

    Attributes:
        first: quantiles of the first file.
        second: quantiles of the second file.
        better: of the drives that differ, the share in which the second file has less.
        median: median of the second less the first, drive by drive.
    """

    first: Mapping[str, Quantile]
    second: Mapping[str, Quantile]
    better: float
    median: Quantile


def differences(first: Columns, second: Columns) -> dict[str, Difference]:
    """Compare two files by measure, over the drives without a fault in which both have it."""
    rows = [
        {seed: k for k, seed in enumerate(one["seed"]) if not one["fault"][k]}
        for one in (first, second)
    ]
    both = sorted(rows[0].keys() & rows[1].keys())
    by_measure = {}
    for measure in MEASURES:
        pairs = [(first[measure][rows[0][s]], second[measure][rows[1][s]]) for s in both]
        pairs = [(a, b) for a, b in pairs if a is not None and b is not None]
        if not pairs:
            continue
        ones, others = zip(*pairs, strict=True)
        differ = [b - a for a, b in pairs]
        unequal = [one for one in differ if one]
        better = sum(one < 0.0 for one in unequal) / len(unequal) if unequal else 0.0
        by_measure[measure] = Difference(
            named_quantiles(ones), named_quantiles(others), better, quantile(differ, 0.5)
        )
    return by_measure
