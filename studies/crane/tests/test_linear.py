"""Eq. 11-12: the linear model, its closed forms, modes and what the print says of them."""

import math
from itertools import product
from typing import Any

import numpy as np
import pytest

from canshaper.shaping.sway import SwayMode
from studies.crane.config import GrappleData
from studies.crane.dynamics import SwayDynamics
from studies.crane.kinematics import Kinematics
from studies.crane.linear import (
    OperatingPoint,
    closed_form,
    hanging_angle,
    linearise,
    sway_modes,
)
from studies.crane.tests.motion import swing

PLACES = list(product(range(2), range(3)))
POINTS = [OperatingPoint(x, w) for x in (2.0, 3.0, 8.5) for w in (0.0, 0.3, -0.5, 0.8)]


def other_grapple() -> GrappleData:
    return GrappleData(
        l1_m=0.35, l2_m=2.0, m1_kg=120.0, m2_kg=900.0, c5_n_m_s_rad=300.0, c6_n_m_s_rad=80.0
    )


def test_numbers_of_the_reference(grapple: GrappleData, reference: dict[str, Any]) -> None:
    linear = reference["linear"]
    g = linearise(grapple, OperatingPoint(reference["parameters"]["x0"])).transfer_functions()
    formulas = closed_form(grapple, OperatingPoint(3.0))
    for name, i in (("G11", 0), ("G22", 1)):
        expected = linear[name]
        formula = formulas[i][i]
        assert formula.num == pytest.approx([expected["num_s2"], 0.0, 0.0], rel=1e-9)
        assert formula.den == pytest.approx(expected["den"], rel=1e-9)
        s = 1.3 + 2.1j
        by_hand = expected["num_s2"] * s**2 / np.polyval(expected["den"], s)
        assert g[i][i](s) == pytest.approx(by_hand, rel=1e-9)
    for mode, name in zip(sway_modes(grapple), ("mode5", "mode6"), strict=True):
        expected = linear[name]
        assert (mode.omega_rad_s, mode.damping_ratio) == pytest.approx(
            (expected["w"], expected["zeta"]), rel=1e-9
        )
        # Numerator b2 s^2 + b1 s + 1 of Eq. 13 for this axis.
        assert mode.omega_rad_s**-2 == pytest.approx(expected["b2"], rel=1e-9)
        assert 2.0 * mode.damping_ratio / mode.omega_rad_s == pytest.approx(
            expected["b1"], rel=1e-9
        )


def test_matched_filter_of_the_reference_cancels_the_mode(
    grapple: GrappleData, reference: dict[str, Any]
) -> None:
    """The zeros of the reference's sampled Eq. 13 are the poles of this model, sampled."""
    expected = reference["filter_paper_nf_matched_50hz"]
    pole = np.exp(sway_modes(grapple).mode6.pole * 0.02)
    zeros = [1.0, -2.0 * pole.real, abs(pole) ** 2]
    poles = np.exp(np.roots([0.12, 0.708, 1.0]) * 0.02)
    den = np.poly(poles).real
    gain = den.sum() / np.sum(zeros)  # DC gain 1
    assert expected["a"] == pytest.approx(den, rel=1e-8)
    assert expected["b"] == pytest.approx(gain * np.array(zeros), rel=1e-8)


@pytest.mark.parametrize("point", POINTS)
def test_closed_form_is_the_numeric_transfer_function(
    grapple: GrappleData, point: OperatingPoint
) -> None:
    for data in (grapple, other_grapple()):
        linear = linearise(data, point)
        numeric = linear.transfer_functions()
        formula = closed_form(data, point, linear.theta6_rad)
        system = linear.state_space()
        for s in (0.2j, 1.7j, 2.6j, 9.0j, 0.5 - 1.0j, -2.0 + 0.3j):
            direct = linear.at(s)
            scipy = system.C @ np.linalg.solve(s * np.eye(5) - system.A, system.B) + system.D
            assert direct == pytest.approx(scipy, abs=1e-10)
            for i, j in PLACES:
                assert numeric[i][j](s) == pytest.approx(direct[i, j], rel=1e-8, abs=1e-10)
                assert formula[i][j](s) == pytest.approx(direct[i, j], rel=1e-8, abs=1e-10)


