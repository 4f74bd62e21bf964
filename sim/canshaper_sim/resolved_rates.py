"""Joint rates for a commanded tip velocity: three boom joints, two coordinates, bounds on each.

Joint rates are fractions of full speed u, tip velocities m/s. With A the Jacobian in these units,

    u = s p + t n,    p = A^T (A A^T + lambda^2 I)^-1 v,    A n = 0, |n| = 1

p is the damped least-squares solution (Nakamura and Hanafusa 1986, Wampler 1986): exact while the
manipulability w = sqrt(det A A^T) is good, bounded where it is not. n is the one joint motion that
does not move the tip. Damping alone bends the path of the tip where a joint is blocked. So t keeps
the rates within their bounds as far as it can; beyond that s <= 1 does, which slows the tip down
and keeps its direction: a linear programme in (s, t), whose best s is found over all pairs of
bounds.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from canshaper_sim.kinematics import Jacobian

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)

# (m/s)^2; the default boom has 2 .. 7. It is 0 where all joints move the tip in one direction: at a
# straight arm, as far as the telescope is slow.
_GOOD_MANIPULABILITY_M2_S2 = 0.5
# A direction of n that moves a joint by less than this is taken as none: rounding.
_NO_SHARE = 1e-9
# Play of the bounds while s and t are sought, so that rounding in a rate next to a bound of zero
# does not stop the tip; the rates themselves are clipped to the bounds.
_PLAY = 1e-6


class Bounds(NamedTuple):
    """Lowest (<= 0) and highest (>= 0) rate of lift, knuckle, extension; part of full speed."""

    low: Vector
    high: Vector


class ResolvedRates:
    """Joint rates in one pose; ``free`` is n, the motion that keeps the tip still, or zeros."""

    __slots__ = ("_height", "_inverse", "_radius", "free")

    def __init__(self, jacobian: Jacobian, full_speeds: Vector, damping_m_s: float) -> None:
        r: Vector = (
            jacobian.r_lift * full_speeds[0],
            jacobian.r_knuckle * full_speeds[1],
            jacobian.r_extension * full_speeds[2],
        )
        z: Vector = (
            jacobian.z_lift * full_speeds[0],
            jacobian.z_knuckle * full_speeds[1],
            jacobian.z_extension * full_speeds[2],
        )
        self._radius, self._height = r, z
        cross = (r[1] * z[2] - r[2] * z[1], r[2] * z[0] - r[0] * z[2], r[0] * z[1] - r[1] * z[0])
        manipulability = math.sqrt(cross[0] ** 2 + cross[1] ** 2 + cross[2] ** 2)
        lack = max(0.0, 1.0 - manipulability / _GOOD_MANIPULABILITY_M2_S2)
        damping2 = (damping_m_s * lack) ** 2
        rr = r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + damping2
        zz = z[0] * z[0] + z[1] * z[1] + z[2] * z[2] + damping2
        rz = r[0] * z[0] + r[1] * z[1] + r[2] * z[2]
        det = rr * zz - rz * rz
        self._inverse = (zz / det, -rz / det, rr / det)
        # The self-motion n; none where the rows of A are parallel.
        self.free: Vector = ZERO
        if manipulability > _NO_SHARE:
            f = 1.0 / manipulability
            self.free = (cross[0] * f, cross[1] * f, cross[2] * f)

    def least_squares(self, radius_speed: float, height_speed: float) -> Vector:
        """Return the damped least-squares rates p, unbounded, for a tip velocity in m/s."""
        a, b, c = self._inverse
        y_r = a * radius_speed + b * height_speed
        y_z = b * radius_speed + c * height_speed
        r, z = self._radius, self._height
        return (
            r[0] * y_r + z[0] * y_z,
            r[1] * y_r + z[1] * y_z,
            r[2] * y_r + z[2] * y_z,
        )

    def within(self, rates: Vector, bounds: Bounds, preferred: float = 0.0) -> tuple[float, Vector]:
        """Return rates that move the tip in the same direction, within the bounds.

        Args:
            rates: least-squares rates p.
            bounds: the bounds.
            preferred: the t that is preferred where the bounds leave a choice.

        Returns:
            (s, s p + t n), with the largest s <= 1 that the bounds allow, t nearest to
            ``preferred``.
        """
        floors, ceilings, scale = self._lines(rates, bounds)
        for at_low, by_low in floors:
            for at_high, by_high in ceilings:
                slope = by_low - by_high
                if slope < 0.0:
                    scale = min(scale, (at_low - at_high) / slope)
        n = self.free
        t = 0.0
        if floors:
            low = max(at - scale * by for at, by in floors)
            high = min(at - scale * by for at, by in ceilings)
            t = min(max(preferred, low), high) if low <= high else 0.5 * (low + high)
        (a, b, c), (low_b, high_b) = rates, bounds
        return scale, (
            min(max(scale * a + t * n[0], low_b[0]), high_b[0]),
            min(max(scale * b + t * n[1], low_b[1]), high_b[1]),
            min(max(scale * c + t * n[2], low_b[2]), high_b[2]),
        )

    def _lines(
        self, rates: Vector, bounds: Bounds
    ) -> tuple[list[tuple[float, float]], list[tuple[float, float]], float]:
        """Return lower bounds of t, upper bounds of t, and an upper bound of s.

        A bound of t is (at, by) for at - s by. Joints that n does not move bound s, and so does 1.
        """
        floors: list[tuple[float, float]] = []
        ceilings: list[tuple[float, float]] = []
        scale = 1.0
        for p, n, tight_low, tight_high in zip(rates, self.free, *bounds, strict=True):
            low, high = tight_low - _PLAY, tight_high + _PLAY
            if n > _NO_SHARE:
                floors.append((low / n, p / n))
                ceilings.append((high / n, p / n))
            elif n < -_NO_SHARE:
                floors.append((high / n, p / n))
                ceilings.append((low / n, p / n))
            elif p > high:
                scale = min(scale, high / p)
            elif p < low:
                scale = min(scale, low / p)
        return floors, ceilings, scale


def less(bounds: Bounds, used: Sequence[float]) -> Bounds:
    """Return the bounds that the rates `used` leave, with 0 within them."""
    low, high = bounds
    return Bounds(
        (min(0.0, low[0] - used[0]), min(0.0, low[1] - used[1]), min(0.0, low[2] - used[2])),
        (max(0.0, high[0] - used[0]), max(0.0, high[1] - used[1]), max(0.0, high[2] - used[2])),
    )
