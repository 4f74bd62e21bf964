"""A sway sensor on the simulated grapple: noise, offset, delay, and its faults."""

import math
import random
from collections import deque
from dataclasses import dataclass
from typing import Final

from canshaper.config.inputs import Kind
from canshaper_sim.grapple import Sway
from canshaper_sim.ranges import check_ranges

_SAME_TIME_S: Final = 1e-9

# name -> (lowest, highest) value.
_ALLOWED = {
    "noise_deg": (0.0, 20.0),
    "offset_deg": (-90.0, 90.0),
    "delay_s": (0.0, 1.0),
    "gain": (-5.0, 5.0),
    "resolution_deg": (0.0, 10.0),
    "fusion_s": (0.0, 1000.0),
    "seed": (0.0, 1e9),
    "lost_s": (0.0, math.inf),
    "stuck_s": (0.0, math.inf),
    "reversed_s": (0.0, math.inf),
    "jump_s": (0.0, math.inf),
    "jump_deg": (-90.0, 90.0),
}


@dataclass(frozen=True, slots=True)
class SwaySensorParameters:
    """Errors of a sway sensor, in degrees; for a sensor of the rate, in degrees per second.

    Each fault begins at its time, in seconds from the start; by default never.
    """

    noise_deg: float = 0.1  # standard deviation
    offset_deg: float = 0.0
    delay_s: float = 0.02
    gain: float = 1.0  # -1: mounted the wrong way round
    resolution_deg: float = 0.0  # 0: that of the signal
    # Accelerations correct the gyro of an inclinometer with this time constant; 0: no gyro.
    fusion_s: float = 5.0
    seed: float = 1
    lost_s: float = math.inf  # no frame comes any more
    stuck_s: float = math.inf  # the same value for ever
    reversed_s: float = math.inf  # the sign turns
    jump_s: float = math.inf  # the offset changes by jump_deg
    jump_deg: float = 5.0

    def __post_init__(self) -> None:
        check_ranges("sway sensor", self, _ALLOWED)


class SwaySensor:
    """One sway sensor of one axis.

    Args:
        parameters: errors of the sensor.
        name: name of the sensor, which seeds its noise.
        across: the sensor measures across the boom or along the runway (theta5), else theta6.
        kind: the measured quantity: angle, rate, or inclination against the vertical.
    """

    def __init__(
        self,
        parameters: SwaySensorParameters,
        name: str,
        *,
        across: bool,
        kind: Kind,
    ) -> None:
        self._parameters, self._across, self._kind = parameters, across, kind
        self._hidden = 0.0  # part of the angle lost to the correction of a gyro
        self._noise = random.Random(f"{parameters.seed:g} {name}")
        self._past: deque[tuple[float, float]] = deque()
        self._stuck: float | None = None

    def swing(self, time_s: float, sway: Sway) -> None:
        """Take the sway of the grapple at time_s."""
        rate = self._kind == "rate"
        if self._across:
            swing = sway.theta5_rate_rad_s if rate else sway.theta5_rad
        else:
            swing = sway.theta6_rate_rad_s if rate else sway.theta6_rad
        past = self._past
        if self._kind == "inclination":
            swing = self._fused(swing, time_s - past[-1][0] if past else math.inf)
        if not past:  # assume the same swing before
            past.append((-math.inf, math.degrees(swing)))
        past.append((time_s, math.degrees(swing)))
        before_s = time_s - self._parameters.delay_s + _SAME_TIME_S
        while len(past) > 1 and past[1][0] <= before_s:
            past.popleft()

    def _fused(self, angle: float, passed_s: float) -> float:
        """Return a gyro's angle, rad, drawn to the 0 that accelerations show on a free pendulum."""
        fusion_s = self._parameters.fusion_s
        share = -math.expm1(-passed_s / fusion_s) if fusion_s else 1.0
        self._hidden += share * (angle - self._hidden)
        return angle - self._hidden

    def value(self, time_s: float) -> float:
        """Return the next measurement with its errors and faults, degrees or degrees per second."""
        p = self._parameters
        gain = -p.gain if time_s >= p.reversed_s else p.gain
        value = gain * self._past[0][1] + p.offset_deg + self._noise.gauss(0.0, p.noise_deg)
        if time_s >= p.jump_s:
            value += p.jump_deg
        if p.resolution_deg:
            value = p.resolution_deg * round(value / p.resolution_deg)
        if time_s >= p.stuck_s:
            value = self._stuck = value if self._stuck is None else self._stuck
        return value
