"""The overhead crane against its equations in other coordinates."""

import math

import pytest

from canshaper.errors import DesignError
from canshaper_sim.axes import BRIDGE, HOIST, TROLLEY
from canshaper_sim.crane import CraneParameters, RopeCrane
from canshaper_sim.grapple import Sway
from canshaper_sim.overhead import OverheadBoom, OverheadParameters

G = 9.81


def crane(sway: Sway | None = None, **parameters: float) -> RopeCrane:
    own = OverheadParameters(**{"damping_ratio": 0.0, **parameters})  # type: ignore[arg-type]
    return RopeCrane(CraneParameters(overhead=own), sway)


def run(one: RopeCrane, seconds: float, **commands: float) -> list[float]:
    """Drive; the swing along the runway at each step, rad."""
    angles = []
    for _ in range(round(seconds / 0.01)):
        one.step(0.01, {BRIDGE: 0.0, TROLLEY: 0.0, HOIST: 0.0, **commands})
        angles.append(one.state.theta5_rad)
    return angles


@pytest.mark.parametrize("rope_m", [2.0, 10.0])
@pytest.mark.parametrize("plane", ["theta5_rad", "theta6_rad"])
def test_a_load_at_rest_swings_with_the_period_of_its_rope(rope_m: float, plane: str) -> None:
    one = crane(Sway(**{plane: 0.02}), rope_m=rope_m)
    period_s = 2.0 * math.pi * math.sqrt(rope_m / G)
    seconds = round(3.0 * period_s, 2)
    for _ in range(round(seconds / 0.01)):
        one.step(0.01, {})
    assert getattr(one.state, plane) == pytest.approx(0.02, rel=1e-3)


@pytest.mark.parametrize("level", [-1.0, 0.0, 1.0])
def test_hoisting_changes_the_swing_as_the_equation_of_the_angle_says(level: float) -> None:
    """l theta'' + 2 l' theta' + g sin theta = 0 in one plane, in tiny steps."""
    one = crane(Sway(theta5_rad=0.1), rope_m=6.0)
    boom = one.boom
    assert isinstance(boom, OverheadBoom)
    theta, rate, fine = 0.1, 0.0, 50
    for _ in range(400):
        before, speed = boom.rope_m, -boom.axes[HOIST].speed
        one.step(0.01, {HOIST: level})
        after, end = boom.rope_m, -boom.axes[HOIST].speed
        for k in range(fine):
            share, step_s = (k + 0.5) / fine, 0.01 / fine
            length = before + share * (after - before)
            change = speed + share * (end - speed)
            rate -= step_s * (2.0 * change * rate + G * math.sin(theta)) / length
            theta += step_s * rate
    assert one.state.theta5_rad == pytest.approx(theta, abs=5e-4)
    assert abs(boom.rope_m - 6.0) == pytest.approx(abs(level) * 0.5 * 4.0, abs=0.2)


def test_the_rope_stays_as_long_as_the_hoist_says() -> None:
    one = crane(rope_m=6.0)
    run(one, 2.0, bridge=1.0, trolley=-0.7, hoist=1.0)
    boom = one.boom
    assert isinstance(boom, OverheadBoom)
    assert math.dist(boom.load, (0.0, 0.0, 0.0)) == pytest.approx(boom.rope_m, rel=1e-12)
    along = sum(a * b for a, b in zip(boom.load, boom.rate, strict=True)) / boom.rope_m
    assert along == pytest.approx(-boom.axes[HOIST].speed, abs=1e-9)


def test_a_step_of_the_bridge_swings_the_load_back() -> None:
    one = crane(rope_m=8.0)
    angles = run(one, 3.0, bridge=1.0)
    assert min(angles) == pytest.approx(-1.0 / math.sqrt(G * 8.0), rel=0.05)
    assert one.state.theta6_rad == 0.0


def test_damping_takes_swing() -> None:
    one = crane(Sway(theta5_rad=0.05), rope_m=2.0, damping_ratio=0.05)
    angles = run(one, 2.84)
    assert max(angles[-20:]) == pytest.approx(0.05 * math.exp(-0.05 * 2.0 * math.pi), rel=0.02)


def test_state_is_the_trolley_in_polar_coordinates() -> None:
    one = crane()
    run(one, 4.0, bridge=1.0, trolley=1.0)
    state = one.state
    assert state.theta1_rad == pytest.approx(math.pi / 4.0)
    assert state.radius_m == pytest.approx(math.hypot(3.8, 3.8), rel=0.01)
    assert state.radius_rate_m_s == pytest.approx(math.sqrt(2.0), rel=1e-3)
    assert state.theta1_rate_rad_s == pytest.approx(0.0, abs=1e-9)


def test_parameters_that_are_no_crane_are_refused() -> None:
    with pytest.raises(DesignError, match=r"overhead: rope_m: expected 1.5 .. 30.0, got 31"):
        OverheadParameters(rope_m=31.0)
