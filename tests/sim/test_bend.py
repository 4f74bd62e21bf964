"""A boom that bends, against the oscillator that it is."""

import math
from itertools import pairwise

import pytest
from scipy.integrate import solve_ivp

from canshaper_sim.bend import Bend, BendParameters
from canshaper_sim.crane import LIFT, NEAR_FAR, SLEW, Crane, CraneParameters
from canshaper_sim.grapple import TipMotion

TICK_S = 0.02
SOFT = BendParameters(frequency_hz=2.5)


def constant(acceleration: float) -> tuple[TipMotion, TipMotion, TipMotion]:
    tip = TipMotion(3.0, 0.0, acceleration, 0.0, acceleration, acceleration)
    return tip, tip, tip


@pytest.mark.parametrize("coordinate", ["slew", "radius", "height"])
def test_it_is_a_damped_oscillator_in_each_coordinate(coordinate: str) -> None:
    bend, omega = Bend(SOFT), 2.0 * math.pi * 2.5

    def ode(_t: float, y: list[float]) -> list[float]:
        return [y[1], -1.5 - 2.0 * 0.05 * omega * y[1] - omega**2 * y[0]]

    times = [0.01 * k for k in range(1, 101)]
    expected = solve_ivp(ode, (0.0, 1.0), [0.0, 0.0], t_eval=times, rtol=1e-10, atol=1e-12).y
    for u, rate in zip(*expected, strict=True):
        bend.advance(0.01, constant(1.5))
        assert getattr(bend, coordinate) == pytest.approx((u, rate), abs=2e-5)


def test_what_the_tip_does_is_one_motion() -> None:
    """Its acceleration is the rate of its speed, and that of its place."""
    bend = Bend(SOFT)
    ends = []
    for step in range(200):
        push = math.sin(0.05 * step)
        start, middle, end = bend.advance(0.01, constant(push))
        for a, b in ((start, middle), (middle, end)):
            mean = 0.5 * (a.radius_acceleration_m_s2 + b.radius_acceleration_m_s2)
            change = b.radius_rate_m_s - a.radius_rate_m_s
            assert change == pytest.approx(0.005 * (mean - push), abs=2e-4)
        ends.append(end)
    assert any(abs(end.radius_rate_m_s) > 0.01 for end in ends)


def test_a_stop_leaves_the_tip_swinging_at_its_frequency_until_it_rests() -> None:
    stiff, soft = Crane(), Crane(CraneParameters(boom=SOFT))
    ahead = []
    for tick in range(600):
        commands = {NEAR_FAR: 0.8 if tick < 100 else 0.0, SLEW: 0.0, LIFT: 0.0}
        stiff.step(TICK_S, commands)
        soft.step(TICK_S, commands)
        ahead.append(soft.state.radius_m - stiff.state.radius_m)
    rest = ahead[140:400]
    turns = [i for i, (a, b) in enumerate(pairwise(rest)) if a <= 0.0 < b]
    period_s = TICK_S * (turns[-1] - turns[0]) / (len(turns) - 1)
    assert period_s == pytest.approx(0.4, rel=0.02)
    assert max(map(abs, rest)) > 1e-3
    assert abs(ahead[-1]) < 1e-4
    assert soft.state.theta1_rad == stiff.state.theta1_rad == 0.0


def test_a_boom_that_is_stiffer_bends_less() -> None:
    def most(frequency_hz: float) -> float:
        crane = Crane(CraneParameters(boom=BendParameters(frequency_hz=frequency_hz)))
        far = 0.0
        for _ in range(100):
            crane.step(TICK_S, {SLEW: 1.0})
            far = max(far, abs(crane._bend.slew[0]) if crane._bend else 0.0)
        return far

    assert most(2.0) > 1.5 * most(3.0) > 0.0
    assert most(0.0) == 0.0
