"""Eq. 10: the state space with tip speeds as input, and Appendix B's coefficients."""

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest

from studies.crane.config import GrappleData
from studies.crane.dynamics import SwayDynamics, TipMotion
from studies.crane.kinematics import Array
from studies.crane.statespace import INPUTS, OUTPUTS, STATES, SwayStateSpace
from studies.crane.tests.motion import SwayStates, integrate, swing
from studies.crane.tests.printed import PRINTED_TURN, appendix_b


@pytest.fixture(scope="module")
def space(grapple: GrappleData) -> SwayStateSpace:
    return SwayStateSpace(grapple)


def test_the_names_fit_the_functions(space: SwayStateSpace) -> None:
    assert space.derivative.size1_in(0) == space.derivative.size1_out(0) == len(STATES)
    assert space.derivative.size1_in(1) == len(INPUTS)
    assert space.output.size1_out(0) == len(OUTPUTS)


def test_it_is_the_equations_of_motion_at_any_state(
    space: SwayStateSpace, dynamics: SwayDynamics, states: SwayStates
) -> None:
    """w' + d(W u)/dt = sway'', the right one by differences along the motion."""
    h = 1e-5
    for sway, rate, tip in states.rows:
        place, speed, change = (np.asarray(v) for v in tip)
        state = space.state_of(sway, rate, place, speed)
        assert space.rates_of(state, speed) == pytest.approx(rate, abs=1e-12)
        derivative = space.derivative_of(state, speed)
        assert derivative[[0, 2]] == pytest.approx(rate, abs=1e-12)
        assert derivative[4:] == pytest.approx(speed, abs=1e-12)
        sway_dd = dynamics.accelerations(sway, rate, tip)
        before, after = (
            space.state_of(
                sway + rate * t + 0.5 * sway_dd * t**2,
                rate + sway_dd * t,
                place + speed * t + 0.5 * change * t**2,
                speed + change * t,
            )
            for t in (-h, h)
        )
        assert derivative[[1, 3]] == pytest.approx(((after - before) / (2 * h))[[1, 3]], abs=1e-7)


def lagged(count: int, step_s: float, full: list[float]) -> Array:
    """Tip speeds under a command held from 0.5 s to 3.5 s, through a lag of 0.1 s; half steps."""
    t = np.arange(count) * step_s / 2.0
    rise = np.where(t > 0.5, -np.expm1(-(t - 0.5) / 0.1), 0.0)
    fall = np.where(t > 3.5, -np.expm1(-(t - 3.5) / 0.1), 0.0)
    return np.outer(rise - fall, full)


@pytest.mark.parametrize(
    ("run", "full"), [("slew_unshaped", [0.5, 0.0, 0.0]), ("nearfar_unshaped", [0.0, 1.0, 0.0])]
)
def test_trajectories_of_the_reference(
    space: SwayStateSpace, reference: dict[str, Any], run: str, full: list[float]
) -> None:
    rows = np.array(reference["trajectories"][run])
    step_s = 0.002
    u = lagged(2 * round(rows[-1, 0] / step_s) + 1, step_s, full)
    start = space.state_of((0, 0), (0, 0), (0, 3, 4), (0, 0, 0))
    states = integrate(space.derivative, step_s, u, start)
    at = np.round(rows[:, 0] / step_s).astype(int)
    got = states[at]
    assert np.abs(rows[:, 1:3]).max() > math.radians(15.0)
    assert got[:, [0, 2]] == pytest.approx(rows[:, 1:3], abs=2e-8)
    rates = np.array([space.rates_of(s, v) for s, v in zip(got, u[2 * at], strict=True)])
    assert rates == pytest.approx(rows[:, 3:5], abs=1e-7)


def test_smooth_tip_motion_gives_the_same_swing(
    space: SwayStateSpace, dynamics: SwayDynamics
) -> None:
    """All three inputs at once, large angles: state space against second-order equations."""
    step_s = 0.005
    t = np.arange(0.0, 20.0 + 1e-9, step_s / 2.0)[:, None]
    amplitude, w = np.array([0.8, 1.2, 0.8]), np.array([0.9, 1.3, 0.7])
    place = np.array([0.0, 5.0, 4.0]) + amplitude * (1.0 - np.cos(w * t))
    speed, change = amplitude * w * np.sin(w * t), amplitude * w**2 * np.cos(w * t)
    expected = swing(dynamics.acceleration, step_s, (place, speed, change), np.array([0.2, 0.1]))
    start = space.state_of((0.2, 0.1), (0.0, 0.0), place[0], speed[0])
    got = integrate(space.derivative, step_s, speed, start)
    assert np.abs(expected[:, :2]).max() > math.radians(30.0)
    assert got[:, [0, 2]] == pytest.approx(expected[:, :2], abs=1e-7)
    assert got[:, 4:] == pytest.approx(place[::2], abs=1e-8)


