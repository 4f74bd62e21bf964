"""A boom that bends: tip and joints are tied by a spring in each coordinate of the tip.

Of slew angle, radius and height alike, u being what the tip is ahead of the stiff boom:

    u'' + 2 zeta omega u' + omega^2 u = -(acceleration of the stiff boom)

The grapple's pull on the boom is left out.
"""

import math
from dataclasses import dataclass

from canshaper_sim.grapple import TipMotion
from canshaper_sim.ranges import check_ranges

# name -> (lowest, highest) value.
_ALLOWED = {"frequency_hz": (0.0, 10.0), "damping_ratio": (0.0, 1.0)}


@dataclass(frozen=True, slots=True)
class BendParameters:
    """How the boom bends; by default it is stiff."""

    frequency_hz: float = 0.0  # 0: stiff; 2 to 3 is usual with the telescope out
    damping_ratio: float = 0.05

    def __post_init__(self) -> None:
        check_ranges("boom", self, _ALLOWED)


class Bend:
    """The bent boom in motion.

    Args:
        parameters: of a boom that is not stiff.

    Attributes:
        slew, radius, height: (u, u') of each, rad or m, per second.
    """

    __slots__ = ("_damping", "_stiffness", "height", "radius", "slew")

    def __init__(self, parameters: BendParameters) -> None:
        omega = 2.0 * math.pi * parameters.frequency_hz
        self._stiffness, self._damping = omega * omega, 2.0 * parameters.damping_ratio * omega
        self.slew = self.radius = self.height = (0.0, 0.0)

    def advance(
        self, step_s: float, tips: tuple[TipMotion, TipMotion, TipMotion]
    ) -> tuple[TipMotion, TipMotion, TipMotion]:
        """Bend on for step_s seconds: motion of the tip from that of the stiff boom."""
        slew = self._points(self.slew, [tip.slew_acceleration_rad_s2 for tip in tips], step_s)
        radius = self._points(self.radius, [tip.radius_acceleration_m_s2 for tip in tips], step_s)
        height = self._points(self.height, [tip.height_acceleration_m_s2 for tip in tips], step_s)
        self.slew, self.radius, self.height = slew[2][:2], radius[2][:2], height[2][:2]
        start, middle, end = (
            TipMotion(
                tip.radius_m + r[0],
                tip.radius_rate_m_s + r[1],
                tip.radius_acceleration_m_s2 + r[2],
                tip.slew_rate_rad_s + s[1],
                tip.slew_acceleration_rad_s2 + s[2],
                tip.height_acceleration_m_s2 + h[2],
                tip.slew_rad + s[0],
                tip.height_m + h[0],
                tip.height_rate_m_s + h[1],
            )
            for tip, s, r, h in zip(tips, slew, radius, height, strict=True)
        )
        return start, middle, end

    def _points(
        self, state: tuple[float, float], drive: list[float], step_s: float
    ) -> list[tuple[float, float, float]]:
        """(u, u', u'') at start, middle and end: two Runge-Kutta steps.

        The acceleration of the stiff boom is a parabola through the three that are given.
        """
        start, middle, end = drive
        quarter = (3.0 * start + 6.0 * middle - end) / 8.0
        late = (3.0 * end + 6.0 * middle - start) / 8.0
        first = self._step(state, (start, quarter, middle), 0.5 * step_s)
        last = self._step(first, (middle, late, end), 0.5 * step_s)
        states = zip((state, first, last), drive, strict=True)
        return [(u, rate, self._acceleration(u, rate, given)) for (u, rate), given in states]

    def _acceleration(self, u: float, rate: float, given: float) -> float:
        return -given - self._stiffness * u - self._damping * rate

    def _step(
        self, state: tuple[float, float], drive: tuple[float, float, float], h: float
    ) -> tuple[float, float]:
        (u, rate), (start, middle, end) = state, drive
        a = self._acceleration(u, rate, start)
        rate_b = rate + 0.5 * h * a
        b = self._acceleration(u + 0.5 * h * rate, rate_b, middle)
        rate_c = rate + 0.5 * h * b
        c = self._acceleration(u + 0.5 * h * rate_b, rate_c, middle)
        rate_d = rate + h * c
        d = self._acceleration(u + h * rate_c, rate_d, end)
        sixth = h / 6.0
        return (
            u + sixth * (rate + 2.0 * (rate_b + rate_c) + rate_d),
            rate + sixth * (a + 2.0 * (b + c) + d),
        )
