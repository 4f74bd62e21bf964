"""The equations as the paper prints them, misprints included, to be held against the derived ones.

Heading: Eq. 7 and 8 count theta1 from another axis than Eq. 3, A1 and A2: theirs is larger by
90 deg. `PRINTED_TURN` is that angle.
"""

import math
from typing import NamedTuple

import numpy as np

from canshaper.shaping.sway import GRAVITY_M_S2
from studies.crane.config import GrappleData
from studies.crane.dynamics import TipMotion
from studies.crane.kinematics import Array

PRINTED_TURN = math.pi / 2.0


class Moments(NamedTuple):
    """What Eq. 7 and 8 print between brackets, plus the damping: 0 where they hold, N m."""

    joint5: float
    joint6: float


def tip_acceleration(tip: TipMotion) -> Array:
    """(x_tip'', y_tip'', z_tip'') in the frame of Eq. 3, from its second derivative."""
    theta1, x, _ = tip.position
    slew, x_d, _ = tip.velocity
    slew_d, x_dd, z_dd = tip.acceleration
    radial, tangential = x_dd - x * slew**2, x * slew_d + 2.0 * x_d * slew
    c, s = math.cos(theta1), math.sin(theta1)
    return np.array([c * radial - s * tangential, s * radial + c * tangential, z_dd])


def equation_9(tip: TipMotion, heading: float) -> tuple[float, float]:
    """(x_tip'', y_tip'') with the signs of the print; the lost dots are put back."""
    x, (slew, x_d, _), (slew_d, x_dd, _) = tip.position[1], tip.velocity, tip.acceleration
    c, s = math.cos(heading), math.sin(heading)
    return (
        s * (x_dd - x * slew**2) - c * (x * slew_d + 2.0 * x_d * slew),
        c * (x_dd - x * slew**2) + s * (x * slew_d + 2.0 * x_d * slew),
    )


def equations_7_8(
    g: GrappleData,
    sway: tuple[Array, Array, Array],
    tip: TipMotion,
    *,
    turn: float = PRINTED_TURN,
    lever: str = "l2",
    power: int = 2,
) -> Moments:
    """Eq. 7 and 8 with everything on one side.

    Args:
        g: the grapple.
        sway: angles, rates, accelerations.
        tip: its motion; theta1 as in Eq. 3.
        turn: what the equations add to theta1.
        lever: distance in the factor (m1 l1 + m2 lever), printed "l2", right is "l3".
        power: of theta6' in the Coriolis term, printed 2, right is 1.
    """
    (t5, t6), (w5, w6), (a5, a6) = sway
    (theta1, _, _), (slew, _, _), (slew_d, _, _) = tip
    x_dd, y_dd, z_dd = tip_acceleration(tip)
    l1, l2, m1, m2 = g.l1_m, g.l2_m, g.m1_kg, g.m2_kg
    s1, c1 = math.sin(theta1 + turn), math.cos(theta1 + turn)
    s5, c5, s6, c6 = math.sin(t5), math.cos(t5), math.sin(t6), math.cos(t6)
    l3 = l1 + l2 * c6
    weight = z_dd + GRAVITY_M_S2
    joint5 = (
        g.c5_n_m_s_rad * w5
        + (m1 * l1 + m2 * {"l2": l2, "l3": l3}[lever])
        * (c5 * c1 * x_dd + c5 * s1 * y_dd + s5 * weight)
        + m1 * l1 * (l1 * a5 - l1 * s5 * c5 * slew**2)
        + m2
        * l3
        * (
            l3 * a5
            - 2.0 * l2 * s6 * w5 * w6**power
            - l2 * c5 * s6 * slew_d
            - l3 * s5 * c5 * slew**2
            - 2.0 * l2 * c5 * c6 * slew * w6
        )
    )
    joint6 = g.c6_n_m_s_rad * w6 + m2 * l2 * (
        x_dd * (-c6 * s1 - s5 * s6 * c1)
        + y_dd * (c6 * c1 - s5 * s6 * s1)
        + l2 * a6
        + c5 * s6 * weight
        + s5 * (l1 * c6 + l2) * slew_d
        + s6 * (l1 - l3 * c5**2) * slew**2
        + l3 * s6 * w5**2
        + 2.0 * l3 * c5 * c6 * slew * w5
    )
    return Moments(joint5, joint6)


