"""Claims of studies/README.md on Eq. 7 - 11, A3 and A4 as printed, against the derived equations.

Eq. 12 is in test_linear.py.

The expressions are analytic in every argument, so agreement at two hundred random states to 1e-8
is an identity, and one clear difference refutes one.
"""

import math

import casadi as ca
import numpy as np
import pytest

from studies.crane.config import GrappleData
from studies.crane.dynamics import SwayDynamics, TipMotion
from studies.crane.kinematics import Array
from studies.crane.linear import OperatingPoint, closed_form, linearise
from studies.crane.statespace import STATES, SwayStateSpace
from studies.crane.tests.motion import SwayStates
from studies.crane.tests.printed import (
    PRINTED_TURN,
    equation_9,
    equation_a3,
    equations_7_8,
    tip_acceleration,
)

STANDING = TipMotion((0.0, 3.0, 4.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def moments(g: GrappleData, states: SwayStates, **reading: object) -> Array:
    """Left over of Eq. 7 and 8 at the derived accelerations, N m, one row for every state."""
    dynamics = SwayDynamics(g)
    return np.array(
        [
            equations_7_8(g, (sway, rate, dynamics.accelerations(sway, rate, tip)), tip, **reading)
            for sway, rate, tip in states.rows
        ]
    )


def test_equation_8_is_right_as_printed(grapple: GrappleData, states: SwayStates) -> None:
    assert moments(grapple, states)[:, 1] == pytest.approx(0.0, abs=1e-9)


def test_equation_7_is_right_with_two_corrections(grapple: GrappleData, states: SwayStates) -> None:
    assert moments(grapple, states, lever="l3", power=1)[:, 0] == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("reading", [{}, {"lever": "l3"}, {"power": 1}])
def test_equation_7_needs_both_corrections(
    grapple: GrappleData, states: SwayStates, reading: dict[str, object]
) -> None:
    """Printed, or with one of the two: off by more than a tenth of the weight's moment."""
    left = moments(grapple, states, **reading)[:, 0]
    assert np.abs(left).max() > 0.1 * 9.81 * grapple.m2_kg * grapple.l2_m


def test_equations_7_and_8_count_theta1_from_another_axis_than_equation_3(
    grapple: GrappleData,
) -> None:
    """Read with the theta1 of Eq. 3, slewing drives theta6 and reaching out drives theta5."""
    at_rest = (np.zeros(2), np.zeros(2), np.zeros(2))
    slewing = STANDING._replace(acceleration=(1.0, 0.0, 0.0))
    reaching = STANDING._replace(acceleration=(0.0, 1.0, 0.0))
    for turn, driven_by_slewing in ((PRINTED_TURN, 0), (0.0, 1)):
        for tip, driven in ((slewing, driven_by_slewing), (reaching, 1 - driven_by_slewing)):
            left = equations_7_8(grapple, at_rest, tip, turn=turn)
            assert abs(left[driven]) > 100.0
            assert left[1 - driven] == pytest.approx(0.0, abs=1e-9)


def test_frequency_of_printed_equation_7(grapple: GrappleData) -> None:
    """With l2 for l3 the swing across the boom is 7 % too slow."""

    def omega(lever: str) -> float:
        def moment(theta5: float, acceleration: float) -> float:
            sway = (np.array([theta5, 0.0]), np.zeros(2), np.array([acceleration, 0.0]))
            return equations_7_8(grapple, sway, STANDING, lever=lever).joint5

        return math.sqrt(moment(1e-6, 0.0) / 1e-6 / moment(0.0, 1.0))

    assert omega("l3") == pytest.approx(2.668564171, rel=1e-9)
    assert omega("l2") == pytest.approx(2.474, abs=5e-4)


@pytest.mark.slow
def test_printed_equation_7_makes_energy(undamped: GrappleData) -> None:
    """Undamped, tip at rest, from 34 and 40 deg; the same steps keep it when corrected."""
    dynamics = SwayDynamics(undamped)
    lowest = dynamics.total_energy_j((0, 0), (0, 0), (0, 3, 4), (0, 0, 0))

    def slope(state: Array, reading: dict[str, object]) -> Array:
        sway, rate = state[:2], state[2:]
        rest = equations_7_8(undamped, (sway, rate, np.zeros(2)), STANDING, **reading)
        unit = equations_7_8(undamped, (sway, rate, np.ones(2)), STANDING, **reading)
        return np.array([*rate, *(-r / (u - r) for r, u in zip(rest, unit, strict=True))])

    def most_energy(reading: dict[str, object]) -> float:
        """In 20 s, as a multiple of that at the start; ends when the grapple swings over."""
        state, h = np.array([math.radians(34.0), math.radians(40.0), 0.0, 0.0]), 0.01
        energies = []
        while len(energies) < 2000 and np.abs(state[:2]).max() < math.pi / 2.0:
            energy = dynamics.total_energy_j(state[:2], state[2:], (0, 3, 4), (0, 0, 0))
            energies.append(energy - lowest)
            k1 = slope(state, reading)
            k2 = slope(state + 0.5 * h * k1, reading)
            k3 = slope(state + 0.5 * h * k2, reading)
            k4 = slope(state + h * k3, reading)
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return max(energies) / energies[0]

    assert most_energy({"lever": "l3", "power": 1}) == pytest.approx(1.0, abs=1e-5)
    assert most_energy({"lever": "l3"}) > 5.0
    assert most_energy({}) > 5.0
    # The other misprint is a wrong weight, which makes another frequency and hardly any energy.
    assert 1.001 < most_energy({"power": 1}) < 1.1


def test_acceleration_of_the_tip(states: SwayStates) -> None:
    """Second derivative of Eq. 3 by CasADi against the dotted and signed form of Eq. 9."""
    p, p_d, p_dd = (ca.SX.sym(name, 3) for name in ("p", "p_d", "p_dd"))
    place = ca.vertcat(p[1] * ca.cos(p[0]), p[1] * ca.sin(p[0]), p[2])
    speed = ca.jtimes(place, p, p_d)
    second = ca.Function(
        "second", [p, p_d, p_dd], [ca.jtimes(speed, p, p_d) + ca.jtimes(speed, p_d, p_dd)]
    )
    for _, _, tip in states.rows:
        assert tip_acceleration(tip) == pytest.approx(second(*tip).full().ravel(), abs=1e-12)


def test_signs_of_equation_9_belong_to_no_position(states: SwayStates) -> None:
    """Not to (+-x cos, +-x sin) nor to (+-x sin, +-x cos) of the heading, with either frame."""
    for turn in (0.0, math.pi / 2.0):
        worst = []
        for shift in (0.0, math.pi / 2.0, math.pi, -math.pi / 2.0):
            for mirror in (1.0, -1.0):
                differences = []
                for _, _, tip in states.rows:
                    theta1, x, z = tip.position
                    moved = tip._replace(position=(theta1 + shift, x, z))
                    true = tip_acceleration(moved)[:2] * [1.0, mirror]
                    differences.append(np.abs(true - equation_9(tip, theta1 + turn)).max())
                worst.append(max(differences))
        assert min(worst) > 1.0


def test_printed_equation_9_makes_the_drive_depend_on_the_heading(
    states: SwayStates, grapple: GrappleData
) -> None:
    """In Eq. 7 and 8 it puts a_r sin 2h - a_t cos 2h for a_t, and a_r cos 2h + a_t sin 2h for -a_r.

    h is the heading as Eq. 7 and 8 count it. So the slew drive of theta5 has the wrong sign at
    h = 0, the right one at 90 deg, and none at 45 deg.
    """
    for _, _, tip in states.rows:
        h = tip.position[0] + PRINTED_TURN
        x, (slew, x_d, _), (slew_d, x_dd, _) = tip.position[1], tip.velocity, tip.acceleration
        a_r, a_t = x_dd - x * slew**2, x * slew_d + 2.0 * x_d * slew
        right, printed = tip_acceleration(tip)[:2], equation_9(tip, h)
        across, along = (math.cos(h), math.sin(h)), (-math.sin(h), math.cos(h))
        assert np.dot(across, right) == pytest.approx(a_t, abs=1e-9)
        assert np.dot(along, right) == pytest.approx(-a_r, abs=1e-9)
        assert np.dot(across, printed) == pytest.approx(
            a_r * math.sin(2 * h) - a_t * math.cos(2 * h), abs=1e-9
        )
        assert np.dot(along, printed) == pytest.approx(
            a_r * math.cos(2 * h) + a_t * math.sin(2 * h), abs=1e-9
        )


def test_kinetic_energy_a3(grapple: GrappleData, states: SwayStates) -> None:
    """Right with theta6' to the first power and -l2 s5 s6 cos(theta1) theta6' in the y row."""
    without_link = SwayDynamics(grapple.model_copy(update={"m1_kg": 0.0}))
    readings = ({}, {"power": 1}, {"sign": -1.0}, {"power": 1, "sign": -1.0})
    worst = []
    for reading in readings:
        differences = []
        for sway, rate, tip in states.rows:
            kinetic = float(without_link.energy(sway, rate, tip.position, tip.velocity)[0])
            differences.append(abs(kinetic - equation_a3(grapple, sway, rate, tip, **reading)))
        worst.append(max(differences))
    assert worst[3] < 1e-9
    assert min(worst[:3]) > 50.0  # J


def test_potential_energy_a4_is_right_as_printed(grapple: GrappleData, states: SwayStates) -> None:
    """m g (z_tip - l3 cos theta5), of the one mass that A3 has."""
    without_link = SwayDynamics(grapple.model_copy(update={"m1_kg": 0.0}))
    for sway, _, tip in states.rows:
        l3 = grapple.l1_m + grapple.l2_m * math.cos(sway[1])
        printed = grapple.m2_kg * 9.81 * (tip.position[2] - l3 * math.cos(sway[0]))
        potential = float(without_link.energy(sway, np.zeros(2), tip.position, np.zeros(3))[1])
        assert potential == pytest.approx(printed, abs=1e-8)


def test_equation_10_is_linearised_at_the_wrong_place(grapple: GrappleData) -> None:
    """Its point has eight entries for seven states, with the radius of 3 m at place 7, the height.

    Read so the radius is 0, and slewing does not swing the grapple across the boom.
    """
    printed, right = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0]
    assert (len(printed), len(right)) == (8, len(STATES))
    gain = SwayStateSpace(grapple).input_gain
    heading, radius, height = (STATES.index(name) for name in ("theta1", "x", "z"))
    for point, drive in ((printed, 0.0), (right, -2.178)):
        tip = [point[heading], point[radius], point[height]]
        across = float(gain([point[0], point[2]], tip)[0, 0])
        assert across == pytest.approx(drive, abs=1e-3)


def test_equation_11_is_simplified_for_a_reason_that_holds_for_every_entry(
    grapple: GrappleData,
) -> None:
    """DC gains of 0 make none negligible: G11 and G22 do too. At rest four are 0 at any s."""
    at_rest = closed_form(grapple, OperatingPoint(3.0))
    assert [g(0.0) for row in at_rest for g in row] == [0.0] * 6
    zero = [(i, j) for i in range(2) for j in range(3) if at_rest[i][j](2.0j) == 0.0]
    assert zero == [(0, 1), (0, 2), (1, 0), (1, 2)]
    turning = linearise(grapple, OperatingPoint(3.0, 0.5)).at(2.0j)
    assert np.abs(turning).min() > 0.0
    assert abs(turning[1, 0]) > 0.5 * abs(turning[0, 0])


def test_poles_of_section_4() -> None:
    """The printed poles belong to more digits of a1 and a2 than are printed."""
    printed = np.array([-5.6307, -4.1253])
    assert np.roots([0.043052, 0.42001, 1.0]) == pytest.approx(printed, abs=5e-4)
    assert np.roots([0.043, 0.42, 1.0]) == pytest.approx([-5.655, -4.112], abs=5e-4)
    assert np.roots([0.12, 0.708, 1.0]) == pytest.approx([-3.5576, -2.3424], abs=5e-5)
