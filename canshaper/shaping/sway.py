"""Sway mode of the hanging tool and its exact sampled model.

The grapple hangs on a free joint. For one axis, linearised about rest (paper Eq. 11-12,
corrected), with a the acceleration of the tip,

    theta'' + 2 zeta omega theta' + omega^2 theta = (omega^2 / g) a

up to a sign that depends on the axis and that no filter needs. For any pendulum of this kind,
also for the two-link one, the input gain is omega^2 / g, so period and damping say everything.
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Self

GRAVITY_M_S2 = 9.81
SLOWEST_RAD_S, FASTEST_RAD_S = 0.25, 50.0


def _require(name: str, value: float, low: float, high: float, unit: str) -> float:
    """Return ``value`` when it is finite and within [low, high]; ValueError otherwise."""
    if not (math.isfinite(value) and low <= value <= high):
        expected, got = f"{low:g} to {high:g} {unit}".strip(), f"{value:g} {unit}".strip()
        raise ValueError(f"{name}: expected {expected}, got {got}")
    return value


def _omega_rad_s(period_s: float, damping_ratio: float) -> float:
    """Return the undamped natural frequency of a swing with this damped period."""
    return 2.0 * math.pi / (period_s * math.sqrt(1.0 - damping_ratio**2))


@dataclass(frozen=True, slots=True)
class SwayMode:
    """Undamped natural frequency and damping ratio of one axis' sway.

    Attributes:
        omega_rad_s: undamped natural frequency, 0.25 to 50 rad/s (length about 157 m to 4 mm).
        damping_ratio: 0 (swings for ever) to 0.95.

    Raises:
        ValueError: a value is outside its range; the message names value and range.
    """

    omega_rad_s: float
    damping_ratio: float

    def __post_init__(self) -> None:
        _require("natural frequency", self.omega_rad_s, SLOWEST_RAD_S, FASTEST_RAD_S, "rad/s")
        _require("damping ratio", self.damping_ratio, 0.0, 0.95, "")

    @classmethod
    def from_grapple(cls, length_m: float, damping_nms: float, mass_kg: float) -> Self:
        """Return the mode of a grapple: omega^2 = g/l, 2 zeta omega = c/(m l^2) (Eq. 12-13)."""
        _require("pendulum length", length_m, 0.05, 150.0, "m")
        _require("joint damping", damping_nms, 0.0, 1e6, "N m s/rad")
        _require("mass", mass_kg, 1.0, 1e5, "kg")
        omega = math.sqrt(GRAVITY_M_S2 / length_m)
        return cls(omega, damping_nms / (mass_kg * length_m**2) / (2.0 * omega))

    @classmethod
    def from_length(cls, length_m: float, damping_ratio: float) -> Self:
        """Return the mode of a load on a rope: omega^2 = g/l."""
        _require("pendulum length", length_m, 0.05, 150.0, "m")
        return cls(math.sqrt(GRAVITY_M_S2 / length_m), damping_ratio)

    @classmethod
    def from_period(cls, period_s: float, damping_ratio: float) -> Self:
        """Return the mode by the period of the damped swing (as on a stopwatch) and its damping."""
        _require("period", period_s, 0.15, 25.0, "s")
        _require("damping ratio", damping_ratio, 0.0, 0.95, "")
        return cls(_omega_rad_s(period_s, damping_ratio), damping_ratio)

    @classmethod
    def from_decay(cls, period_s: float, decay_per_swing: float) -> Self:
        """Return the mode by period and decay: the fraction of amplitude lost over a full swing.

        0.2 says that each swing is 20 % smaller than the one before. The logarithmic decrement
        d = -ln(1 - decay) gives zeta = d / sqrt(4 pi^2 + d^2).
        """
        _require("decay per swing", decay_per_swing, 0.0, 0.99, "")
        decrement = -math.log1p(-decay_per_swing)
        return cls.from_period(period_s, decrement / math.hypot(2.0 * math.pi, decrement))

    def towards(self, other: "SwayMode", share: float) -> "SwayMode":
        """Return a mode between this one and another; it never raises.

        Period and damping ratio are interpolated linearly. Where both dampings differ much, the
        result may be slower than a mode can be; it is then the slowest mode.

        Args:
            other: the other mode.
            share: part of the way to it, 0 to 1.
        """
        period_s = self.period_s + share * (other.period_s - self.period_s)
        ratio = self.damping_ratio + share * (other.damping_ratio - self.damping_ratio)
        # Not from_period: its range is for a stopwatch. A mode of length and mass may
        # have a longer period, and 25 s may have become a little more by rounding.
        omega = _omega_rad_s(period_s, ratio)
        return SwayMode(min(max(omega, SLOWEST_RAD_S), FASTEST_RAD_S), ratio)

    @property
    def pole(self) -> complex:
        """Upper one of the two sway poles, rad/s."""
        zeta = self.damping_ratio
        return self.omega_rad_s * complex(-zeta, math.sqrt(1.0 - zeta**2))

    @property
    def period_s(self) -> float:
        """Period of the damped swing, s."""
        return 2.0 * math.pi / self.pole.imag

    @property
    def angle_per_speed_rad(self) -> float:
        """Swing angle (rad) per normalised angle (``SwayModel.angle``) and m/s of full speed."""
        return self.omega_rad_s**2 / GRAVITY_M_S2


def swing_over(mode: SwayMode, time_s: float) -> tuple[float, float, float, float]:
    """Return the change of an undriven swing over a time: F = Ad - I of (angle, rate), by rows."""
    pole = mode.pole
    decay = math.exp(pole.real * time_s)
    sine = decay * math.sin(pole.imag * time_s) / pole.imag
    # decay * cos(wd T) - 1 without cancellation
    cosine_1 = (
        math.expm1(pole.real * time_s) - 2.0 * decay * math.sin(0.5 * pole.imag * time_s) ** 2
    )
    return (
        cosine_1 - pole.real * sine,
        sine,
        -(mode.omega_rad_s**2) * sine,
        cosine_1 + pole.real * sine,
    )


class SwayModel:
    """Exactly sampled sway of one axis, driven by the velocity that is really sent.

    State (normalised to the axis' full speed V in m/s and to the gain k = omega^2/g):

        angle = theta / (k V)            s
        rate  = theta' / (k V) - v       1        v: velocity in [-1, 1], held over the tick

    One step is x += F (angle, rate + v) with F = Ad - I: docs/decisions.md#sway-in-increments.

    Attributes:
        free_angle: swing that the velocity does not explain, as a sensor shows it; 0 without a
            sensor. It is no part of the model: filters add it where they feed the swing back.
        free_rate: rate of that swing.

    Raises:
        ValueError: the tick is outside 0.1 to 200 ms, or too long for the mode.
    """

    __slots__ = (
        "angle",
        "f11",
        "f12",
        "f21",
        "f22",
        "free_angle",
        "free_rate",
        "mode",
        "rate",
        "tick_s",
    )

    def __init__(self, mode: SwayMode, tick_s: float) -> None:
        self.mode = mode
        self.tick_s = _require("tick", tick_s, 1e-4, 0.2, "s")
        # Six samples to a swing; near two, f12 vanishes and with it every feedback from the model.
        name = f"natural frequency at a tick of {tick_s:g} s"
        _require(name, mode.omega_rad_s, 0.0, 1.0 / tick_s, "rad/s")
        self.angle = self.free_angle = 0.0
        self.rate = self.free_rate = 0.0
        self.f11, self.f12, self.f21, self.f22 = swing_over(mode, tick_s)

    def step(self, velocity: float) -> None:
        """Advance one tick in which ``velocity`` in [-1, 1] was held."""
        angle = self.angle
        swing = self.rate + velocity
        self.angle = angle + self.f11 * angle + self.f12 * swing
        self.rate += self.f21 * angle + self.f22 * swing

    def retuned(self, mode: SwayMode, velocity: float) -> "SwayModel":
        """Return a model with another mode at the same physical angle and rate.

        Args:
            mode: the new sway mode.
            velocity: the velocity being sent now, [-1, 1] (part of the normalised rate).

        Raises:
            ValueError: the mode does not suit the tick.
        """
        model = SwayModel(mode, self.tick_s)
        scale = self.mode.angle_per_speed_rad / mode.angle_per_speed_rad
        model.angle = self.angle * scale
        model.rate = (self.rate + velocity) * scale - velocity
        model.free_angle, model.free_rate = self.free_angle * scale, self.free_rate * scale
        return model

    def follow(self, mode: SwayMode) -> None:
        """Continue with the mode of a rope that is being hoisted or lowered.

        The state stays as it is. For a load on a rope the state is its distance from the trolley
        and its speed, V angle = l theta and V (rate + v) = (l theta)'. The length enters only their
        acceleration, (l theta)'' = a - (g - l'') theta, so the state includes the term 2 l' theta'
        of the angle.

        Raises:
            ValueError: the mode does not suit the tick.
        """
        name = f"natural frequency at a tick of {self.tick_s:g} s"
        _require(name, mode.omega_rad_s, 0.0, 1.0 / self.tick_s, "rad/s")
        self.mode = mode
        self.f11, self.f12, self.f21, self.f22 = swing_over(mode, self.tick_s)

    def sway_rad(self, full_speed_m_s: float) -> float:
        """Predicted swing angle, rad, for an axis whose full speed is ``full_speed_m_s``."""
        return self.angle * self.mode.angle_per_speed_rad * full_speed_m_s


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
        period_s: time between two measurements, seconds.
        delay_s: age of a measurement when it is received, seconds.
        lag_s: time constant from the sent velocity to the speed of the tip, seconds.
        lost_s: time without a measurement after which the sensor is lost, seconds.
        quickness: process noise of the rate over 20 ms, against a measurement noise of 1.
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
        length_range: permitted difference of the pendulum's length, part of the length in the file:
            1 + ``length_range`` times longer, or shorter.
        second: second mode that the sensor shows too, such as that of long logs; or None.
    """

    noise: float
    offset: float
    length_range: float = 0.6
    second: SwayMode | None = None
