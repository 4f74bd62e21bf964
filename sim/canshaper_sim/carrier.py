"""The carrier under the crane: on a slope.

Everything of the crane is measured against its carrier. Seen from there gravity tilts, and turns
as the boom slews: the joints of the grapple do not rest at 0, and their rest angles change with the
slew angle. A forwarder works on slopes up to 15 degrees (27 %), along and across.
"""

import math
from dataclasses import dataclass

from canshaper_sim.grapple import Push
from canshaper_sim.ranges import check_ranges

# name -> (lowest, highest) value.
_ALLOWED = {"pitch_deg": (-15.0, 15.0), "roll_deg": (-15.0, 15.0)}


@dataclass(frozen=True, slots=True)
class CarrierParameters:
    """How the carrier stands; by default it is level."""

    pitch_deg: float = 0.0  # slope along it: positive is down ahead, where the slew angle is 0
    roll_deg: float = 0.0  # across it: positive is down to the right

    def __post_init__(self) -> None:
        check_ranges("carrier", self, _ALLOWED)

    @property
    def level(self) -> bool:
        """Whether nothing tilts."""
        return not (self.pitch_deg or self.roll_deg)


class Carrier:
    """The carrier in motion.

    Args:
        parameters: how it stands.
        gravity_m_s2: of the crane.
    """

    __slots__ = ("_gravity_m_s2", "pitch_rad", "roll_rad")

    def __init__(self, parameters: CarrierParameters, gravity_m_s2: float) -> None:
        self._gravity_m_s2 = gravity_m_s2
        self.pitch_rad = math.radians(parameters.pitch_deg)
        self.roll_rad = math.radians(parameters.roll_deg)

    def push(self, slew_rad: float) -> Push:
        """What a mass at the tip feels more than on a level carrier."""
        gravity, fall = self._gravity_m_s2, math.cos(self.pitch_rad)
        ahead = gravity * math.sin(self.pitch_rad)
        left = -gravity * fall * math.sin(self.roll_rad)
        up = gravity * (1.0 - fall * math.cos(self.roll_rad))
        s, c = math.sin(slew_rad), math.cos(slew_rad)
        return ahead * c + left * s, left * c - ahead * s, up
