"""Sway sensor: measured quantity, timing and limits."""

from dataclasses import dataclass
from enum import Enum

from canshaper.shaping.sway import SwayMode

# Noise of observer and trust is given for ticks of this length.
TICK_OF_NOISE_S = 0.02


class Measured(Enum):
    """Quantity that a sensor measures."""

    ANGLE = "angle"
    RATE = "rate"


@dataclass(frozen=True, slots=True)
class SensorTiming:
    """Quantity and timing of a sensor's measurements.

    Attributes:
        measured: angle or rate.
        period_s: time between two measurements.
        delay_s: age of a measurement when it is received.
        lag_s: time constant of the valve: from what is sent to the speed of the tip.
        lost_s: time without a measurement after which it is lost.
        quickness: process noise of the rate over a tick, against a measurement noise of 1.
    """

    measured: Measured
    period_s: float
    delay_s: float
    lag_s: float
    lost_s: float
    quickness: float = 1.0


@dataclass(frozen=True, slots=True)
class SensorLimits:
    """Limits of a sensor's measurements, and of the pendulum that they show.

    Attributes:
        noise: standard deviation, rad or rad/s.
        offset: largest offset, rad or rad/s.
        length_range: how much longer the pendulum may be than in the file, part of that, and how
            many times shorter.
        second: second mode that it shows too, such as that of long logs.
    """

    noise: float
    offset: float
    length_range: float = 0.6
    second: SwayMode | None = None
