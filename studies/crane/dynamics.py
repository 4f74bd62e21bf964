"""Sway of the grapple under any motion of the tip, derived from its Lagrangian: paper Eq. 4-9.

Nothing of Eq. 7-9 is typed in: positions of the two point masses (Eq. A1, A2 with the link's mass
added), kinetic and potential energy (Eq. A3, A4), Lagrange's equations (Eq. 4-6) and the solution
for (theta5'', theta6'') are left to CasADi.

Frame: that of Eq. 3 and A2. The tip is at (x cos theta1, x sin theta1, z), e_r points outwards
along the boom, e_t in slew direction. theta5 > 0 swings in slew direction, theta6 > 0 inwards.
The joint of theta5 turns about e_r, i.e. about a horizontal axis in every pose of the outer boom:
so does the paper's.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Final, NamedTuple

import casadi as ca

from canshaper.shaping.sway import GRAVITY_M_S2
from studies.crane.config import GrappleData
from studies.crane.kinematics import Array, Kinematics, Vector, evaluate

PARAMETERS: Final = ("l1_m", "l2_m", "m1_kg", "m2_kg", "c5_n_m_s_rad", "c6_n_m_s_rad")


class TipMotion(NamedTuple):
    """Motion of the tip at one instant, each as (theta1, x, z) in rad and m, per s, per s^2."""

    position: Vector
    velocity: Vector
    acceleration: Vector


@dataclass(frozen=True)
class SwayEquations:
    """The equations of motion in symbols; see `sway_equations`.

    Attributes:
        sway: (theta5, theta6), rad.
        rate: (theta5', theta6'), rad/s.
        tip: (theta1, x, z), rad, m, m.
        tip_rate: its first derivative, the command of the operator.
        tip_acceleration: its second derivative.
        parameters: l1, l2, m1, m2, c5, c6 in the order and units of `PARAMETERS`.
        positions: of link and grapple relative to the base frame, two columns, m (A1, A2).
        kinetic: kinetic energy, J (A3, both masses).
        potential: potential energy, J (A4, both masses).
        mass_matrix: d2T / d rate2, 2 x 2, kg m^2. Diagonal, though CasADi does not see it.
        acceleration: (theta5'', theta6''), rad/s^2 (Eq. 7 and 8 with Eq. 9, corrected).
    """

    sway: Any
    rate: Any
    tip: Any
    tip_rate: Any
    tip_acceleration: Any
    parameters: Any
    positions: Any
    kinetic: Any
    potential: Any
    mass_matrix: Any
    acceleration: Any


@cache
def sway_equations() -> SwayEquations:
    """Derive the equations once; the grapple's parameters stay symbols."""
    sway, rate = ca.SX.sym("sway", 2), ca.SX.sym("sway_d", 2)
    tip, tip_rate, tip_acceleration = (ca.SX.sym(n, 3) for n in ("tip", "tip_d", "tip_dd"))
    parameters = ca.SX.sym("parameters", len(PARAMETERS))
    l1, l2, m1, m2, c5, c6 = ca.vertsplit(parameters)
    theta5, theta6 = sway[0], sway[1]
    theta1, x, z = tip[0], tip[1], tip[2]

    outwards = ca.vertcat(ca.cos(theta1), ca.sin(theta1), 0)
    along_slew = ca.vertcat(-ca.sin(theta1), ca.cos(theta1), 0)
    upwards = ca.vertcat(0, 0, 1)
    tip_position = x * outwards + z * upwards
    down_the_link = ca.sin(theta5) * along_slew - ca.cos(theta5) * upwards
    link = tip_position + l1 * down_the_link
    l3 = l1 + l2 * ca.cos(theta6)
    grapple = tip_position - l2 * ca.sin(theta6) * outwards + l3 * down_the_link

    def derivative(expression: Any) -> Any:
        """Total time derivative along the motion of everything but the sway's acceleration."""
        return (
            ca.jtimes(expression, sway, rate)
            + ca.jtimes(expression, tip, tip_rate)
            + ca.jtimes(expression, tip_rate, tip_acceleration)
        )

    kinetic = sum(
        0.5 * mass * ca.sumsqr(derivative(position))
        for mass, position in ((m1, link), (m2, grapple))
    )
    potential = GRAVITY_M_S2 * (m1 * link[2] + m2 * grapple[2])
    lagrangian = kinetic - potential  # Eq. 4
    momentum = ca.gradient(lagrangian, rate)
    mass_matrix = ca.jacobian(momentum, rate)
    torque = -ca.vertcat(c5, c6) * rate  # Eq. 6
    # Eq. 5: M sway'' + (what is left of d/dt dL/d rate) - dL/d sway = torque
    right = torque + ca.gradient(lagrangian, sway) - derivative(momentum)
    acceleration = ca.solve(mass_matrix, right)

    # The base frame may be turned about the vertical, so the heading is no argument of any result;
    # said here, it spares every user the rounding of cos^2 + sin^2.
    kinetic, mass_matrix, acceleration = ca.substitute(
        [kinetic, mass_matrix, acceleration], [theta1], [ca.SX(0)]
    )
    return SwayEquations(
        sway,
        rate,
        tip,
        tip_rate,
        tip_acceleration,
        parameters,
        ca.horzcat(link, grapple),
        kinetic,
        potential,
        mass_matrix,
        acceleration,
    )


