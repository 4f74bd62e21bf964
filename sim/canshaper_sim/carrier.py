"""The carrier under the crane: on a slope, and rocking on its tyres.

Every coordinate of the crane is relative to its carrier. Seen from there gravity tilts, and turns
as the boom slews: the joints of the grapple do not rest at 0, and their rest angles change with the
slew angle. A forwarder works on slopes up to 15 degrees (27 %), along and across.

The tyres are a spring and a damper about each horizontal axis on the ground. Two loads lean the
carrier: the grapple pulls at the tip with its tension, and the boom, a mass halfway to the tip,
acts by its weight and its acceleration. Vehicles on large tyres without suspension roll and pitch
at 1 to 2 Hz with a tenth to a fifth of the critical damping (Pazooki et al., Mech. Syst. Signal
Process. 28, 2012). Rates of the rocking are too small to matter to the swing; its angles and
accelerations are not.
"""

import math
from dataclasses import dataclass
from operator import mul

from canshaper_sim.grapple import Grapple, Push, Sway, TipMotion
from canshaper_sim.oscillator import State, moved, swing_over
from canshaper_sim.ranges import check_ranges

# name -> (lowest, highest) value.
_ALLOWED = {
    "pitch_deg": (-15.0, 15.0),
    "roll_deg": (-15.0, 15.0),
    "rock_hz": (0.0, 5.0),
    "rock_damping": (0.0, 0.9),
    "roll_kg_m2": (5e3, 1e6),
    "pitch_kg_m2": (5e3, 1e6),
    "boom_kg": (0.0, 5e3),
}


@dataclass(frozen=True, slots=True)
class CarrierParameters:
    """Slope and rocking of the carrier, a vehicle of 15 t; by default it is level and stiff."""

    pitch_deg: float = 0.0  # slope along it: positive is down ahead, where the slew angle is 0
    roll_deg: float = 0.0  # across it: positive is down to the right
    rock_hz: float = 0.0  # frequency on its tyres; 0: stiff
    rock_damping: float = 0.15  # damping ratio
    roll_kg_m2: float = 4e4  # moments of inertia about the ground
    pitch_kg_m2: float = 1.2e5
    boom_kg: float = 600.0

    def __post_init__(self) -> None:
        check_ranges("carrier", self, _ALLOWED)

    @property
    def level(self) -> bool:
        """True if the carrier never tilts: it stands level and does not rock."""
        return not (self.pitch_deg or self.roll_deg or self.rock_hz)


class Carrier:
    """The carrier in motion.

    Args:
        parameters: slope and rocking of the carrier.
        gravity_m_s2: gravity at the crane.

    Attributes:
        roll, pitch: (angle, rate) of the rocking, without the slope; rad and rad/s.
    """

    __slots__ = ("_bends", "_gravity_m_s2", "_omega", "_parameters", "_slope", "pitch", "roll")

    def __init__(self, parameters: CarrierParameters, gravity_m_s2: float) -> None:
        self._parameters, self._gravity_m_s2 = parameters, gravity_m_s2
        self._slope = math.radians(parameters.roll_deg), math.radians(parameters.pitch_deg)
        self._omega = 2.0 * math.pi * parameters.rock_hz
        self.roll: State = (0.0, 0.0)
        self.pitch: State = (0.0, 0.0)
        self._bends = (0.0, 0.0, 0.0)  # roll'', pitch'', height of what hangs

    def settle(self, grapple: Grapple, sway: Sway, tip: TipMotion) -> None:
        """Lean a carrier that rocks to its equilibrium under grapple and boom, with no rate."""
        if self._omega:
            roll, pitch = self._leans(grapple, sway, tip)
            self.roll, self.pitch = (roll, 0.0), (pitch, 0.0)

    def advance(self, step_s: float, grapple: Grapple, sway: Sway, tip: TipMotion) -> None:
        """Rock for step_s seconds under the pull of grapple and boom; a stiff carrier does not."""
        if not self._omega:
            return
        omega, ratio = self._omega, self._parameters.rock_damping
        by = swing_over(omega, ratio, step_s)
        roll, pitch = self._leans(grapple, sway, tip)
        before = self.roll[1], self.pitch[1]
        self.roll, self.pitch = moved(by, self.roll, roll), moved(by, self.pitch, pitch)
        turned = (self.roll[1] - before[0]) / step_s, (self.pitch[1] - before[1]) / step_s
        self._bends = *turned, tip.height_m - grapple.l1_m - grapple.l2_m

    def push(self, slew_rad: float, radius_m: float) -> Push:
        """Return what tilt and rocking add to a weight, N/kg: outwards, in slew direction, up."""
        gravity = self._gravity_m_s2
        roll, pitch = self._slope[0] + self.roll[0], self._slope[1] + self.pitch[0]
        fall = math.cos(pitch)
        s, c = math.sin(slew_rad), math.cos(slew_rad)
        roll_2, pitch_2, height_m = self._bends
        ahead = gravity * math.sin(pitch) - height_m * pitch_2
        left = -gravity * fall * math.sin(roll) + height_m * roll_2
        up = gravity * (1.0 - fall * math.cos(roll)) - radius_m * (s * roll_2 - c * pitch_2)
        return ahead * c + left * s, left * c - ahead * s, up

    def _leans(self, grapple: Grapple, sway: Sway, tip: TipMotion) -> tuple[float, float]:
        """Return (roll, pitch) in rad at which the tyres balance the pull of grapple and boom."""
        p, gravity = self._parameters, self._gravity_m_s2
        s5, c5 = math.sin(sway.theta5_rad), math.cos(sway.theta5_rad)
        s6, c6 = math.sin(sway.theta6_rad), math.cos(sway.theta6_rad)
        line = -s6, s5 * c6, -c5 * c6  # from the tip to what hangs there
        radius, turn = tip.radius_m, tip.slew_rate_rad_s
        out = tip.radius_acceleration_m_s2 - radius * turn * turn
        across = radius * tip.slew_acceleration_rad_s2 + 2.0 * tip.radius_rate_m_s * turn
        push = self.push(tip.slew_rad, radius)
        felt = push[0] - out, push[1] - across, push[2] - tip.height_acceleration_m_s2 - gravity
        whirl = (sway.theta5_rate_rad_s * c6) ** 2 + sway.theta6_rate_rad_s**2
        tension = (grapple.l1_m + grapple.l2_m) * whirl + sum(map(mul, felt, line))
        tension *= grapple.m1_kg + grapple.m2_kg
        half = 0.5 * p.boom_kg
        out, across = tension * line[0] - half * out, tension * line[1] - half * across
        # About the boom, and about the horizontal across it.
        along = -tip.height_m * across
        over = tip.height_m * out + radius * (half * gravity - tension * line[2])
        s, c = math.sin(tip.slew_rad), math.cos(tip.slew_rad)
        stiff = self._omega * self._omega
        roll, pitch = along * c - over * s, along * s + over * c
        return roll / (p.roll_kg_m2 * stiff), pitch / (p.pitch_kg_m2 * stiff)