def equation_a3(
    g: GrappleData,
    sway: Array,
    rate: Array,
    tip: TipMotion,
    *,
    power: int = 2,
    sign: float = 1.0,
) -> float:
    """Kinetic energy of the grapple's mass, J; frame of Eq. 3.

    Args:
        g: the grapple.
        sway: angles.
        rate: their rates.
        tip: its motion.
        power: of theta6' in the last term of each row, printed 2, right is 1.
        sign: of that term in the y row, printed +1, right is -1.
    """
    (t5, t6), (w5, w6), l2, m = sway, rate, g.l2_m, g.m2_kg
    (theta1, x, _), (slew, x_d, z_d) = tip.position, tip.velocity
    s1, c1 = math.sin(theta1), math.cos(theta1)
    s5, c5, s6, c6 = math.sin(t5), math.cos(t5), math.sin(t6), math.cos(t6)
    l3 = g.l1_m + l2 * c6
    x_tip_d, y_tip_d = x_d * c1 - x * slew * s1, x_d * s1 + x * slew * c1
    row_x = (
        x_tip_d
        + l2 * s6 * s1 * slew
        - l3 * c5 * s1 * w5
        - l3 * s5 * c1 * slew
        - l2 * c6 * c1 * w6
        + l2 * s5 * s6 * s1 * w6**power
    )
    row_y = (
        y_tip_d
        - l2 * s6 * c1 * slew
        + l3 * c5 * c1 * w5
        - l3 * s5 * s1 * slew
        - l2 * c6 * s1 * w6
        + sign * l2 * s5 * s6 * c1 * w6**power
    )
    row_z = z_d + l3 * s5 * w5 + l2 * c5 * s6 * w6**power
    return 0.5 * m * (row_x**2 + row_y**2 + row_z**2)


def appendix_b(g: GrappleData, sway: Array, heading: float, x: float) -> Array:
    """(a5 a6 a7), (b5 b6 b7) as printed in B1 and B2, with m0, l0, m read as m1, l1, m2."""
    (x1, x3), x5, x7 = sway, heading, x
    m0, l0, m, l1, l2 = g.m1_kg, g.l1_m, g.m2_kg, g.l1_m, g.l2_m
    sin, cos = math.sin, math.cos
    l3 = l1 + l2 * cos(x3)
    a5 = -(
        (m0 * l0 + m * l3) * cos(x1) * cos(x5) * cos(x5) * x7 + cos(x1) * sin(x5) * sin(x5) * x7
    ) - m * l3 * (-l3 + l2 * cos(x1) * sin(x3)) / (m * (l0**2 + l3**2))
    a6 = -(
        (m0 * l0 + m * l3)
        * (cos(x1) * cos(x5) * (cos(x5) * sin(x5)) - cos(x5) * cos(x1) * sin(x5))
        / (m0 * l0**2 + m * l3**2)
    )
    b5 = -(1.0 / l2) * (sin(x1) * (l2 + l1 * cos(x3)) + sin(x5) * x7 + cos(x5) * x7)
    b6 = -(1.0 / l2) * (
        sin(x5) * (cos(x3) * sin(x5) + cos(x5) * sin(x1) * sin(x3))
        - cos(x5) * (cos(x3) * cos(x5) - sin(x1) * sin(x3) * sin(x5))
    )
    b7 = -(1.0 / l2) * (cos(x1) * sin(x3))
    return np.array([[a5, a6, 0.0], [b5, b6, b7]])
