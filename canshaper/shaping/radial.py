"""Radial compensation while slewing: the tip moves in a little, so the grapple does not fly out.

The tip stands ahead of the grapple by the angle psi and at the radius rho h (small swing angles;
w5, w6: sway modes of slew and near-far; docs/decisions/0004-radial-compensation.md)

    tan psi = L / s5        h = (s5 s6 + L^2 w5^2 / w6^2) / sqrt(s5^2 + L^2) + (2 zeta6 / w6) D'
    s5 = 1 - w^2 / w5^2     s6 = 1 - w^2 / w6^2       D' = 2 (w w' - w5^2 L L') / w6^2

with L = w' / w5^2, damping included: the lead that the filter of the slew axis makes by itself. D'
is the speed at which the tip has to go inwards, which the damping of the joint answers. So the
near-far axis is given, beside what its operator asks, the change of rho h over the tick, and the
slew axis the speed of psi - L. All is known from the sway model of the slew axis: w = -rate,
L = angle, L' = rate + v, w' = w5^2 L + 2 zeta5 w5 L', each times full slew speed.
"""

import math

from canshaper.shaping.sway import SwayMode, SwayModel

# Largest w^2 / omega^2; beyond it the small angles are none.
_LARGEST_Q = 0.5


class RadialCompensation:
    """What to add to the near-far and slew commands.

    Args:
        near_far: sway mode of the near-far axis.
        slew_full_speed_rad_s: angular speed at full slew command.
        near_far_full_speed_m_s: speed of the tip at full near-far command.
        largest: limit of either added velocity.
    """

    __slots__ = ("_damping_s", "_largest", "_omega_2", "_slew_speed", "_speed")

    def __init__(
        self,
        near_far: SwayMode,
        slew_full_speed_rad_s: float,
        near_far_full_speed_m_s: float,
        largest: float,
    ) -> None:
        self._omega_2 = near_far.omega_rad_s**2
        self._damping_s = 2.0 * near_far.damping_ratio / near_far.omega_rad_s
        self._slew_speed = slew_full_speed_rad_s
        self._speed = near_far_full_speed_m_s
        self._largest = largest

    def tip_share(self, slew: SwayModel, slew_velocity: float) -> float:
        """Radius of the tip as a part of the grapple's, h.

        Args:
            slew: sway model of the slew axis.
            slew_velocity: what the model was told in its last step, [-1, 1].
        """
        omega_2 = slew.mode.omega_rad_s * slew.mode.omega_rad_s
        speed, acceleration, lead, lead_rate = self._motion(slew, slew_velocity)
        along, across = _less(speed, self._omega_2), _less(speed, omega_2)
        inwards = across * along + lead * lead * omega_2 / self._omega_2
        inward_rate = 2.0 * (speed * acceleration - omega_2 * lead * lead_rate) / self._omega_2
        return inwards / math.hypot(across, lead) + self._damping_s * inward_rate

    def near_far(self, before: float, now: float, circle_m: float, tick_s: float) -> float:
        """Velocity to add to near-far over a tick, fraction of its full speed.

        Args:
            before: ``tip_share`` at the start of the tick.
            now: ``tip_share`` at its end: the slew axis goes first.
            circle_m: radius on which the grapple runs.
            tick_s: the tick.
        """
        return self._limited(circle_m * (now - before) / (tick_s * self._speed))

    def slew(self, slew: SwayModel, slew_velocity: float) -> float:
        """Velocity to add to slew, fraction of its full speed.

        Args:
            slew: sway model of the slew axis.
            slew_velocity: what the model was told in its last step, [-1, 1].
        """
        speed, acceleration, lead, lead_rate = self._motion(slew, slew_velocity)
        omega_2 = slew.mode.omega_rad_s * slew.mode.omega_rad_s
        across = _less(speed, omega_2)
        across_rate = -2.0 * speed * acceleration / omega_2
        psi_rate = (lead_rate * across - lead * across_rate) / (across * across + lead * lead)
        return self._limited((psi_rate - lead_rate) / self._slew_speed)

    def _motion(self, slew: SwayModel, velocity: float) -> tuple[float, float, float, float]:
        """Speed and acceleration of the grapple on its circle, lead of the tip and its rate."""
        full, omega = self._slew_speed, slew.mode.omega_rad_s
        lead, lead_rate = slew.angle * full, (slew.rate + velocity) * full
        acceleration = omega * omega * lead + 2.0 * slew.mode.damping_ratio * omega * lead_rate
        return -slew.rate * full, acceleration, lead, lead_rate

    def _limited(self, added: float) -> float:
        if not math.isfinite(added):
            return 0.0
        return min(max(added, -self._largest), self._largest)


def _less(speed: float, omega_2: float) -> float:
    """1 - w^2 / omega^2."""
    return 1.0 - min(speed * speed / omega_2, _LARGEST_Q)  # ** would raise on overflow
