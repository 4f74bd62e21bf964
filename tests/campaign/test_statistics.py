"""Bounds hold as often as they say, whatever the distribution; factors are found in any shape."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from canshaper.campaign.statistics import Influence, influences, most_of, quantile
from canshaper.campaign.summary import lines, summarise, tables
from canshaper.config.desk import MEASURES

DISTRIBUTIONS = {
    "normal": stats.norm(),
    "heavy": stats.pareto(1.5),
    "bounded": stats.beta(0.4, 0.6),
}


@pytest.mark.parametrize("name", DISTRIBUTIONS)
@pytest.mark.parametrize(("share", "count"), [(0.5, 60), (0.9, 200), (0.99, 1000)])
def test_bounds_of_a_quantile_hold_in_95_of_100_cases(name: str, share: float, count: int) -> None:
    distribution = DISTRIBUTIONS[name]
    source = np.random.default_rng(3)
    true, runs, held = distribution.ppf(share), 600, 0
    for _ in range(runs):
        one = quantile(distribution.rvs(count, random_state=source).tolist(), share)
        low = -math.inf if one.low is None else one.low
        high = math.inf if one.high is None else one.high
        held += low <= true <= high
    # At least 95 %, but for the chance of so many runs.
    assert held >= stats.binom.ppf(0.001, runs, 0.95)


def test_a_bound_that_the_drives_do_not_show_is_none() -> None:
    # The largest of 298 is below the .99 quantile with more than 2.5 %; of 368 with less.
    assert quantile([*range(298)], 0.99).high is None
    assert quantile([*range(368)], 0.99).high == 367
    assert 0.99**298 > 0.025 > 0.99**368


def test_a_quantile_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a value, got none"):
        quantile([], 0.5)


def test_drives_without_an_event_prove_nearly_three_over_their_number() -> None:
    assert most_of(0, 10_000) == pytest.approx(1.0 - 0.05 ** (1.0 / 10_000), rel=1e-12)
    assert most_of(0, 10_000) == pytest.approx(3.0 / 10_000, rel=0.002)


@pytest.mark.parametrize(("events", "count"), [(0, 1), (1, 20), (7, 300), (20, 20)])
def test_the_bound_of_a_share_is_that_of_clopper_and_pearson(events: int, count: int) -> None:
    test = stats.binomtest(events, count, alternative="less")
    assert most_of(events, count) == pytest.approx(test.proportion_ci(0.95, "exact").high)


@pytest.mark.parametrize(
    ("shape", "trend"),
    [(lambda x: x**3, 1.0), (lambda x: -np.exp(x), -1.0), (np.abs, 0.0)],
)
def test_what_explains_a_measure_comes_first_in_any_shape(
    shape: Callable[[np.ndarray], np.ndarray], trend: float
) -> None:
    source = np.random.default_rng(1)
    cause, chance = source.uniform(-1.0, 1.0, (2, 2000))
    words = source.choice(["taps", "both"], 2000).tolist()
    factors = influences(
        {"chance": chance.tolist(), "words": words, "cause": cause.tolist()},
        shape(cause).tolist(),
    )
    assert factors[0].name == "cause"
    assert factors[0].explained > 0.95
    assert factors[0].trend == pytest.approx(trend, abs=0.08)
    assert all(one.explained < 0.02 for one in factors[1:])


def test_a_word_explains_and_has_no_trend() -> None:
    words = ["taps", "both"] * 100
    factors = influences(
        {"operator": words}, [float(word == "taps") + 0.001 * k for k, word in enumerate(words)]
    )
    assert (factors[0].explained > 0.7, factors[0].trend) == (True, None)


def test_a_measure_that_is_alike_in_all_drives_has_no_cause() -> None:
    factor = [float(k) for k in range(200)]
    assert influences({"a": factor}, [0.0] * 200) == [Influence("a", 0.0, None)]


def test_drives_without_the_measure_are_left_out() -> None:
    factor = [float(k) for k in range(200)]
    assert influences({"a": factor}, [None] * 190 + [1.0] * 10) == []
    half = [k if k % 2 else None for k in factor]
    assert influences({"a": factor}, half)[0].trend == pytest.approx(1.0)


def test_drives_that_leave_more_than_with_anti_sway_off_are_counted_and_named() -> None:
    left = [0.5, 2.0, 1.35, 9.0, None, 1.0]
    raw = [5.0, 1.0, 1.04, 3.0, 1.0, None]
    count = len(left)
    columns = {
        "seed": [*range(count)],
        "fault": [""] * count,
        "broken": [0] * count,
        "why": [""] * count,
        "engine": ["python", "both", *["native"] * (count - 2)],
        "operator": ["both"] * count,
        "swung_over": [False] * count,
        "raw_deg": raw,
        **dict.fromkeys(MEASURES, left),
        "run_on_s": [None] * count,
    }
    worse = summarise(columns, {}).worse
    assert (worse.drives, worse.worse) == (4, 3)
    assert [seed for seed, _, _ in worse.seeds] == [3, 1, 2]
    exact = stats.binomtest(3, 4)
    assert worse.high == pytest.approx(exact.proportion_ci(0.95, "exact").high)
    assert worse.low == pytest.approx(exact.proportion_ci(0.95, "exact").low)
    assert "Drives by engine: 1 both, 4 native, 1 python; the gate sees all but native" in [
        *lines(summarise(columns, {}))
    ]
    assert summarise(columns, {}).promises.drives == 2
    *_, worst = tables(summarise(columns, {}))
    assert {*worst.columns[-1].cells} == {"-"}  # no measure is no good one
    (head, first, *_) = [line for line in lines(summarise(columns, {})) if "off" in line]
    assert head.startswith("Worse than with anti-sway off, by more than 0.3 deg: 3 of 4 drives")
    assert first == "  drive 3: 9.00 deg, with anti-sway off 3.00"
