"""A log that the grapple grips during a drive, and the second swing of a long log.

Grapple and log are one body on one pendulum. A long log adds a second, linear swing, the same in
both planes. The tool's angle is 1 - ``share`` of the pendulum's angle plus the second swing, which
goes about ``share`` of the angle that the tip's acceleration and the wind lean a plumb line by.
"""

import math
from dataclasses import dataclass, replace

from canshaper_sim.grapple import Grapple, Push, Sway, TipMotion
from canshaper_sim.oscillator import moved, swing_over
from canshaper_sim.ranges import check_ranges

# name -> (lowest, highest) value.
_ALLOWED = {
    "grip_s": (0.0, math.inf),
    "mass_kg": (0.0, 10_000.0),
    "below_m": (-1.0, 5.0),
    "length_m": (0.0, 10.0),
    "off_centre_m": (-3.0, 3.0),
    "second_period_s": (0.0, 2.0),
    "second_share": (-1.0, 0.9),
    "second_damping_ratio": (0.0, 0.9),
}


@dataclass(frozen=True, slots=True)
class LogParameters:
    """A log, and the time when the grapple grips it: seconds from the start, by default never."""

    grip_s: float = math.inf
    mass_kg: float = 500.0
    below_m: float = 0.3  # from the grapple's centre of mass down to the log's
    # A length makes the planes of the swing differ, by the rotator; 0: a point.
    length_m: float = 0.0
    off_centre_m: float = 0.0  # from the grapple to the middle of the log
    second_period_s: float = 0.0  # 0: no second swing; 0.5 to 0.8 is usual with a long log
    second_share: float = -0.2  # part of the lean; a body that hangs below swings against it
    second_damping_ratio: float = 0.04

    def __post_init__(self) -> None:
        check_ranges("log", self, _ALLOWED)

    def gripped(self, time_s: float) -> bool:
        """Return whether the grapple has gripped the log by that time."""
        return time_s >= self.grip_s

    def loaded(self, grapple: Grapple) -> Grapple:
        """Return grapple and log as one body: summed mass at the common centre of mass."""
        mass = grapple.m2_kg + self.mass_kg
        return replace(grapple, m2_kg=mass, l2_m=grapple.l2_m + self.below_m * self.mass_kg / mass)


class SecondSwing:
    """The second swing of a long log in motion.

    Args:
        log: a log with a second period.
        gravity_m_s2: gravity at the crane.
        sway: sway of the pendulum when the log is gripped; the shown angle does not jump then.
    """

    __slots__ = ("_by", "_gravity_m_s2", "_omega", "_ratio", "_share", "_step_s", "across", "along")

    def __init__(self, log: LogParameters, gravity_m_s2: float, sway: Sway) -> None:
        self._ratio, self._share = log.second_damping_ratio, log.second_share
        self._omega = 2.0 * math.pi / log.second_period_s / math.sqrt(1.0 - self._ratio**2)
        self._gravity_m_s2 = gravity_m_s2
        share, self._step_s = self._share, 0.0
        self._by = (1.0, 0.0, 0.0, 1.0)
        self.across = share * sway.theta5_rad, share * sway.theta5_rate_rad_s
        self.along = share * sway.theta6_rad, share * sway.theta6_rate_rad_s

    def advance(
        self, step_s: float, tips: tuple[TipMotion, TipMotion, TipMotion], push: Push
    ) -> None:
        """Swing for step_s seconds under this push on the log and the tip's mean acceleration."""
        if step_s != self._step_s:
            self._step_s, self._by = step_s, swing_over(self._omega, self._ratio, step_s)
        start, middle, end = (_pulls(tip) for tip in tips)
        lean = self._share / (6.0 * self._gravity_m_s2)
        across = start[0] + 4.0 * middle[0] + end[0] - 6.0 * push[1]
        along = start[1] + 4.0 * middle[1] + end[1] - 6.0 * push[0]
        self.across = moved(self._by, self.across, -lean * across)
        self.along = moved(self._by, self.along, lean * along)

    def shown(self, sway: Sway) -> Sway:
        """Return the sway of the tool, given that of its pendulum."""
        rest, across, along = 1.0 - self._share, self.across, self.along
        return Sway(
            rest * sway.theta5_rad + across[0],
            rest * sway.theta6_rad + along[0],
            rest * sway.theta5_rate_rad_s + across[1],
            rest * sway.theta6_rate_rad_s + along[1],
        )


def _pulls(tip: TipMotion) -> tuple[float, float]:
    """Return the acceleration of the tip in slew direction and outwards, m/s^2."""
    radius, rate, slew_rate = tip.radius_m, tip.radius_rate_m_s, tip.slew_rate_rad_s
    tangential = radius * tip.slew_acceleration_rad_s2 + 2.0 * rate * slew_rate
    return tangential, tip.radius_acceleration_m_s2 - radius * slew_rate**2