def parameter_values(grapple: GrappleData) -> list[float]:
    """Values of `SwayEquations.parameters` for a grapple."""
    return [getattr(grapple, name) for name in PARAMETERS]


class SwayDynamics:
    """The equations of motion of one grapple as CasADi functions and as numbers.

    Attributes:
        acceleration: sway, rate, tip, tip_rate, tip_acceleration -> (theta5'', theta6'') (Eq. 7-9).
        energy: sway, rate, tip, tip_rate -> kinetic, potential energy, J (A3, A4, both masses).
        mass_matrix: sway -> 2 x 2, kg m^2.
        positions: sway, tip -> positions of link and grapple in the base frame, 3 x 2, m (A1, A2).
    """

    def __init__(self, grapple: GrappleData) -> None:
        self.grapple = grapple
        e = sway_equations()
        positions, kinetic, potential, mass, acceleration = ca.substitute(
            [e.positions, e.kinetic, e.potential, e.mass_matrix, e.acceleration],
            [e.parameters],
            [ca.SX(parameter_values(grapple))],
        )
        motion = [e.sway, e.rate, e.tip, e.tip_rate]
        self.acceleration = ca.Function(
            "sway_acceleration", [*motion, e.tip_acceleration], [acceleration]
        )
        self.energy = ca.Function("sway_energy", motion, [kinetic, potential])
        self.mass_matrix = ca.Function("sway_mass_matrix", [e.sway], [mass])
        self.positions = ca.Function("grapple_positions", [e.sway, e.tip], [positions])

    def accelerations(self, sway: Vector, rate: Vector, tip: TipMotion) -> Array:
        """(theta5'', theta6'') in rad/s^2 at angles (rad) and rates (rad/s) under a tip motion."""
        return evaluate(self.acceleration, sway, rate, *tip)

    def total_energy_j(self, sway: Vector, rate: Vector, tip: Vector, tip_rate: Vector) -> float:
        """Kinetic and potential energy of both masses, J; zero height is the foot of the pillar."""
        kinetic, potential = self.energy.call([sway, rate, tip, tip_rate])
        return float(kinetic) + float(potential)

    def driven_by(self, kinematics: Kinematics) -> Any:
        """The same sway with the joints as input instead of the tip.

        Returns:
            CasADi function: sway, rate, q, q', q'' -> (theta5'', theta6''), with the joint vector
            of `Kinematics`.
        """
        sway, rate = ca.SX.sym("sway", 2), ca.SX.sym("sway_d", 2)
        joints = [ca.SX.sym(name, 4) for name in ("q", "q_d", "q_dd")]
        tip = kinematics.cylindrical_motion.call(joints)
        result = self.acceleration.call([sway, rate, *tip])
        return ca.Function("sway_of_joints", [sway, rate, *joints], result)