def test_a_jump_of_the_speed_is_allowed(
    space: SwayStateSpace, dynamics: SwayDynamics, states: SwayStates
) -> None:
    """Rates after a jump of u, state unchanged, are those after an acceleration of 1 us."""
    short_s = 1e-6
    for sway, rate, tip in states.rows[:20]:
        before = np.asarray(tip.velocity)
        jump = np.asarray(tip.acceleration) * 0.2
        state = space.state_of(sway, rate, tip.position, before)
        middle = TipMotion(tip.position, before + 0.5 * jump, jump / short_s)
        pulse = dynamics.accelerations(sway, rate, middle) * short_s
        assert space.rates_of(state, before + jump) == pytest.approx(rate + pulse, abs=1e-4)


def corrected_b(g: GrappleData, sway: Array, x: float) -> Array:
    """The rows of W as studies/README.md gives them."""
    l1, l2, m1, m2 = g.l1_m, g.l2_m, g.m1_kg, g.m2_kg
    s5, c5, s6, c6 = (
        *(f(sway[0]) for f in (math.sin, math.cos)),
        *(f(sway[1]) for f in (math.sin, math.cos)),
    )
    l3 = l1 + l2 * c6
    inertia, moment = m1 * l1**2 + m2 * l3**2, m1 * l1 + m2 * l3
    return np.array(
        [
            [-(moment * c5 * x - m2 * l2 * l3 * c5 * s6) / inertia, 0.0, -moment * s5 / inertia],
            [-s5 * (l1 * c6 + l2 - x * s6) / l2, c6 / l2, -c5 * s6 / l2],
        ]
    )


def test_appendix_b(space: SwayStateSpace, grapple: GrappleData, states: SwayStates) -> None:
    """The corrected coefficients are the derived ones; of the printed only b7 always is."""
    differences = []
    for sway, _, tip in states.rows:
        derived = np.asarray(space.input_gain(sway, tip.position).full())
        x = tip.position[1]
        assert derived == pytest.approx(corrected_b(grapple, sway, x), abs=1e-12)
        heading = tip.position[0] + PRINTED_TURN
        printed = appendix_b(grapple, sway, heading, x)
        differences.append(np.abs(printed - derived))
        # b6 is what the printed signs of Eq. 9 make of Eq. 8: it turns with the heading.
        t5, t6 = sway
        turned = math.cos(t6) * math.cos(2 * heading)
        turned -= math.sin(t5) * math.sin(t6) * math.sin(2 * heading)
        assert printed[1, 1] == pytest.approx(turned / grapple.l2_m, abs=1e-12)
    worst = np.max(differences, axis=0)
    assert worst[1, 2] < 1e-12
    assert (np.delete(worst.ravel(), 5) > 0.1).all()


def test_appendix_b_where_the_paper_linearises(space: SwayStateSpace, grapple: GrappleData) -> None:
    """At rest, heading 0, 3 m: the printed b5 slews theta6 by -3/l2, where nothing should."""
    at_rest = np.zeros(2)
    derived = np.asarray(space.input_gain(at_rest, (0.0, 3.0, 0.0)).full())
    printed = appendix_b(grapple, at_rest, 0.0, 3.0)
    assert derived[1, 0] == 0.0
    assert printed[1, 0] == pytest.approx(-3.0 / grapple.l2_m)
    assert printed[:, 1:] == pytest.approx(derived[:, 1:], abs=1e-12)


def test_the_input_gain_depends_on_positions_only(grapple: GrappleData) -> None:
    """Else the change of state would not take the derivative of the input out."""
    from studies.crane.dynamics import sway_equations

    e = sway_equations()
    gain = ca.jacobian(e.acceleration, e.tip_acceleration)
    for rate in (e.rate, e.tip_rate, e.tip_acceleration):
        assert not ca.depends_on(gain, rate)
