"""Kinematics of the boom: against the DH matrices of Eq. 1, finite differences, and its inverse."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper_sim.kinematics import Boom

BOOMS = [
    Boom(1.7, 0.0, 3.7, 0.0, 2.3),
    Boom(1.8, 0.15, 3.7, 0.2, 2.35),
    Boom(2.0, -0.3, 4.0, -0.1, 2),
]
joints = st.tuples(st.floats(-0.4, 1.4), st.floats(-2.6, 0.0), st.floats(0.0, 3.0))
rates = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.9, 0.9), st.floats(-1.2, 1.2))


def link(a: float, alpha: float, d: float, theta: float) -> np.ndarray:
    """Eq. 1 with a and alpha of the link before the joint."""
    c, s, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array(
        [
            [c, -s, 0, a],
            [s * ca, c * ca, -sa, -sa * d],
            [s * sa, c * sa, ca, ca * d],
            [0, 0, 0, 1],
        ]
    )


@pytest.mark.parametrize("boom", BOOMS)
@given(q=joints, slew=st.floats(-3.0, 3.0))
def test_tip_is_that_of_the_modified_dh_matrices(
    boom: Boom, q: tuple[float, float, float], slew: float
) -> None:
    lift, knuckle, extension = q
    right = math.pi / 2.0
    pose = (
        link(0.0, 0.0, boom.pillar_m, slew)
        @ link(boom.pillar_offset_m, right, 0.0, lift)
        @ link(boom.main_boom_m, 0.0, 0.0, knuckle - right)
        @ link(boom.knuckle_offset_m, -right, boom.outer_boom_m + extension, 0.0)
    )
    radius, height = boom.tip(*q)
    expected = (radius * math.cos(slew), radius * math.sin(slew), height)
    assert tuple(pose[:3, 3]) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("boom", BOOMS)
@given(q=joints)
def test_jacobian_is_the_derivative_of_the_tip(boom: Boom, q: tuple[float, float, float]) -> None:
    jacobian = boom.jacobian(*q)
    h = 1e-6
    for i in range(3):
        up, down = list(q), list(q)
        up[i] += h
        down[i] -= h
        slope = [(a - b) / (2 * h) for a, b in zip(boom.tip(*up), boom.tip(*down), strict=True)]
        assert (jacobian[i], jacobian[i + 3]) == pytest.approx(slope, abs=1e-8)


@pytest.mark.parametrize("boom", BOOMS)
@given(q=joints, rate=rates)
def test_drift_is_the_acceleration_of_constant_rates(
    boom: Boom, q: tuple[float, float, float], rate: tuple[float, float, float]
) -> None:
    h = 1e-4
    back, here, on = (
        boom.tip(*(x + k * h * v for x, v in zip(q, rate, strict=True))) for k in (-1, 0, 1)
    )
    second = [(a - 2 * b + c) / h**2 for a, b, c in zip(back, here, on, strict=True)]
    assert boom.drift(q, rate) == pytest.approx(second, abs=2e-6)


@pytest.mark.parametrize("boom", BOOMS)
@given(q=st.tuples(st.floats(-0.3, 1.3), st.floats(-2.5, -0.1), st.floats(0.0, 3.0)))
def test_angles_put_the_tip_where_it_is_asked(boom: Boom, q: tuple[float, float, float]) -> None:
    lift, knuckle = boom.angles(*boom.tip(*q), q[2])
    assert (lift, knuckle) == pytest.approx(q[:2], abs=1e-6)


def test_a_tip_out_of_reach_is_reported() -> None:
    with pytest.raises(ValueError, match=r"radius 9.1 m, height 1.7 m .* out of reach"):
        BOOMS[0].angles(9.1, 1.7, 3.0)
    with pytest.raises(ValueError, match="out of reach"):
        BOOMS[0].angles(0.5, 1.7, 0.0)


def test_a_straight_arm_reaches_all_its_lengths() -> None:
    assert BOOMS[0].tip(0.0, 0.0, 3.0) == pytest.approx((9.0, 1.7), abs=1e-12)
    assert BOOMS[0].tip(0.0, -math.pi / 2.0, 0.0) == pytest.approx((3.7, -0.6), abs=1e-12)
