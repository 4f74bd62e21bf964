"""A tower crane: slew, trolley and hoist; a load that hangs from a rope below a turning jib.

The rope is that of ``overhead``. The trolley turns about the pillar. At distance R from the pillar
and slew angle phi its accelerations outwards and in slew direction are:

    a_r = R'' - R phi'^2        a_t = R phi'' + 2 R' phi'
"""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from canshaper_sim.actuator import Actuator, EndParameters
from canshaper_sim.axes import HOIST, LIFT, SLEW
from canshaper_sim.grapple import TipMotion
from canshaper_sim.overhead import OverheadBoom, RopeParameters, drive
from canshaper_sim.sling import Vector
from canshaper_sim.tip_boom import CraneBoom, TipBoom
from canshaper_sim.valve import ValveParameters

if TYPE_CHECKING:
    from canshaper_sim.grapple import Sway

# name -> (lowest, highest) value that still describes a tower crane.
_ALLOWED = {
    "slew_full_speed_rad_s": (0.005, 1.0),
    "near_far_full_speed_m_s": (0.05, 5.0),
    "radius_min_m": (0.5, 120.0),
    "radius_max_m": (0.5, 120.0),
    "jib_m": (1.0, 500.0),
}


@dataclass(frozen=True, slots=True)
class TowerParameters(RopeParameters):
    """Drives, full speeds and ranges of one tower crane, its rope and its start pose."""

    slew: ValveParameters = field(default_factory=drive)
    near_far: ValveParameters = field(default_factory=drive)  # the trolley
    slew_full_speed_rad_s: float = 0.07
    near_far_full_speed_m_s: float = 1.0
    hoist_full_speed_m_s: float = 1.0
    radius_min_m: float = 3.0
    radius_max_m: float = 65.0
    start_radius_m: float = 35.0
    jib_m: float = 70.0  # height of the trolley above the ground
    rope_m: float = 30.0
    rope_min_m: float = 4.0
    rope_max_m: float = 62.0

    def __post_init__(self) -> None:
        reach = {"start_radius_m": (self.radius_min_m, self.radius_max_m)}
        self.check("tower", _ALLOWED | reach)

    def boom(self, ends: EndParameters) -> "RopedBoom":
        """Return jib, trolley and rope in the start pose."""
        reach = self.start_radius_m, self.radius_min_m, self.radius_max_m
        height = self.jib_m, self.jib_m, self.jib_m
        jib = TipBoom(
            Actuator(self.slew, self.slew_full_speed_rad_s, 0.0, -math.inf, math.inf, ends=ends),
            Actuator(self.near_far, self.near_far_full_speed_m_s, *reach, ends=ends),
            Actuator(drive(), 1.0, *height),  # the jib has no drive for its height
        )
        return RopedBoom(jib, LIFT, self, ends)


class RopedBoom(OverheadBoom):
    """A boom with a rope at its tip, and the load on it.

    Args:
        carrier: the boom that carries the rope.
        fixed: axis of this boom that no command moves.
        parameters: hoist and rope.
        ends: end stops of the hoist.
    """

    def __init__(
        self,
        carrier: CraneBoom,
        fixed: str,
        parameters: RopeParameters,
        ends: EndParameters,
    ) -> None:
        axes = {name: axis for name, axis in carrier.axes.items() if name != fixed}
        super().__init__({**axes, HOIST: parameters.winch(ends)}, parameters)
        self.carrier = carrier

    def swing(self, sway: "Sway") -> None:
        """Hang the load at theta5 in slew direction, theta6 inwards; rates are ignored."""
        inwards = math.sin(sway.theta6_rad)
        across = math.cos(sway.theta6_rad) * math.sin(sway.theta5_rad)
        down = math.sqrt(1.0 - inwards * inwards - across * across)
        cosine, sine = self._heading
        out, across, down = (self.rope_m * part for part in (-inwards, across, down))
        self.load = (out * cosine - across * sine, out * sine + across * cosine, -down)

    @property
    def angles(self) -> tuple[float, float, float, float]:
        """Angles (rad), then rates (rad/s): theta5 in slew direction, theta6 inwards."""
        (x, y, z), (vx, vy, vz) = self.load, self.rate
        cosine, sine = self._heading
        turn = self.axes[SLEW].speed
        out, across = x * cosine + y * sine, y * cosine - x * sine
        out_rate = vx * cosine + vy * sine + turn * across
        across_rate = vy * cosine - vx * sine - turn * out
        plane_2 = across * across + z * z
        plane = math.sqrt(plane_2)
        return (
            math.atan2(across, -z),
            math.atan2(-out, plane),
            (across * vz - z * across_rate) / plane_2,
            (out * (across * across_rate + z * vz) / plane - plane * out_rate)
            / (out * out + plane_2),
        )

    @property
    def _heading(self) -> tuple[float, float]:
        slew = self.axes[SLEW].position
        return math.cos(slew), math.sin(slew)

    @property
    def pose(self) -> tuple[float, float, float, float, float, float]:
        """Slew angle, radius and height of the rope's upper end, then rates; rad, m, per second."""
        return self.carrier.pose

    def advance(self, step_s: float) -> None:
        """Move boom, rope and load on by step_s seconds."""
        self._hang(step_s, *map(_acceleration, self.carrier.advance(step_s)))


def _acceleration(tip: TipMotion) -> Vector:
    turn, cosine, sine = tip.slew_rate_rad_s, math.cos(tip.slew_rad), math.sin(tip.slew_rad)
    out = tip.radius_acceleration_m_s2 - tip.radius_m * turn * turn
    across = tip.radius_m * tip.slew_acceleration_rad_s2 + 2.0 * tip.radius_rate_m_s * turn
    return out * cosine - across * sine, out * sine + across * cosine, tip.height_acceleration_m_s2
