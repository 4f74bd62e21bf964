"""The hanging grapple: two free joints theta5 and theta6 below a moving boom tip.

Paper Eq. 7-9 ("Optimal sway motion reduction in forestry cranes", 2024) in corrected form: in
Eq. 7 the gravity and tip factor is (m1 l1 + m2 l3) and theta6' stands to the first power, both
equations are solved for the second derivatives, and the dots lost in Eq. 9 are restored. The mass
matrix is diagonal, so each equation gives its own acceleration.

Frame: the tip is at (x cos theta1, x sin theta1, z), x the radius, theta1 the slew angle, z the
height; e_r = (cos theta1, sin theta1) points outwards along the boom, e_t = (-sin theta1,
cos theta1) in slew direction, e_z upwards. With l3 = l1 + l2 cos theta6 the grapple (m2) hangs at
-l2 sin(theta6) e_r + l3 sin(theta5) e_t - l3 cos(theta5) e_z from the tip, and the link (m1) at
l1 (sin(theta5) e_t - cos(theta5) e_z). So theta5 > 0 swings in slew direction and theta6 > 0
swings inwards, towards the pillar.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

from canshaper_sim.ranges import check_ranges

new_tuple = tuple.__new__
"""``new_tuple(Sway, (...))`` is ``Sway(...)`` in half the time."""


class TipMotion(NamedTuple):
    """Motion of the boom tip at one instant, in cylindrical coordinates about the pillar."""

    radius_m: float
    radius_rate_m_s: float
    radius_acceleration_m_s2: float
    slew_rate_rad_s: float
    slew_acceleration_rad_s2: float
    height_acceleration_m_s2: float
    # The place of the tip matters only to contact, carrier and wind.
    slew_rad: float = 0.0
    height_m: float = 0.0
    height_rate_m_s: float = 0.0


class Sway(NamedTuple):
    """Two free joints: theta5 swings in slew direction, theta6 inwards; rad, rates in rad/s."""

    theta5_rad: float = 0.0
    theta6_rad: float = 0.0
    theta5_rate_rad_s: float = 0.0
    theta6_rate_rad_s: float = 0.0


class SwayMode(NamedTuple):
    """A linear sway mode about rest: theta'/v = gain s^2 / (s^2 + 2 zeta omega s + omega^2).

    v is the tip speed in m/s in e_t (theta5) or e_r (theta6); paper Eq. 12, with the radius taken
    out of G11 so that the mode does not depend on the pose.
    """

    omega_rad_s: float
    zeta: float
    gain_1_m: float


# name -> (lowest, highest) value that still describes a grapple on a forestry or loader crane.
_ALLOWED = {
    "l1_m": (0.0, 2.0),
    "l2_m": (0.1, 10.0),
    "m1_kg": (0.0, 10_000.0),
    "m2_kg": (1.0, 100_000.0),
    "c5_n_m_s_rad": (0.0, 1e6),
    "c6_n_m_s_rad": (0.0, 1e6),
    "g_m_s2": (1.0, 25.0),
}


@dataclass(frozen=True, slots=True)
class Grapple:
    """Lengths, masses and joint damping of link and grapple, both taken as point masses.

    The paper publishes no such numbers; the defaults are a plausible forwarder grapple
    (theta5: 2.67 rad/s, damping ratio 0.038; theta6: 2.86 rad/s, 0.049). The model is meant for
    |theta6| < 90 deg; l3 = 0 beyond that is a singularity of the joint, not of the code.
    """

    l1_m: float = 0.20  # tip joint (theta5) to the joint of theta6
    l2_m: float = 1.20  # joint of theta6 to the centre of mass of the grapple
    m1_kg: float = 40.0
    m2_kg: float = 300.0
    c5_n_m_s_rad: float = 120.0
    c6_n_m_s_rad: float = 120.0
    g_m_s2: float = 9.81

    def __post_init__(self) -> None:
        check_ranges("grapple", self, _ALLOWED)

    def longer(self, percent: float) -> Self:
        """Return a copy with l2_m longer by this percentage; a negative one makes it shorter."""
        return replace(self, l2_m=self.l2_m * (1.0 + percent / 100.0))

    @property
    def mode5(self) -> SwayMode:
        """Swing in slew direction about rest (paper Eq. 11-12, G11 without the radius)."""
        length = self.l1_m + self.l2_m
        inertia = self.m1_kg * self.l1_m**2 + self.m2_kg * length**2
        moment = self.m1_kg * self.l1_m + self.m2_kg * length
        omega = math.sqrt(self.g_m_s2 * moment / inertia)
        return SwayMode(omega, self.c5_n_m_s_rad / (2.0 * omega * inertia), -moment / inertia)

    @property
    def mode6(self) -> SwayMode:
        """Swing along the boom about rest (paper Eq. 11-12, G22)."""
        omega = math.sqrt(self.g_m_s2 / self.l2_m)
        inertia = self.m2_kg * self.l2_m**2
        return SwayMode(omega, self.c6_n_m_s_rad / (2.0 * omega * inertia), 1.0 / self.l2_m)

    def offset_m(self, theta5_rad: float, theta6_rad: float) -> tuple[float, float]:
        """Return the horizontal offset of the grapple from the tip, m: outwards, slew direction."""
        return offset_m(self.l1_m, self.l2_m, theta5_rad, theta6_rad)


def offset_m(l1_m: float, l2_m: float, theta5_rad: float, theta6_rad: float) -> tuple[float, float]:
    """Return the load's offset from the tip, m: outwards, slew direction. A rope has l1_m = 0."""
    l3_m = l1_m + l2_m * math.cos(theta6_rad)
    return -l2_m * math.sin(theta6_rad), l3_m * math.sin(theta5_rad)


