"""Times to figures: quantiles, and a histogram over a logarithmic scale."""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

NS_PER_US = 1000.0

# Upper ends of the bins, us: three in a decade, 1 us to 100 s.
ENDS_US = tuple(step * 10**power for power in range(8) for step in (1, 2, 5))


@dataclass(frozen=True)
class Summary:
    """Quantiles of times, us."""

    count: int
    p50: float
    p99: float
    p99_9: float
    max: float


def quantile(ordered: Sequence[int], share: float) -> int:
    """The smallest of the values (in order) that at least this share of all does not exceed."""
    return ordered[max(math.ceil(share * len(ordered)), 1) - 1]


def summary(times_ns: Sequence[int]) -> Summary | None:
    """Figures of times in ns; None where there are none."""
    if not times_ns:
        return None
    ordered = sorted(times_ns)
    shares = (0.5, 0.99, 0.999, 1.0)
    return Summary(len(ordered), *(quantile(ordered, share) / NS_PER_US for share in shares))


def histogram(times_ns: Sequence[int]) -> dict[int, int]:
    """Number of times in each bin, by its upper end in us (which belongs to it).

    Bins from the first to the last that is not empty.
    """
    counts = [0] * len(ENDS_US)
    for time_ns in times_ns:
        counts[min(bisect_left(ENDS_US, time_ns / NS_PER_US), len(ENDS_US) - 1)] += 1
    used = [i for i, count in enumerate(counts) if count]
    if not used:
        return {}
    return {ENDS_US[i]: counts[i] for i in range(used[0], used[-1] + 1)}
