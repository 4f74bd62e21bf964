"""Wind on the grapple: drag of a mean wind with gusts along its direction.

Gusts are noise behind a first-order filter, as the gusts along the wind in the model of Dryden
(MIL-F-8785C, low altitude). At 5 m above the ground their scale is 36 m and their standard
deviation a fifth of the mean: a wind of 6 m/s has gusts of 1.2 m/s and 6 s. The speed of the load
is neglected against that of the wind.
"""

import math
import random
from dataclasses import dataclass
from typing import Final

from canshaper_sim.grapple import Push
from canshaper_sim.ranges import check_ranges

AIR_KG_M3: Final = 1.225
# name -> (lowest, highest) value.
_ALLOWED = {
    "speed_m_s": (0.0, 20.0),
    "gust_m_s": (0.0, 6.0),
    "gust_s": (0.1, 60.0),
    "heading_deg": (-360.0, 360.0),
    "drag_m2": (0.0, 10.0),
    "seed": (0.0, 1e9),
}


@dataclass(frozen=True, slots=True)
class WindParameters:
    """Mean wind and gusts; by default there is no wind."""

    speed_m_s: float = 0.0  # mean
    gust_m_s: float = 0.0  # standard deviation; gusts reach twice to three times as much
    gust_s: float = 6.0  # time constant of the gusts
    heading_deg: float = 90.0  # direction it blows to, as the slew angle: 0 is ahead
    drag_m2: float = 0.6  # area times drag coefficient, 1 to 1.2; with a log of 5 m about 2
    seed: float = 1

    def __post_init__(self) -> None:
        check_ranges("wind", self, _ALLOWED)


class Wind:
    """The wind in time; it starts without a gust."""

    __slots__ = ("_gust_m_s", "_parameters", "_random", "force_n")

    def __init__(self, parameters: WindParameters) -> None:
        self._parameters, self._gust_m_s = parameters, 0.0
        self._random = random.Random(f"{parameters.seed:g} wind")
        self.advance(0.0)

    def advance(self, step_s: float) -> None:
        """Let the wind blow for step_s seconds."""
        p = self._parameters
        kept = math.exp(-step_s / p.gust_s)
        new = self._random.gauss(0.0, p.gust_m_s) * math.sqrt(1.0 - kept * kept)
        self._gust_m_s = kept * self._gust_m_s + new
        speed = p.speed_m_s + self._gust_m_s
        self.force_n = 0.5 * AIR_KG_M3 * p.drag_m2 * speed * abs(speed)

    def push(self, slew_rad: float, mass_kg: float) -> Push:
        """Return the force on what has this mass, N/kg: outwards, in slew direction, upwards."""
        angle = math.radians(self._parameters.heading_deg) - slew_rad
        push = self.force_n / mass_kg
        return push * math.cos(angle), push * math.sin(angle), 0.0
