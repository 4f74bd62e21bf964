"""Wind on the load: where it hangs, how it gusts, and that a seed repeats it."""

import math
import statistics

import pytest

from canshaper.errors import DesignError
from canshaper_sim.crane import Crane
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.wind import Wind, WindParameters
from tests.sim.drives import TICK_S


def hanging(*changes: str, seconds: float = 5.0) -> list[tuple[float, float]]:
    crane, angles = Crane(changed_parameters(["grapple.m1_kg=0", *changes])), []
    for _ in range(round(seconds / TICK_S)):
        crane.step(TICK_S, {})
        angles.append((crane.state.theta5_rad, crane.state.theta6_rad))
    return angles


@pytest.mark.parametrize(("heading_deg", "out", "across"), [(0, 1, 0), (90, 0, 1), (180, -1, 0)])
def test_a_steady_wind_holds_the_load_where_drag_and_weight_balance(
    heading_deg: float, out: int, across: int
) -> None:
    angles = hanging("wind.speed_m_s=12", "wind.drag_m2=2", f"wind.heading_deg={heading_deg}")
    lean = math.atan(0.5 * 1.225 * 2.0 * 12.0**2 / (300.0 * 9.81))
    for theta5, theta6 in angles:
        assert theta5 == pytest.approx(lean * across, abs=1e-9)
        assert theta6 == pytest.approx(-lean * out, abs=1e-9)


def test_a_boom_that_points_elsewhere_feels_it_from_elsewhere() -> None:
    wind = ("wind.speed_m_s=12", "wind.heading_deg=90", f"start_theta1_rad={math.pi / 2}")
    (theta5, theta6), level = hanging(*wind)[-1], hanging(*wind, "carrier.pitch_deg=1")
    assert theta6 < -0.005  # outwards
    assert theta5 == pytest.approx(0.0, abs=1e-12)
    assert level[-1][0] == pytest.approx(-math.radians(1.0), rel=1e-3)  # wind and slope add up
    assert level[-1][1] == pytest.approx(theta6, rel=1e-3)


def test_gusts_have_their_size_and_their_time() -> None:
    wind = Wind(WindParameters(speed_m_s=6.0, gust_m_s=1.2, gust_s=2.0))
    speeds = []
    for _ in range(40_000):
        wind.advance(0.1)
        speeds.append(math.sqrt(wind.force_n / (0.5 * 1.225 * 0.6)))
    assert statistics.mean(speeds) == pytest.approx(6.0, abs=0.1)
    assert statistics.stdev(speeds) == pytest.approx(1.2, rel=0.06)
    late = statistics.correlation(speeds[:-20], speeds[20:])  # one time constant later
    assert late == pytest.approx(math.exp(-1.0), abs=0.05)


def test_a_seed_repeats_the_wind_and_another_one_does_not() -> None:
    gusty = ("wind.speed_m_s=8", "wind.gust_m_s=2")
    first = hanging(*gusty)
    assert hanging(*gusty) == first
    assert hanging(*gusty, "wind.seed=2") != first
    assert max(abs(one[0] - first[0][0]) for one in first) > 1e-4


def test_a_storm_is_refused() -> None:
    with pytest.raises(DesignError, match=r"wind: speed_m_s: expected 0.0 .. 20.0, got 30.0"):
        changed_parameters(["wind.speed_m_s=30"])