def test_at_rest_four_of_six_are_zero_and_no_dc_gain_is_left(grapple: GrappleData) -> None:
    """ "DC gain nearly 0, hence negligible" holds for G11 and G22 as well; it is no reason."""
    point = OperatingPoint(3.0)
    linear = linearise(grapple, point)
    zero = {(0, 1), (0, 2), (1, 0), (1, 2)}
    formula = closed_form(grapple, point)
    for i, j in PLACES:
        assert formula[i][j](0.0) == 0.0
        assert linear.transfer_functions()[i][j](0.0) == pytest.approx(0.0, abs=1e-12)
        size = abs(linear.at(2.7j)[i, j])
        assert (size < 1e-12) if (i, j) in zero else (size > 1.0)


@pytest.mark.slow
def test_while_slewing_the_joints_are_coupled(grapple: GrappleData) -> None:
    """Figures of studies/README.md at 3 m and 0.5 rad/s."""
    point = OperatingPoint(3.0, 0.5)
    linear = linearise(grapple, point)
    formula = closed_form(grapple, point, linear.theta6_rad)
    assert math.degrees(linear.theta6_rad) == pytest.approx(-4.509, abs=1e-3)
    modes = sway_modes(grapple, point)
    assert modes.mode5.omega_rad_s == pytest.approx(2.260, abs=1e-3)
    assert modes.mode6.omega_rad_s == pytest.approx(3.275, abs=1e-3)
    at = 1j * np.linspace(0.1, 8.0, 8000)
    peaks = np.array([[max(abs(g(s)) for s in at) for g in row] for row in formula])
    expected = [[18.2, 5.45, 0.37], [16.6, 5.07, 0.51]]
    assert peaks == pytest.approx(np.array(expected), rel=0.02)
    dc = np.array([[g(0.0) for g in row] for row in formula])
    assert dc[1, 1].real == pytest.approx(-0.0261, abs=1e-4)
    dc[1, 1] = 0.0
    assert np.abs(dc).max() == 0.0


def test_hanging_angle_is_the_balance_of_a_point_mass(dynamics: SwayDynamics) -> None:
    l2 = dynamics.grapple.l2_m
    for point in POINTS:
        theta6 = hanging_angle(dynamics, point)
        mass_radius = point.radius_m - l2 * math.sin(theta6)
        expected = -(point.slew_rate_rad_s**2) * mass_radius / 9.81
        assert math.tan(theta6) == pytest.approx(expected, abs=1e-12)


def test_printed_equation_12(grapple: GrappleData) -> None:
    """The 3 is the radius and belongs to G11; one of the two has a minus sign."""
    light = grapple.model_copy(update={"m1_kg": 0.0})
    g = closed_form(light, OperatingPoint(3.0))
    length, l2, m = light.l1_m + light.l2_m, light.l2_m, light.m2_kg
    # Denominators are right as printed, with c5 for c1 and c6 for c2.
    assert g[0][0].den == pytest.approx([1.0, light.c5_n_m_s_rad / (m * length**2), 9.81 / length])
    assert g[1][1].den == pytest.approx([1.0, light.c6_n_m_s_rad / (m * l2**2), 9.81 / l2])
    assert g[0][0].num[0] == pytest.approx(-3.0 / length)  # printed 1/(l1 + l2)
    assert g[1][1].num[0] == pytest.approx(1.0 / l2)  # printed 3/l2
    # Another radius changes G11 and leaves G22 alone.
    far = linearise(light, OperatingPoint(6.0))
    near = linearise(light, OperatingPoint(3.0))
    s = 2.0j
    assert far.at(s)[0, 0] == pytest.approx(2.0 * near.at(s)[0, 0], rel=1e-12)
    assert far.at(s)[1, 1] == pytest.approx(near.at(s)[1, 1], rel=1e-12)


