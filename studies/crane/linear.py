"""Linear sway about a pose, at rest and while slewing: paper Eq. 11-12, corrected.

    (theta5', theta6') = G(s) (theta1', x', z')

at any radius. The linearisation is that of `SwayStateSpace` by CasADi; next to it stand the closed
forms, worked out by hand, and the tests hold one against the other.

At rest G12 = G13 = G21 = G23 = 0 identically and every G_ij has the DC gain 0. While the crane
slews the grapple hangs outwards and Coriolis forces couple its two modes: none of the six is zero,
G21 becomes as large as G11, and G22 has a DC gain (farther out the grapple hangs farther outwards).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.signal import StateSpace, ss2tf

from canshaper.errors import DesignError
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode
from studies.crane.config import GrappleData
from studies.crane.dynamics import SwayDynamics
from studies.crane.kinematics import Array, Kinematics, Vector, evaluate
from studies.crane.statespace import SwayStateSpace

# States of `SwayStateSpace` that the sway depends on: all but heading and height.
_KEPT = [0, 1, 2, 3, 5]


@dataclass(frozen=True)
class OperatingPoint:
    """Where and how fast the crane stands or slews steadily; the tip does not move otherwise."""

    radius_m: float
    slew_rate_rad_s: float = 0.0
    height_m: float = 0.0  # without influence on the sway

    @classmethod
    def of_pose(
        cls, kinematics: Kinematics, q: Vector, slew_rate_rad_s: float = 0.0
    ) -> "OperatingPoint":
        """The point of a pose of the joints."""
        _, radius, height = kinematics.cylindrical_tip(q)
        return cls(float(radius), slew_rate_rad_s, float(height))


class TransferFunction(NamedTuple):
    """num(s)/den(s), coefficients from the highest power down, as in SciPy and Matlab."""

    num: Array
    den: Array

    def __call__(self, s: complex) -> complex:
        """Value at one s, rad/s."""
        return complex(np.polyval(self.num, s) / np.polyval(self.den, s))


# [output][input]: outputs theta5', theta6', inputs theta1', x', z'.
TransferMatrix = tuple[tuple[TransferFunction, ...], ...]


class SwayModes(NamedTuple):
    """The two sway modes; at rest each belongs to one joint, while slewing to both."""

    mode5: SwayMode
    mode6: SwayMode


@dataclass(frozen=True)
class LinearSway:
    """Linearised sway x' = a x + b u, y = c x + d u about an operating point.

    The states are deviations of (theta5, w5, theta6, w6, x); see `SwayStateSpace`. The last one is
    a pure integrator of the input x'.

    Attributes:
        point: the operating point.
        theta6_rad: the angle at which the grapple hangs there; theta5 is 0.
        a, b, c, d: 5 x 5, 5 x 3, 2 x 5, 2 x 3.
    """

    point: OperatingPoint
    theta6_rad: float
    a: Array
    b: Array
    c: Array
    d: Array

    def state_space(self) -> StateSpace:
        """The same for SciPy."""
        return StateSpace(self.a, self.b, self.c, self.d)

    def transfer_functions(self) -> TransferMatrix:
        """G11 .. G23 with a common denominator of fourth order.

        The integrator of the radius is no pole: G is speed to speed. Its factor s stands in
        numerator and denominator and is taken out of both.
        """
        columns = [ss2tf(self.a, self.b, self.c, self.d, input=j) for j in range(3)]
        den = columns[0][1][:-1]
        return tuple(
            tuple(TransferFunction(num[i][:-1], den) for num, _ in columns) for i in range(2)
        )

    def at(self, s: complex) -> Any:
        """G(s), 2 x 3 complex, straight from the state space."""
        return self.c @ np.linalg.solve(s * np.eye(5) - self.a, self.b) + self.d

    def poles(self) -> tuple[complex, complex]:
        """The upper sway poles, rad/s, the slower mode first.

        Raises:
            DesignError: a mode does not swing (damping beyond the critical one).
        """
        upper = [complex(p) for p in np.linalg.eigvals(self.a[:4, :4]) if p.imag > 1e-9]
        if len(upper) != 2:
            raise DesignError("a sway mode does not swing: damping beyond the critical one")
        slow, fast = sorted(upper, key=abs)
        return slow, fast


def hanging_angle(dynamics: SwayDynamics, point: OperatingPoint) -> float:
    """theta6 (rad) at which the grapple hangs still while the crane slews steadily; <= 0: outwards.

    For a point mass tan(theta6) = -slew_rate^2 (x - l2 sin theta6) / g; found in the derived
    equations, not in this one.
    """
    position, speed = (0.0, point.radius_m, point.height_m), (point.slew_rate_rad_s, 0.0, 0.0)

    def falls(theta6: float) -> float:
        rest, still = (0.0, theta6), (0.0, 0.0)
        return float(
            evaluate(dynamics.acceleration, rest, still, position, speed, (0.0, 0.0, 0.0))[1]
        )

    if point.slew_rate_rad_s == 0.0:
        return 0.0
    return float(brentq(falls, -1.5, 1.5, xtol=1e-14))


def linearise(grapple: GrappleData, point: OperatingPoint) -> LinearSway:
    """Linear sway about rest or about steady slewing, by CasADi from Eq. 10."""
    space = SwayStateSpace(grapple)
    theta6 = hanging_angle(SwayDynamics(grapple), point)
    u = (point.slew_rate_rad_s, 0.0, 0.0)
    state = space.state_of((0.0, theta6), (0.0, 0.0), (0.0, point.radius_m, point.height_m), u)
    a, b, c, d = (np.asarray(m.full()) for m in space.jacobians()(state, u))
    return LinearSway(point, theta6, a[np.ix_(_KEPT, _KEPT)], b[_KEPT], c[:, _KEPT], d)


def closed_form(
    grapple: GrappleData, point: OperatingPoint, theta6_rad: float = 0.0
) -> TransferMatrix:
    """G11 .. G23 as formulas (Eq. 12, corrected; extended to steady slewing).

    With l3 = l1 + l2 cos theta6, J5 = m1 l1^2 + m2 l3^2, M5 = m1 l1 + m2 l3 and W the slew rate:

        P11 = J5 s^2 + c5 s + M5 g - J5 W^2          P12 = -2 m2 l2 l3 cos(theta6) W s
        P21 =  2 m2 l2 l3 cos(theta6) W s            P22 = m2 l2 (l2 s^2 + c6/(m2 l2) s + K6)
        K6  = g cos(theta6) - x W^2 sin(theta6) - l2 W^2 cos(2 theta6)

    and at rest (W = 0, theta6 = 0)

        G11 = -x M5 s^2 / (J5 s^2 + c5 s + M5 g)     G22 = s^2 / (l2 s^2 + c6/(m2 l2) s + g)

    which for l1 << l2, m1 << m2 are -(x/l) s^2 / (s^2 + c/(m l^2) s + g/l) with l = l1 + l2 and
    (1/l2) s^2 / (s^2 + c/(m l2^2) s + g/l2): the 3 of Eq. 12, a radius, belongs to G11.

    Args:
        grapple: lengths, masses, damping.
        point: radius and slew rate.
        theta6_rad: `hanging_angle` of the point; 0 at rest.
    """
    l2, m2 = grapple.l2_m, grapple.m2_kg
    x, slew = point.radius_m, point.slew_rate_rad_s
    s6, c6 = np.sin(theta6_rad), np.cos(theta6_rad)
    l3 = grapple.l1_m + l2 * c6
    moment = grapple.m1_kg * grapple.l1_m + m2 * l3
    inertia = grapple.m1_kg * grapple.l1_m**2 + m2 * l3**2
    ml = m2 * l2
    stiffness6 = GRAVITY_M_S2 * c6 - x * slew**2 * s6 - l2 * slew**2 * (c6**2 - s6**2)
    p11 = [inertia, grapple.c5_n_m_s_rad, moment * GRAVITY_M_S2 - inertia * slew**2]
    p22 = [ml * l2, grapple.c6_n_m_s_rad, ml * stiffness6]
    # P theta = N u; rows of s N, because the outputs are rates.
    n5 = [[-(moment * x - ml * l3 * s6), 0.0, 0.0], [-2.0 * moment * slew, 0.0], [0.0]]
    n6 = [
        [-2.0 * ml * c6 * (x - l2 * s6) * slew, 0.0],
        [ml * c6, 0.0, -ml * c6 * slew**2],
        [-ml * s6, 0.0, 0.0],
    ]
    if slew == 0.0:  # P is diagonal: the fourth order would only cancel
        return (_row(n5, p11), _row(n6, p22))
    p21 = [2.0 * ml * l3 * c6 * slew, 0.0]
    den = np.polyadd(np.polymul(p11, p22), np.polymul(p21, p21))  # P12 = -P21
    row5 = [np.polyadd(np.polymul(p22, a), np.polymul(p21, b)) for a, b in zip(n5, n6, strict=True)]
    row6 = [np.polysub(np.polymul(p11, b), np.polymul(p21, a)) for a, b in zip(n5, n6, strict=True)]
    return (_row(row5, den), _row(row6, den))


def _row(numerators: Sequence[Any], den: Any) -> tuple[TransferFunction, ...]:
    """Transfer functions of one output, the leading coefficient of the denominator made 1."""
    lead = den[0]
    nums = [np.trim_zeros(np.asarray(n, dtype=float), "f") / lead for n in numerators]
    den = np.asarray(den, dtype=float) / lead
    return tuple(TransferFunction(n if n.size else np.zeros(1), den) for n in nums)


def sway_modes(grapple: GrappleData, point: OperatingPoint | None = None) -> SwayModes:
    """Natural frequencies and damping ratios of the sway (Eq. 12).

    At rest (default), where the pose does not matter, mode5 is the swing across the boom and mode6
    the one along it. While slewing both joints take part in both modes, and these move apart
    (2.67 and 2.86 rad/s at rest, 2.26 and 3.28 rad/s at a slew rate of 0.5 rad/s); mode5 is the one
    whose place in the order is that of mode5 at rest.

    Raises:
        DesignError: a mode does not swing or is outside the range of `SwayMode`.
    """
    at_rest = closed_form(grapple, OperatingPoint(radius_m=1.0))
    _, twice5, square5 = at_rest[0][0].den
    _, twice6, square6 = at_rest[1][1].den
    if point is None or point.slew_rate_rad_s == 0.0:
        omega5, omega6 = np.sqrt(square5), np.sqrt(square6)
        return SwayModes(
            SwayMode(float(omega5), float(twice5 / (2.0 * omega5))),
            SwayMode(float(omega6), float(twice6 / (2.0 * omega6))),
        )
    slow, fast = (SwayMode(abs(p), -p.real / abs(p)) for p in linearise(grapple, point).poles())
    return SwayModes(slow, fast) if square5 <= square6 else SwayModes(fast, slow)
