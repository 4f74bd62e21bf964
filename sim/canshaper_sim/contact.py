"""Contact of the grapple with ground and pile: normal force and friction.

The ground is level; a pile on it is a cone. Where the lower end of the grapple is below the
surface, a spring with a damper pushes that end along the normal, and dry friction acts against its
slip. The boom does not give way: its valves hold it.
"""

import math
from dataclasses import dataclass
from typing import Final

from canshaper_sim.grapple import Grapple, TipMotion
from canshaper_sim.ranges import check_ranges

# name -> (lowest, highest) value.
_ALLOWED = {
    "ground_m": (-math.inf, 10.0),
    "pile_radius_m": (0.0, 30.0),
    "pile_height_m": (0.0, 10.0),
    "pile_width_m": (0.1, 20.0),
    "reach_m": (0.0, 5.0),
    "stiffness_n_m": (1e3, 1e5),
    "damping_n_s_m": (0.0, 1e4),
    "friction": (0.0, 2.0),
}

# Slip below which friction grows in a straight line: it would chatter otherwise.
_STICKING_M_S: Final = 0.02


@dataclass(frozen=True, slots=True)
class ContactParameters:
    """Ground and pile; by default there is no ground."""

    ground_m: float = -math.inf  # height of the ground
    pile_radius_m: float = 5.0  # middle of the pile, straight ahead of the boom at the start
    pile_height_m: float = 0.0  # above the ground
    pile_width_m: float = 1.5  # from its middle to its foot
    reach_m: float = 0.3  # end of the grapple below its centre of mass
    stiffness_n_m: float = 3e4
    damping_n_s_m: float = 3e3
    friction: float = 0.5

    def __post_init__(self) -> None:
        check_ranges("contact", self, _ALLOWED)

    def accelerations(
        self, grapple: Grapple, sway: tuple[float, float, float, float], tip: TipMotion
    ) -> tuple[float, float]:
        """Return what contact adds to (theta5'', theta6''), rad/s^2; zeros if there is none."""
        theta5, theta6, rate5, rate6 = sway
        s5, c5, s6, c6 = math.sin(theta5), math.cos(theta5), math.sin(theta6), math.cos(theta6)
        below = grapple.l2_m + self.reach_m
        l3 = grapple.l1_m + below * c6
        # The end against the tip, and by the angles: outwards, in slew direction, upwards.
        end = (-below * s6, l3 * s5, -l3 * c5)
        by5 = (0.0, l3 * c5, l3 * s5)
        by6 = (-below * c6, -below * s6 * s5, below * s6 * c5)
        height = tip.height_m + end[2]
        radius = tip.radius_m + end[0]
        slope, surface = self._surface(radius, end[1], tip.slew_rad)
        depth = surface - height
        if depth <= 0.0:
            return 0.0, 0.0
        turn = tip.slew_rate_rad_s
        speed = (
            tip.radius_rate_m_s - end[1] * turn + by5[0] * rate5 + by6[0] * rate6,
            radius * turn + by5[1] * rate5 + by6[1] * rate6,
            tip.height_rate_m_s + by5[2] * rate5 + by6[2] * rate6,
        )
        force = self._force(depth, slope, speed)
        inertia5 = (
            grapple.m1_kg * grapple.l1_m**2
            + grapple.m2_kg * (grapple.l1_m + grapple.l2_m * c6) ** 2
        )
        return (
            _dot(force, by5) / inertia5,
            _dot(force, by6) / (grapple.m2_kg * grapple.l2_m**2),
        )

    def _surface(
        self, outwards: float, across: float, slew_rad: float
    ) -> tuple[tuple[float, float], float]:
        """Return (slope outwards, in slew direction) and height (m) of the surface below a point.

        The point lies `outwards` from the pillar and `across` in slew direction, m.
        """
        if not self.pile_height_m:
            return (0.0, 0.0), self.ground_m
        # The middle of the pile, seen from the boom.
        away_r = outwards - self.pile_radius_m * math.cos(slew_rad)
        away_t = across + self.pile_radius_m * math.sin(slew_rad)
        away = math.hypot(away_r, away_t)
        if not 0.0 < away < self.pile_width_m:
            peak = self.pile_height_m if away == 0.0 else 0.0
            return (0.0, 0.0), self.ground_m + peak
        steep = -self.pile_height_m / self.pile_width_m
        height = self.ground_m + self.pile_height_m + steep * away
        return (steep * away_r / away, steep * away_t / away), height

    def _force(
        self, depth: float, slope: tuple[float, float], speed: tuple[float, float, float]
    ) -> tuple[float, float, float]:
        """Return the force in N on the grapple's end, `depth` m below the surface.

        Force and speed (m/s) are outwards, in slew direction and upwards.
        """
        long = math.hypot(slope[0], slope[1], 1.0)
        normal = (-slope[0] / long, -slope[1] / long, 1.0 / long)
        away = _dot(speed, normal)
        push = max(0.0, self.stiffness_n_m * depth / long - self.damping_n_s_m * away)
        slip = [one - away * n for one, n in zip(speed, normal, strict=True)]
        rub = self.friction * push / max(math.hypot(*slip), _STICKING_M_S)
        r, t, up = (push * n - rub * one for n, one in zip(normal, slip, strict=True))
        return r, t, up


def _dot(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
