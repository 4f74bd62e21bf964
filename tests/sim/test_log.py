"""A log that is gripped in mid-drive."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import eigh

from canshaper_sim.crane import Crane, CraneParameters
from canshaper_sim.grapple import Grapple, Sway
from canshaper_sim.log import LogParameters
from tests.rigs.double_pendulum import DAMPING_RATIO, G_M_S2, DoublePendulum

TICK_S = 0.02
LOG = LogParameters(grip_s=3.0, mass_kg=600.0, below_m=0.6)


def swings(log: LogParameters) -> list[float]:
    """theta6 each tick, of a swing of 5 degrees along the boom."""
    crane = Crane(CraneParameters(log=log), Sway(theta6_rad=math.radians(5.0)))
    angles = []
    for _ in range(1000):
        crane.step(TICK_S, {})
        angles.append(crane.state.theta6_rad)
    return angles


def period_s(angles: list[float]) -> float:
    ups = [i - b / (b - a) for i, (a, b) in enumerate(pairwise(angles), 1) if a <= 0.0 < b]
    return TICK_S * (ups[-1] - ups[0]) / (len(ups) - 1)


def test_it_makes_a_longer_pendulum_from_then_on() -> None:
    # Centres of 300 kg at 1.2 m and of 600 kg at 1.8 m: 900 kg at 1.6 m.
    free, gripped = swings(LogParameters()), swings(LOG)
    assert gripped[:149] == free[:149]
    for angles, length_m in ((free, 1.2), (gripped[200:], 1.6)):
        expected = 2.0 * math.pi * math.sqrt(length_m / 9.81)
        assert period_s(angles) == pytest.approx(expected, rel=0.005)


def test_the_angle_does_not_jump() -> None:
    steps = [abs(b - a) for a, b in pairwise(swings(LOG))]
    assert max(steps[140:160]) < 1.5 * max(steps[:140])


def test_of_no_mass_it_changes_nothing() -> None:
    none = LogParameters(grip_s=3.0, mass_kg=0.0)
    assert swings(none) == swings(LogParameters())
    loaded = LOG.loaded(Grapple())
    assert (loaded.m2_kg, loaded.l2_m) == pytest.approx((900.0, 1.6))


@pytest.mark.parametrize("second", [8.0, 11.0])
def test_a_long_log_swings_as_a_double_pendulum_does(second: float) -> None:
    """Near-far, small; the second mode has what the double pendulum's has of the lean."""
    first = 2.2
    judge = DoublePendulum(first, second)
    squares, shapes = eigh(judge.stiffness, judge.mass)
    quick = shapes[:, int(np.argmax(squares))]
    share = quick[1] * (quick @ judge.stiffness @ np.ones(2)) / (quick @ judge.stiffness @ quick)
    length_m = G_M_S2 / first**2
    grapple = Grapple(
        l1_m=0.0, l2_m=length_m, c6_n_m_s_rad=2.0 * DAMPING_RATIO * first * 300.0 * length_m**2
    )
    period_s = 2.0 * math.pi / (math.sqrt(squares.max()) * math.sqrt(1.0 - DAMPING_RATIO**2))
    log = LogParameters(
        grip_s=0.0,
        mass_kg=0.0,
        second_period_s=period_s,
        second_share=share,
        second_damping_ratio=DAMPING_RATIO,
    )
    crane = Crane(CraneParameters(grapple=grapple, log=log))
    errors, seen, second_seen, speed = [], [], [], 0.0
    for tick in range(300):
        crane.step(TICK_S, {"near_far": 0.2 if 10 < tick < 60 else 0.0})
        state = crane.state
        judge.step((state.radius_rate_m_s - speed) / TICK_S, TICK_S)
        speed = state.radius_rate_m_s
        errors.append(state.theta6_rad - judge.angle)
        seen.append(judge.angle)
        second_seen.append(crane._second.along[0] if crane._second else 0.0)
    assert max(map(abs, second_seen)) > 0.1 * max(map(abs, seen))
    assert max(map(abs, errors)) < 0.06 * max(map(abs, seen))


def test_a_long_log_is_gripped_without_a_jump() -> None:
    long = swings(LogParameters(grip_s=3.0, mass_kg=0.0, second_period_s=0.6))
    short = swings(LogParameters())
    assert long[:149] == short[:149]
    assert long[149] == pytest.approx(short[149], abs=1e-4)
    assert long[200] != pytest.approx(short[200], abs=1e-3)


def test_a_log_swings_across_the_boom_too() -> None:
    crane = Crane(CraneParameters(log=LogParameters(grip_s=0.0, second_period_s=0.6)))
    for _ in range(40):
        crane.step(TICK_S, {"slew": 0.5})
    second = crane._second
    assert second is not None
    assert abs(second.across[0]) > 0.5 * abs(second.along[0]) > 0.0
