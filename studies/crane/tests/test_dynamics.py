"""The derived equations of motion: against independent numbers, the simulator and physics."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid

from canshaper_sim import grapple as simulated
from studies.crane.config import GrappleData
from studies.crane.dynamics import SwayDynamics, TipMotion
from studies.crane.kinematics import Array, Kinematics
from studies.crane.tests.motion import SwayStates, swing


def test_samples_of_the_reference(dynamics: SwayDynamics, reference: dict[str, Any]) -> None:
    assert len(reference["eom_samples"]) == 20
    for s in reference["eom_samples"]:
        tip = TipMotion(
            (s["theta1"], s["x"], s["z"]),
            (s["theta1d"], s["xd"], s["zd"]),
            (s["theta1dd"], s["xdd"], s["zdd"]),
        )
        sway, rate = (s["theta5"], s["theta6"]), (s["theta5d"], s["theta6d"])
        # The samples are printed to ten digits.
        expected = (s["theta5dd"], s["theta6dd"])
        assert dynamics.accelerations(sway, rate, tip) == pytest.approx(expected, abs=1e-8)


def test_the_simulator_has_the_same_equations(states: SwayStates) -> None:
    """Two grapples; the simulator's equations are typed in, these are derived."""
    for data in (
        simulated.Grapple(),
        simulated.Grapple(0.35, 2.1, 150.0, 900.0, 300.0, 80.0),
    ):
        fields = {n: getattr(data, n) for n in GrappleData.model_fields}
        derived = SwayDynamics(GrappleData(**fields))
        for sway, rate, tip in states.rows:
            motion = simulated.TipMotion(
                tip.position[1],
                tip.velocity[1],
                tip.acceleration[1],
                tip.velocity[0],
                tip.acceleration[0],
                tip.acceleration[2],
            )
            expected = simulated.accelerations(data, (*sway, *rate), motion)
            assert derived.accelerations(sway, rate, tip) == pytest.approx(expected, abs=1e-10)


def test_heading_and_height_are_without_influence(
    dynamics: SwayDynamics, states: SwayStates
) -> None:
    sway, rate, tip = states.rows[0]
    there = dynamics.accelerations(sway, rate, tip)
    theta1, x, z = tip.position
    moved = tip._replace(position=(theta1 + 1.0, x, z - 2.0))
    assert dynamics.accelerations(sway, rate, moved) == pytest.approx(there, abs=0.0)
    sinking = tip._replace(velocity=(*tip.velocity[:2], tip.velocity[2] - 1.0))
    assert dynamics.accelerations(sway, rate, sinking) == pytest.approx(there, abs=1e-12)


def test_mass_matrix_is_diagonal(dynamics: SwayDynamics, states: SwayStates) -> None:
    g = dynamics.grapple
    for sway, _, _ in states.rows:
        l3 = g.l1_m + g.l2_m * math.cos(sway[1])
        expected = [g.m1_kg * g.l1_m**2 + g.m2_kg * l3**2, g.m2_kg * g.l2_m**2]
        mass = np.asarray(dynamics.mass_matrix(sway).full())
        assert mass == pytest.approx(np.diag(expected), abs=1e-9)


def still(step_s: float, duration_s: float) -> tuple[Array, Array, Array]:
    count = 2 * round(duration_s / step_s) + 1
    return np.tile([0.3, 3.0, 4.0], (count, 1)), np.zeros((count, 3)), np.zeros((count, 3))


def energies(dynamics: SwayDynamics, swings: Array) -> Array:
    """Energy (J) above that of hanging at rest, tip at rest."""
    lowest = dynamics.total_energy_j((0, 0), (0, 0), (0.3, 3, 4), (0, 0, 0))
    rows = [dynamics.total_energy_j(s[:2], s[2:], (0.3, 3, 4), (0, 0, 0)) for s in swings]
    return np.array(rows) - lowest


def test_energy_is_conserved_without_damping(undamped: GrappleData) -> None:
    dynamics = SwayDynamics(undamped)
    start = np.radians([34.0, 40.0])
    swings = swing(dynamics.acceleration, 0.002, still(0.002, 60.0), start)
    energy = energies(dynamics, swings[::10])
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-9
    assert np.abs(swings[:, :2]).max() > math.radians(39.0)  # it swings all the time


def test_damping_takes_out_what_the_joints_turn_to_heat(dynamics: SwayDynamics) -> None:
    g, step_s = dynamics.grapple, 0.002
    swings = swing(dynamics.acceleration, step_s, still(step_s, 5.0), np.array([0.5, 0.4]))
    power = swings[:, 2] ** 2 * g.c5_n_m_s_rad + swings[:, 3] ** 2 * g.c6_n_m_s_rad
    energy = energies(dynamics, swings[[0, -1]])
    assert energy[0] - energy[1] == pytest.approx(trapezoid(power, dx=step_s), rel=1e-5)


def test_work_of_the_tip_is_the_gain_of_energy(
    undamped: GrappleData, states: SwayStates, kinematics: Kinematics
) -> None:
    """Power of the force at the tip, from the masses' accelerations, against d(T + V)/dt.

    In the joints' own motion, by differences: no Lagrangian is involved on the force's side.
    """
    dynamics, h = SwayDynamics(undamped), 1e-4
    of_joints = dynamics.driven_by(kinematics)
    random = np.random.default_rng(6)
    masses = np.array([undamped.m1_kg, undamped.m2_kg])
    for sway, rate, _ in states.rows[:30]:
        full = kinematics.full_speeds
        q = random.uniform(kinematics.lower_limits, kinematics.upper_limits)
        q_d, q_dd = random.uniform(-1, 1, 4) * full, random.uniform(-2, 2, 4) * full
        sway_dd = of_joints(sway, rate, q, q_d, q_dd).full().ravel()
        places, energy = [], []
        for t in (-h, 0.0, h):
            q_t, q_d_t = q + q_d * t + 0.5 * q_dd * t**2, q_d + q_dd * t
            sway_t, rate_t = sway + rate * t + 0.5 * sway_dd * t**2, rate + sway_dd * t
            tip, tip_d = kinematics.cylindrical_tip(q_t), kinematics.cylindrical_speed(q_t, q_d_t)
            places.append(np.asarray(dynamics.positions(sway_t, tip).full()))
            energy.append(dynamics.total_energy_j(sway_t, rate_t, tip, tip_d))
        force = ((places[2] - 2.0 * places[1] + places[0]) / h**2) @ masses
        force[2] += 9.81 * masses.sum()
        # The link's joint axis turns with the boom: the slew drive also gives a moment about z.
        tip_speed = kinematics.tip_velocity_m_s(q, q_d)
        arm = places[1] - kinematics.tip_m(q)[:, None]
        pull = ((places[2] - 2.0 * places[1] + places[0]) / h**2) * masses
        moment = (arm[0] * pull[1] - arm[1] * pull[0]).sum()
        power = force @ tip_speed + moment * q_d[0]
        assert (energy[2] - energy[0]) / (2.0 * h) == pytest.approx(power, rel=1e-4, abs=0.05)
