import math

import numpy as np
import pytest

from canshaper.design.tuning.modes import modes_over_range
from canshaper.design.tuning.robust import LEAST_TAP, least_residual, shortest, time_optimal_s
from canshaper.shaping.sway import SwayMode
from tests.rigs.residual import residual_left

MODE = SwayMode.from_grapple(1.2, 120.0, 300.0)
VALVE = {"tick_s": 0.02, "rate_per_s": 5.0}


@pytest.mark.parametrize(
    "duration_s, range_pct, residual_pct", [(1.6, 15.0, 9.4), (1.8, 15.0, 6.9), (2.2, 30.0, 3.5)]
)
def test_designs_of_the_literature_values(
    duration_s: float, range_pct: float, residual_pct: float
) -> None:
    design = least_residual(
        MODE, duration_s=duration_s, range_pct=range_pct, least_tap=0.0, **VALVE
    )
    assert 100.0 * design.residual == pytest.approx(residual_pct, abs=0.4)
    assert min(design.taps) >= 0.0
    assert math.fsum(design.taps) == pytest.approx(1.0)
    assert max(design.taps) <= 5.0 * 0.02 * (1.0 + 1e-9)
    judged = max(
        residual_left(design.taps, m, 0.02) for m in modes_over_range(MODE, range_pct, 301)
    )
    assert judged == pytest.approx(design.residual, rel=0.01)


def test_a_least_tap_makes_one_movement_of_a_tap_for_a_little_more_residual() -> None:
    free, floor = (
        least_residual(MODE, duration_s=1.8, range_pct=15.0, least_tap=least, **VALVE)
        for least in (0.0, LEAST_TAP)
    )
    assert min(free.taps) == pytest.approx(0.0, abs=1e-9)
    assert min(floor.taps) == pytest.approx(LEAST_TAP / len(floor.taps))
    assert 0.0 < floor.residual - free.residual < 0.012


@pytest.mark.slow
def test_no_other_taps_of_that_kind_do_better() -> None:
    """The programme claims a limit: random feasible taps never pass it."""
    best = least_residual(MODE, duration_s=1.6, range_pct=15.0, **VALVE)
    source = np.random.default_rng(1)
    count = len(best.taps)
    modes = modes_over_range(MODE, 15.0)
    for _ in range(300):
        other = np.clip(np.array(best.taps) + source.normal(0.0, 0.01, count), 0.0, 0.1)
        other = np.minimum(other / other.sum(), 0.1)
        if abs(other.sum() - 1.0) < 1e-3:
            left = max(residual_left(list(other), m, 0.02) for m in modes)
            assert left >= best.residual * 0.99


@pytest.mark.slow
def test_shortest_is_as_short_as_can_be() -> None:
    design = shortest(MODE, residual_pct=5.0, range_pct=30.0, **VALVE)
    assert design.residual <= 0.05
    shorter = least_residual(MODE, duration_s=design.duration_s - 0.04, range_pct=30.0, **VALVE)
    assert shorter.residual > 0.05


@pytest.mark.parametrize(
    "rate, low, seconds", [(5.0, 0.0, 0.92), (50.0, 0.0, 0.74), (5.0, -1.0, 0.92), (2.5, 0.0, 1.12)]
)
def test_time_optimal_limit(rate: float, low: float, seconds: float) -> None:
    assert time_optimal_s(MODE, tick_s=0.02, rate_per_s=rate, low=low) == pytest.approx(
        seconds, abs=0.021
    )


@pytest.mark.slow
def test_what_cannot_be_is_refused_with_what_can() -> None:
    with pytest.raises(ValueError, match=r"duration: expected 0.2 s or more, got 0.1 s"):
        least_residual(MODE, duration_s=0.1, range_pct=15.0, **VALVE)
    with pytest.raises(ValueError, match=r"range of length: expected 0 to 60 %, got 80 %"):
        least_residual(MODE, duration_s=1.0, range_pct=80.0, **VALVE)
    with pytest.raises(ValueError, match=r"residual: expected .* % or more for .*, got 0 %"):
        shortest(MODE, residual_pct=0.0, range_pct=60.0, **VALVE)
