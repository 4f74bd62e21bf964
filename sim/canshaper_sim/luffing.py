"""A telehandler or truck crane: slew, luffing, telescope and hoist; a load on a rope at the tip.

The boom is that of ``joints``, held straight. The winch is at the tip, or follows the telescope:
the hoist alone sets the length of the rope below the tip.
"""

import math
from dataclasses import dataclass, field

from canshaper_sim.actuator import EndParameters
from canshaper_sim.axes import KNUCKLE
from canshaper_sim.joints import JointBoom, JointParameters
from canshaper_sim.overhead import RopeParameters
from canshaper_sim.tower import RopedBoom
from canshaper_sim.valve import ValveParameters

# name -> (lowest, highest) value that still describes such a crane; its boom is checked by joints.
_ALLOWED = {
    "slew_full_speed_rad_s": (0.01, 1.0),
    "boom_m": (2.0, 40.0),
    "start_luff_deg": (-20.0, 80.0),
}


@dataclass(frozen=True, slots=True)
class LuffingParameters(RopeParameters):
    """Valves, full speeds and ranges of one luffing crane, its rope and its start pose."""

    slew: ValveParameters = field(default_factory=ValveParameters)
    lift_cylinder: ValveParameters = field(default_factory=ValveParameters)
    extension: ValveParameters = field(default_factory=ValveParameters)
    hoist: ValveParameters = field(default_factory=ValveParameters)
    slew_full_speed_rad_s: float = 0.1
    lift_cylinder_full_speed_rad_s: float = 0.05
    extension_full_speed_m_s: float = 0.5
    hoist_full_speed_m_s: float = 0.8
    pillar_m: float = 2.5
    boom_m: float = 10.0  # telescope in
    extension_max_m: float = 12.0
    start_extension_m: float = 4.0
    start_luff_deg: float = 45.0
    rope_min_m: float = 2.0
    rope_max_m: float = 20.0

    def __post_init__(self) -> None:
        self.check("luffing", _ALLOWED)

    def boom(self, ends: EndParameters) -> RopedBoom:
        """Return boom and rope in the start pose."""
        joints = JointParameters(
            lift_cylinder=self.lift_cylinder,
            extension=self.extension,
            pillar_m=self.pillar_m,
            main_boom_m=0.5 * self.boom_m,
            outer_boom_m=0.5 * self.boom_m,
            extension_max_m=self.extension_max_m,
            start_extension_m=self.start_extension_m,
            lift_cylinder_full_speed_rad_s=self.lift_cylinder_full_speed_rad_s,
            extension_full_speed_m_s=self.extension_full_speed_m_s,
        )
        # All but straight: farther out there is no way to reach it.
        angles = math.radians(self.start_luff_deg), math.radians(-0.1)
        tip = joints.boom.tip(*angles, self.start_extension_m)
        boom = JointBoom(joints, self.slew, self.slew_full_speed_rad_s, (0.0, *tip), ends)
        return RopedBoom(boom, KNUCKLE, self, ends)