@pytest.mark.parametrize("data", ["shipped", "other"])
def test_modes_are_the_eigenvalues(grapple: GrappleData, data: str) -> None:
    g = grapple if data == "shipped" else other_grapple()
    modes = sway_modes(g)
    poles = linearise(g, OperatingPoint(5.0)).poles()
    assert sorted(abs(p) for p in poles) == pytest.approx(sorted(m.omega_rad_s for m in modes))
    for mode in modes:
        assert min(abs(mode.pole - p) for p in poles) < 1e-9
    # Slow slewing goes over into standing.
    slow = sway_modes(g, OperatingPoint(5.0, 1e-4))
    for mode, rest in zip(slow, modes, strict=True):
        assert mode.omega_rad_s == pytest.approx(rest.omega_rad_s, abs=1e-5)


def test_mode6_is_that_of_the_filter(grapple: GrappleData) -> None:
    """`SwayMode.from_grapple` of the deployment file is the swing along the boom."""
    g = grapple
    expected = SwayMode.from_grapple(g.l2_m, g.c6_n_m_s_rad, g.m2_kg)
    mode = sway_modes(g).mode6
    assert mode.omega_rad_s == pytest.approx(expected.omega_rad_s)
    assert mode.damping_ratio == pytest.approx(expected.damping_ratio)


def test_one_numerator_for_both_axes_is_a_compromise(grapple: GrappleData) -> None:
    """Eq. 13 with l2 at the sway poles across the boom: 13 % of the swing instead of none."""
    modes = sway_modes(grapple)
    zeros, pole = modes.mode6, modes.mode5.pole
    left = abs(
        pole**2 / zeros.omega_rad_s**2 + 2 * zeros.damping_ratio * pole / zeros.omega_rad_s + 1
    )
    assert left == pytest.approx(0.13, abs=0.005)


def test_small_sway_follows_the_linear_model(dynamics: SwayDynamics) -> None:
    """Steady slewing at 0.4 rad/s, a little knock: nonlinear swing against exp(A t)."""
    from scipy.linalg import expm

    point = OperatingPoint(4.0, 0.4)
    linear = linearise(dynamics.grapple, point)
    step_s, count = 0.005, 800
    t = np.arange(2 * count + 1)[:, None] * step_s / 2.0
    place = np.hstack([0.4 * t, np.full_like(t, 4.0), np.full_like(t, 4.0)])
    speed = np.tile([0.4, 0.0, 0.0], (len(t), 1))
    start = np.array([1e-4, linear.theta6_rad + 2e-4])
    got = swing(dynamics.acceleration, step_s, (place, speed, 0.0 * speed), start)
    # W u depends on the angles: w starts with them.
    knock = np.array([1e-4, 0.0, 2e-4, 0.0, 0.0])
    knock[[1, 3]] = -linear.c[:, [0, 2]] @ knock[[0, 2]]
    at_end = expm(linear.a * step_s * count) @ knock
    assert got[-1, 0] == pytest.approx(at_end[0], abs=1e-8)
    assert got[-1, 1] - linear.theta6_rad == pytest.approx(at_end[2], abs=1e-8)


def test_an_overdamped_grapple_has_no_sway_mode(grapple: GrappleData) -> None:
    stiff = grapple.model_copy(update={"c5_n_m_s_rad": 1e5})
    with pytest.raises(ValueError, match="damping ratio"):
        sway_modes(stiff)
    with pytest.raises(ValueError, match="does not swing"):
        sway_modes(stiff, OperatingPoint(3.0, 0.2))


def test_operating_point_of_a_pose(kinematics: Kinematics) -> None:
    q = [0.4, 0.6, -1.0, 1.5]
    _, x, z = kinematics.cylindrical_tip(q)
    assert OperatingPoint.of_pose(kinematics, q, 0.2) == OperatingPoint(x, 0.2, z)
