"""The rotator, and how a log that is long or gripped off its middle changes the grapple's swing.

The log turns with the rotator; n is the horizontal direction of the log seen from the boom, and q
the tilt of the grapple outwards and in slew direction. The centre of the log, at distance e from
the line through the joints, pulls the grapple askew. The log's moment of inertia J counts in the
plane of the log only, so a swing that is neither along nor across the log wanders between the two
planes. By Lagrange for the rigid body, at small angles:

    M q'' + J n (n . q'') = M q''(of a point mass) - m e ((g + z'') n + l n'')

M: inertia about each joint, l: from there to the grapple, m: mass of the log, z: height of the tip.

The rotator holds the log in place and draws no oil from the pump. It turns 6 to 12 times a minute.
"""

import math
from dataclasses import dataclass, field

from canshaper_sim.actuator import Actuator
from canshaper_sim.grapple import Grapple, TipMotion
from canshaper_sim.log import LogParameters
from canshaper_sim.ranges import check_ranges
from canshaper_sim.valve import ValveParameters

# name -> (lowest, highest) value.
_ALLOWED = {"full_speed_rad_s": (0.1, 5.0), "start_deg": (-360.0, 360.0)}


@dataclass(frozen=True, slots=True)
class RotatorParameters:
    """The rotator; it matters only with a log that is long or gripped off its middle."""

    valve: ValveParameters = field(default_factory=ValveParameters)
    full_speed_rad_s: float = 1.0
    start_deg: float = 0.0  # from the boom to the log, counter-clockwise from above

    def __post_init__(self) -> None:
        check_ranges("rotator", self, _ALLOWED)


class Rotator:
    """The rotator in motion, at first without a log; ``axis`` is its angle from boom to log, rad.

    Args:
        parameters: valve, full speed and start angle of the rotator.
        log: the log that the grapple will grip.
    """

    __slots__ = ("_inertia", "_log", "_off_m", "axis")

    def __init__(self, parameters: RotatorParameters, log: LogParameters) -> None:
        start, full = math.radians(parameters.start_deg), parameters.full_speed_rad_s
        self.axis = Actuator(parameters.valve, full, start, -math.inf, math.inf)
        self._log, self._off_m, self._inertia = log, 0.0, 0.0

    def grip(self, loaded: Grapple) -> None:
        """Hold the log; `loaded` is the grapple with the log."""
        log, off = self._log, self._log.off_centre_m
        part = log.mass_kg / loaded.m2_kg
        self._off_m = off * part
        self._inertia = log.mass_kg * (log.length_m**2 / 12.0 + off * off * (1.0 - part))

    def lean(self, grapple: Grapple) -> tuple[float, float]:
        """Return the angles (theta5, theta6) in rad by which the log pulls the grapple askew."""
        pull = grapple.m2_kg * self._off_m
        down = grapple.m1_kg * grapple.l1_m + grapple.m2_kg * (grapple.l1_m + grapple.l2_m)
        askew = math.cos(self.axis.position) * self._off_m / grapple.l2_m
        return -pull * math.sin(self.axis.position) / down, askew

    def accelerations(
        self, grapple: Grapple, tip: TipMotion, free: tuple[float, float]
    ) -> tuple[float, float]:
        """Return (theta5'', theta6'') with the log, given `free`, those without it; rad/s^2."""
        n = math.cos(self.axis.position), math.sin(self.axis.position)
        m1, m2, l1, l2 = grapple.m1_kg, grapple.m2_kg, grapple.l1_m, grapple.l2_m
        lengths, inertias = (l2, l1 + l2), (m2 * l2**2, m1 * l1**2 + m2 * (l1 + l2) ** 2)
        turn = self.axis.speed + tip.slew_rate_rad_s
        faster = self.axis.end_acceleration + tip.slew_acceleration_rad_s2
        bent = (-faster * n[1] - turn * turn * n[0], faster * n[0] - turn * turn * n[1])  # n''
        weight, pull = grapple.g_m_s2 + tip.height_acceleration_m_s2, m2 * self._off_m
        out, across = (
            a - pull * (weight * n_i + length * bent_i) / inertia
            for a, n_i, bent_i, length, inertia in zip(
                (-free[1], free[0]), n, bent, lengths, inertias, strict=True
            )
        )
        held = 1.0 + self._inertia * (n[0] ** 2 / inertias[0] + n[1] ** 2 / inertias[1])
        moment = self._inertia * (n[0] * out + n[1] * across) / held
        return across - n[1] * moment / inertias[1], n[0] * moment / inertias[0] - out