def accelerations(
    grapple: Grapple, sway: tuple[float, float, float, float], tip: TipMotion
) -> tuple[float, float]:
    """Return (theta5'', theta6'') in rad/s^2 for a `Sway` and a tip motion (Eq. 7-9, corrected)."""
    theta5, theta6, rate5, rate6 = sway
    radius, radius_rate, radius_acc, slew_rate, slew_acc, height_acc, _, _, _ = tip
    l1 = grapple.l1_m
    l2 = grapple.l2_m
    m1 = grapple.m1_kg
    m2 = grapple.m2_kg
    s5 = math.sin(theta5)
    c5 = math.cos(theta5)
    s6 = math.sin(theta6)
    c6 = math.cos(theta6)
    l3 = l1 + l2 * c6
    slew_rate2 = slew_rate * slew_rate
    radial = radius_acc - radius * slew_rate2  # Eq. 9: acceleration of the tip in e_r
    tangential = radius * slew_acc + 2.0 * radius_rate * slew_rate  # Eq. 9: in e_t
    weight = height_acc + grapple.g_m_s2
    inertia5 = m1 * l1 * l1 + m2 * l3 * l3
    coupling = m2 * l2 * l3

    torque5 = (
        (m1 * l1 + m2 * l3) * (c5 * tangential + s5 * weight)
        - inertia5 * s5 * c5 * slew_rate2
        - coupling
        * (2.0 * s6 * rate5 * rate6 + c5 * (s6 * slew_acc + 2.0 * c6 * slew_rate * rate6))
        + grapple.c5_n_m_s_rad * rate5
    )
    # The equation of theta6 divided by m2 l2.
    specific6 = (
        s6 * (c5 * weight - s5 * tangential)
        - c6 * radial
        + s5 * (l1 * c6 + l2) * slew_acc
        + s6 * (l1 - l3 * c5 * c5) * slew_rate2
        + l3 * rate5 * (s6 * rate5 + 2.0 * c6 * c5 * slew_rate)
        + grapple.c6_n_m_s_rad / (m2 * l2) * rate6
    )
    return -torque5 / inertia5, -specific6 / l2


Push = tuple[float, float, float]
"""Force on a mass, N/kg: outwards, in slew direction, upwards."""


