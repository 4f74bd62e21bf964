"""A boom that bends: a spring in each coordinate of the tip ties the tip to the stiff boom.

The same equation holds for slew angle, radius and height; u is the lead of the tip over the
stiff boom:
    u'' + 2 zeta omega u' + omega^2 u = -(acceleration of the stiff boom)

The pull of the grapple on the boom is left out.
"""

import math
from dataclasses import dataclass

from canshaper_sim.grapple import TipMotion
from canshaper_sim.ranges import check_ranges

# name -> (lowest, highest) value.
_ALLOWED = {"frequency_hz": (0.0, 10.0), "damping_ratio": (0.0, 1.0)}


@dataclass(frozen=True, slots=True)
class BendParameters:
    """Frequency and damping with which the boom bends; by default the boom is stiff."""

    frequency_hz: float = 0.0  # 0: stiff; 2 to 3 is usual with the telescope out
    damping_ratio: float = 0.05

    def __post_init__(self) -> None:
        check_ranges("boom", self, _ALLOWED)


class Bend:
    """The bent boom in motion.

    Args:
        parameters: frequency and damping of the boom; the frequency is not 0.

    Attributes:
        slew, radius, height: (lead over the stiff boom, its rate) in this coordinate, rad and rad/s
            or m and m/s.
    """

    __slots__ = ("_damping", "_stiffness", "height", "radius", "slew")

    def __init__(self, parameters: BendParameters) -> None:
        omega = 2.0 * math.pi * parameters.frequency_hz
        self._stiffness, self._damping = omega * omega, 2.0 * parameters.damping_ratio * omega
        self.slew = self.radius = self.height = (0.0, 0.0)

    def advance(
        self, step_s: float, tips: tuple[TipMotion, TipMotion, TipMotion]
    ) -> tuple[TipMotion, TipMotion, TipMotion]:
        """Let step_s seconds pass; add the bend to the stiff boom's motion (start, middle, end)."""
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
        """Return (u, u', u'') at start, middle and end of a step, by two Runge-Kutta steps.

        The acceleration of the stiff boom is taken as the parabola through its three given values.
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
