"""The tower crane against the grapple's equations, and a rope that a hoist moves."""

import math
from dataclasses import replace

import pytest

from canshaper.errors import DesignError
from canshaper_sim.axes import BRIDGE, HOIST, NEAR_FAR, SLEW
from canshaper_sim.crane import Crane, CraneParameters, RopeCrane
from canshaper_sim.grapple import Grapple, Sway
from canshaper_sim.luffing import LuffingParameters
from canshaper_sim.overhead import OverheadParameters, drive
from canshaper_sim.tower import RopedBoom, TowerParameters

TOWER = "tower"


def crane(sway: Sway | None = None, **parameters: float) -> RopeCrane:
    own = TowerParameters(**{"damping_ratio": 0.0, **parameters})  # type: ignore[arg-type]
    return RopeCrane(CraneParameters(tower=own), sway, TOWER)


def test_the_load_swings_as_a_grapple_that_has_no_link() -> None:
    """Two derivations: a point on a rope in a frame at rest, the angles of the paper's Eq. 7-9."""
    sway = Sway(0.05, -0.08)
    own = CraneParameters(
        grapple=Grapple(l1_m=0.0, l2_m=8.0, m1_kg=0.0, c5_n_m_s_rad=0.0, c6_n_m_s_rad=0.0),
        slew=drive(),
        near_far=drive(),
        slew_full_speed_rad_s=0.2,
        radius_max_m=30.0,
        start_radius_m=15.0,
    )
    other = Crane(own, sway)
    one = crane(sway, rope_m=8.0, slew_full_speed_rad_s=0.2, start_radius_m=15.0)
    for k in range(1500):
        commands = {SLEW: 1.0 if k < 600 else -0.5, NEAR_FAR: 1.0 if 200 < k < 800 else 0.0}
        for each in (one, other):
            each.step(0.01, commands)
        assert one.state == pytest.approx(other.state._replace(height_m=70.0), abs=2e-5)
    assert abs(one.state.theta5_rad) + abs(one.state.theta6_rad) > 0.1


def test_the_rates_are_those_of_the_angles() -> None:
    one, step_s = crane(Sway(0.1, 0.1), rope_m=10.0), 0.001
    for _ in range(40):
        one.step(0.1, {SLEW: 1.0, NEAR_FAR: -1.0, HOIST: 0.5})
    before = one.state
    one.step(step_s, {})
    after = one.state
    for angle, rate in ((7, 9), (8, 10)):
        mean = 0.5 * (before[rate] + after[rate])
        assert (after[angle] - before[angle]) / step_s == pytest.approx(mean, abs=1e-5)


def test_its_rope_is_that_of_a_bridge_crane() -> None:
    """A trolley in the direction of slew zero, while the load is hoisted."""
    one = crane(Sway(theta5_rad=0.2), rope_m=20.0)
    overhead = OverheadParameters(
        damping_ratio=0.0, rope_m=20.0, hoist_full_speed_m_s=1.0, rope_max_m=40.0
    )
    other = RopeCrane(CraneParameters(overhead=overhead), Sway(theta6_rad=0.2))
    for _ in range(500):
        one.step(0.01, {HOIST: 1.0, NEAR_FAR: 1.0})
        other.step(0.01, {HOIST: 1.0, BRIDGE: 1.0})
    state, same = one.state, other.state
    assert state.theta5_rad == pytest.approx(same.theta6_rad, abs=1e-9)
    outwards = math.tan(same.theta5_rad) * math.cos(state.theta5_rad)
    assert math.tan(-state.theta6_rad) == pytest.approx(outwards, abs=1e-9)
    assert one.boom.axes[HOIST].position == pytest.approx(-15.1, abs=0.1)


def test_where_it_begins_is_within_its_ways() -> None:
    with pytest.raises(ValueError, match=r"tower: start_radius_m: expected 3.0 .. 65.0, got 70"):
        TowerParameters(start_radius_m=70.0)
    full = replace(CraneParameters(), tower=TowerParameters()).full_speeds(TOWER)
    assert full == {SLEW: 0.07, NEAR_FAR: 1.0, HOIST: 1.0}
    assert math.isclose(crane().state.radius_m, 35.0)


def test_the_tip_of_a_telehandler_goes_as_its_boom() -> None:
    one = RopeCrane(kind="luffing")
    for _ in range(300):
        one.step(0.01, {"lift_cylinder": 0.5, "extension": 1.0, "hoist": -1.0})
    luff = one.boom.axes["lift_cylinder"].position
    long_m = 10.0 + one.boom.axes["extension"].position
    state = one.state
    assert math.degrees(luff) == pytest.approx(45.0 + 0.5 * 2.8648 * 2.9, abs=0.4)
    assert state.radius_m == pytest.approx(long_m * math.cos(luff), abs=0.02)
    assert state.height_m == pytest.approx(2.5 + long_m * math.sin(luff), abs=0.02)
    assert one.boom.axes[HOIST].position == pytest.approx(-8.0 - 0.8 * 2.85, abs=0.15)


def test_a_telehandler_starts_between_the_stops_of_its_boom() -> None:
    for start_deg in (-20.0, 80.0):
        own = LuffingParameters(start_luff_deg=start_deg)
        boom = RopeCrane(CraneParameters(luffing=own), kind="luffing").boom
        luff = boom.axes["lift_cylinder"].position
        assert math.degrees(luff) == pytest.approx(start_deg, abs=1e-6)
    with pytest.raises(DesignError, match=r"luffing: start_luff_deg: expected -20.0 .. 80.0, got"):
        LuffingParameters(start_luff_deg=82.0)


def test_a_tip_that_rises_faster_swings_faster() -> None:
    """l theta'' + (g + z'') sin theta = 0: rising with half of gravity, in 0.82 of the time."""
    periods = []
    for lift in (0.0, 0.5 * 9.81):
        boom = crane(Sway(theta5_rad=0.02), rope_m=10.0).boom
        assert isinstance(boom, RopedBoom)
        steps = 0
        while boom.angles[0] > 0.0:
            boom._hang(0.01, (0.0, 0.0, lift), (0.0, 0.0, lift), (0.0, 0.0, lift))
            steps += 1
        periods.append(0.04 * steps)
    assert periods[0] == pytest.approx(2.0 * math.pi * math.sqrt(10.0 / 9.81), abs=0.05)
    assert periods[1] == pytest.approx(periods[0] / math.sqrt(1.5), abs=0.05)