def pushed(
    grapple: Grapple, sway: tuple[float, float, float, float], link: Push, load: Push
) -> tuple[float, float]:
    """Return what forces (N/kg) on link and grapple add to (theta5'', theta6''), rad/s^2."""
    s5, c5, s6, c6 = math.sin(sway[0]), math.cos(sway[0]), math.sin(sway[1]), math.cos(sway[1])
    l1, l2 = grapple.l1_m, grapple.l2_m
    l3 = l1 + l2 * c6
    link_moment = grapple.m1_kg * l1 * (c5 * link[1] + s5 * link[2])
    load_moment = grapple.m2_kg * l3 * (c5 * load[1] + s5 * load[2])
    inertia5 = grapple.m1_kg * l1 * l1 + grapple.m2_kg * l3 * l3
    along = s6 * (c5 * load[2] - s5 * load[1]) - c6 * load[0]
    return (link_moment + load_moment) / inertia5, along / l2


def rest(grapple: Grapple, link: Push, load: Push) -> tuple[float, float]:
    """Return (theta5, theta6) in rad of a grapple at rest under its weight and these forces."""
    theta5 = theta6 = 0.0
    g, of_link = grapple.g_m_s2, grapple.m1_kg * grapple.l1_m
    for _ in range(8):  # theta6 shortens what theta5 moves, by less each time
        of_load = grapple.m2_kg * (grapple.l1_m + grapple.l2_m * math.cos(theta6))
        across = of_link * link[1] + of_load * load[1]
        theta5 = math.atan2(across, of_link * (g - link[2]) + of_load * (g - load[2]))
        down = math.cos(theta5) * (g - load[2]) + math.sin(theta5) * load[1]
        theta6 = math.atan2(-load[0], down)
    return theta5, theta6


Accelerations = Callable[
    [Grapple, tuple[float, float, float, float], TipMotion], tuple[float, float]
]
"""Function of grapple, sway and tip, as `accelerations`."""


def advance(
    grapple: Grapple,
    sway: Sway,
    step_s: float,
    tips: tuple[TipMotion, TipMotion, TipMotion],
    accelerations: Accelerations = accelerations,
) -> Sway:
    """Advance the sway by one classical Runge-Kutta step of step_s seconds.

    `tips` is the tip motion at start, middle and end of the step. The stages weigh the tip
    acceleration as Simpson's rule does: if (start + 4 middle + end)/6 is its mean over the step, a
    speed that jumps within the step still gives its exact impulse.
    """
    tip_start, tip_middle, tip_end = tips
    h = step_s
    half = 0.5 * h
    theta5, theta6, rate5, rate6 = sway
    a5, a6 = accelerations(grapple, sway, tip_start)
    rate5_b, rate6_b = rate5 + half * a5, rate6 + half * a6
    sway_b = (theta5 + half * rate5, theta6 + half * rate6, rate5_b, rate6_b)
    a5_b, a6_b = accelerations(grapple, sway_b, tip_middle)
    rate5_c, rate6_c = rate5 + half * a5_b, rate6 + half * a6_b
    sway_c = (theta5 + half * rate5_b, theta6 + half * rate6_b, rate5_c, rate6_c)
    a5_c, a6_c = accelerations(grapple, sway_c, tip_middle)
    rate5_d, rate6_d = rate5 + h * a5_c, rate6 + h * a6_c
    sway_d = (theta5 + h * rate5_c, theta6 + h * rate6_c, rate5_d, rate6_d)
    a5_d, a6_d = accelerations(grapple, sway_d, tip_end)
    sixth = h / 6.0
    end = (
        theta5 + sixth * (rate5 + 2.0 * (rate5_b + rate5_c) + rate5_d),
        theta6 + sixth * (rate6 + 2.0 * (rate6_b + rate6_c) + rate6_d),
        rate5 + sixth * (a5 + 2.0 * (a5_b + a5_c) + a5_d),
        rate6 + sixth * (a6 + 2.0 * (a6_b + a6_c) + a6_d),
    )
    return new_tuple(Sway, end)
