"""Quantiles and bins, held against their definitions."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.commissioning.doctor.verdict import ENDS_US, histogram, quantile, summary

TIMES = st.lists(st.integers(0, ENDS_US[-1] * 1000), min_size=1, max_size=200)


@given(times=TIMES, share=st.sampled_from((0.5, 0.99, 0.999, 1.0)))
def test_a_quantile_is_the_smallest_value_with_that_share_at_or_below(
    times: list[int], share: float
) -> None:
    value = quantile(sorted(times), share)
    assert sum(t <= value for t in times) >= share * len(times)
    assert sum(t < value for t in times) < share * len(times)


def test_one_in_a_thousand_is_above_the_last_quantile() -> None:
    figures = summary([1_000_000, *[20_000] * 500, *[10_000] * 499])
    assert figures is not None
    assert (figures.count, figures.max) == (1000, 1000)
    assert (figures.p50, figures.p99, figures.p99_9) == (20, 20, 20)


def test_no_times_have_no_figures() -> None:
    assert summary([]) is None
    assert histogram([]) == {}


@given(times=TIMES)
def test_every_time_is_in_its_bin(times: list[int]) -> None:
    bins = histogram(times)
    assert sum(bins.values()) == len(times)
    ends = list(bins)
    first = ENDS_US.index(ends[0])
    assert ends == list(ENDS_US[first : first + len(ends)])
    assert bins[ends[0]] > 0
    assert bins[ends[-1]] > 0
    for end, count in bins.items():
        below = max((e for e in ENDS_US if e < end), default=-1)
        assert count == sum(below * 1000 < t <= end * 1000 for t in times)


@pytest.mark.parametrize(
    ("time_ns", "end"), [(0, 1), (1000, 1), (1001, 2), (20_000, 20), (10**12, 50_000_000)]
)
def test_the_upper_end_belongs_to_its_bin(time_ns: int, end: int) -> None:
    assert histogram([time_ns]) == {end: 1}
