"""What a sway sensor adds to the sway model: the swing that own motion does not explain.

A second sway model runs late, driven by what the valve made of the velocity at the time of the
measurement. What is measured beyond it is free swing (it was there before, the pendulum is longer,
the load was pushed), and the offset of the sensor:

    measured = late model + free swing + offset + noise

Free swing moves as a pendulum that nobody drives; three constant gains correct its angle, its rate
and the offset (steady-state Kalman filter). For the model, which runs ahead of the grapple by the
lag of the valve, it is predicted ahead by that lag and the age of the measurement.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from canshaper.shaping.sway import SwayMode, SwayModel, swing_over

# Process noise of a tick of 20 ms against a measurement noise of 1: of angle and rate, for the
# quickness below, and of the offset.
ANGLE_PER_RATE = 0.02
OFFSET_NOISE = 0.02
TICK_OF_NOISE_S = 0.02
# The lead that a two-axis motion makes ends with it; what is left by rounding goes with this time
# constant, and below so much (full speed, times seconds) there is none.
LEAD_S, NO_LEAD = 10.0, 1e-5
# Steps of the Riccati equation, at most: the gains are within a thousandth then, some 10 ms later.
MOST_STEPS = 5000


class Measured(Enum):
    """What a sensor measures."""

    ANGLE = "angle"
    RATE = "rate"


@dataclass(frozen=True, slots=True)
class SensorTiming:
    """When a sensor measures what.

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


class FreeSwing:
    """Free swing and offset of the sensor, corrected by measurements.

    Args:
        measured: angle or rate.
        gains: of angle, rate, offset.

    Attributes:
        angle, rate: of the free swing, rad and rad/s, at the time of the measurement.
        offset: of the sensor, in its unit.
    """

    __slots__ = ("_gains", "_rates", "angle", "offset", "rate")

    def __init__(self, measured: Measured, gains: tuple[float, float, float]) -> None:
        self._rates = measured is Measured.RATE
        self._gains = gains
        self.angle = self.rate = self.offset = 0.0

    def step(self, by: tuple[float, float, float, float]) -> None:
        """Swing on for a tick, in which an undriven swing changes by these."""
        angle, rate = self.angle, self.rate
        self.angle = angle + by[0] * angle + by[1] * rate
        self.rate = rate + by[2] * angle + by[3] * rate

    def error(self, unexplained: float) -> float:
        """What a measurement shows beyond what is known; ``unexplained`` by the late model."""
        return unexplained - (self.rate if self._rates else self.angle) - self.offset

    def correct(self, error: float) -> None:
        """Take over the error of a measurement."""
        angle, rate, offset = self._gains
        self.angle += angle * error
        self.rate += rate * error
        self.offset += offset * error

    def begin(self, unexplained: float) -> None:
        """The first measurement: all of it is swing."""
        self.angle = self.rate = 0.0
        if self._rates:
            self.rate = unexplained - self.offset
        else:
            self.angle = unexplained - self.offset


class Late:
    """A velocity as it was at the time of the measurement: delayed, and behind the valve's lag.

    Args:
        timing: delay and lag.
        tick_s: time between two ticks.

    Attributes:
        now: at the end of the tick.
        middle: in the middle of it.
    """

    __slots__ = ("_half", "_sent", "_share", "_whole", "middle", "now")

    def __init__(self, timing: SensorTiming, tick_s: float) -> None:
        ticks = timing.delay_s / tick_s
        whole = math.floor(ticks + 1e-9)
        self._sent = deque([0.0] * (whole + 2), maxlen=whole + 2)
        self._share = ticks - whole
        lag_s = timing.lag_s
        self._whole = -math.expm1(-tick_s / lag_s) if lag_s else 1.0
        self._half = -math.expm1(-0.5 * tick_s / lag_s) if lag_s else 1.0
        self.now = self.middle = 0.0

    def step(self, velocity: float) -> None:
        """Advance a tick in which ``velocity`` was sent."""
        sent = self._sent
        sent.append(velocity)
        held = sent[1] + self._share * (sent[0] - sent[1])
        now = self.now
        self.middle = now + self._half * (held - now)
        self.now = now + self._whole * (held - now)


class LateModel:
    """The sway as it was at the time of the measurement.

    What a motion of two axes adds makes no swing of the grapple, but the tip stands so much ahead
    of where it hangs: that is in the angle too.

    Args:
        sway: sway model of the axis.
        timing: delay and lag.
    """

    __slots__ = ("_added", "_lead", "_own", "sway")

    def __init__(self, sway: SwayModel, timing: SensorTiming) -> None:
        tick_s = sway.tick_s
        self.sway = SwayModel(sway.mode, tick_s)
        self._own, self._added = Late(timing, tick_s), Late(timing, tick_s)
        self._lead = 0.0

    def step(self, velocity: float, added: float) -> None:
        """Advance a tick in which ``velocity`` was sent for the axis itself, ``added`` besides."""
        own, tick_s = self._own, self.sway.tick_s
        own.step(velocity)
        self.sway.step(own.middle)
        late = self._added
        if added or self._lead or late.now:
            late.step(added)
            self._lead += tick_s * (late.middle - self._lead / LEAD_S)
            if not added and abs(self._lead) < NO_LEAD and abs(late.now) < NO_LEAD:
                self._lead = late.now = 0.0

    @property
    def angle(self) -> float:
        """Normalised angle, see ``SwayModel``."""
        return self.sway.angle + self._lead

    @property
    def rate(self) -> float:
        """Normalised rate of the angle."""
        return self.sway.rate + self._own.now + self._added.now

    def restart(self) -> None:
        """Begin with no swing."""
        self.sway.angle = self.sway.rate = self._lead = 0.0

    def retune(self, mode: SwayMode) -> None:
        """Go on with another mode at the same physical swing."""
        self.sway = self.sway.retuned(mode, self._own.now)


def steady_gains(
    swing: Sequence[float], tick_s: float, timing: SensorTiming
) -> tuple[float, float, float]:
    """Steady-state Kalman gains of angle, rate and offset.

    Args:
        swing: what an undriven swing changes by between two measurements, see ``swing_over``.
        tick_s: time between two of them.
        timing: of the sensor.
    """
    a, b, c, d = 1.0 + swing[0], swing[1], swing[2], 1.0 + swing[3]
    q, ticks = timing.quickness, tick_s / TICK_OF_NOISE_S
    noise = [(sd * sd) * ticks for sd in (ANGLE_PER_RATE * q, q, OFFSET_NOISE)]
    which = 1 if timing.measured is Measured.RATE else 0
    # Covariance: angle, rate and offset, upper triangle.
    aa, ar, ao, rr, ro, oo = 1.0, 0.0, 0.0, 1.0, 0.0, 1.0
    gains = (0.0, 0.0, 0.0)
    for _ in range(MOST_STEPS):
        aa, ar, rr = (
            a * a * aa + 2.0 * a * b * ar + b * b * rr + noise[0],
            a * c * aa + (a * d + b * c) * ar + b * d * rr,
            c * c * aa + 2.0 * c * d * ar + d * d * rr + noise[1],
        )
        ao, ro, oo = a * ao + b * ro, c * ao + d * ro, oo + noise[2]
        # Seen is angle or rate, and the offset.
        seen = (ar + ao, rr + ro, ro + oo) if which else (aa + ao, ar + ro, ao + oo)
        spread = seen[which] + seen[2] + 1.0
        before, gains = gains, (seen[0] / spread, seen[1] / spread, seen[2] / spread)
        aa, ar, ao = aa - gains[0] * seen[0], ar - gains[0] * seen[1], ao - gains[0] * seen[2]
        rr, ro, oo = rr - gains[1] * seen[1], ro - gains[1] * seen[2], oo - gains[2] * seen[2]
        if max(abs(new - old) for new, old in zip(gains, before, strict=True)) < 1e-9:
            break
    return gains


class SwayObserver:
    """Late model and free swing of one axis, under three ideas of what the sensor shows.

    Args:
        sway: sway model of the axis.
        timing: of the sensor.

    Attributes:
        late: the late model.
        free: free swing, if the sensor shows this axis.
        negated: the same, if it shows the opposite.
        alone: what it shows, if that is no swing at all, only smooth.
    """

    __slots__ = (
        "_ahead",
        "_ahead_s",
        "_bend",
        "_by",
        "_rates",
        "_straight",
        "alone",
        "free",
        "late",
        "negated",
    )

    def __init__(self, sway: SwayModel, timing: SensorTiming) -> None:
        self._rates = timing.measured is Measured.RATE
        self._ahead_s = timing.lag_s + timing.delay_s
        self.late = LateModel(sway, timing)
        self._set_mode(sway)
        period_s = max(1, round(timing.period_s / sway.tick_s)) * sway.tick_s
        gains = steady_gains(swing_over(sway.mode, period_s), period_s, timing)
        self.free, self.negated = (FreeSwing(timing.measured, gains) for _ in range(2))
        self.alone = FreeSwing(timing.measured, (*gains[:2], 0.0))
        self._bend = gains[1] / period_s
        self._straight = (0.0, sway.tick_s, 0.0, 0.0)

    def _set_mode(self, sway: SwayModel) -> None:
        self._by = (sway.f11, sway.f12, sway.f21, sway.f22)
        self._ahead = swing_over(sway.mode, self._ahead_s)

    def retune(self, sway: SwayModel) -> None:
        """Go on with the mode of another model of the axis; the gains stay."""
        self.late.retune(sway.mode)
        self._set_mode(sway)

    def restart(self) -> None:
        """The model of the axis has started again: so does the late one."""
        self.late.restart()

    def begin(self, value: float, scale: float) -> None:
        """The first measurement, see ``errors``."""
        own = self.own(scale)
        self.free.begin(value - own)
        self.negated.begin(-value - own)
        self.alone.begin(value)

    def errors(self, value: float, scale: float) -> tuple[float, float, float]:
        """What a measurement shows beyond what was expected, under each of the three ideas.

        Args:
            value: the measurement, rad or rad/s.
            scale: rad per normalised angle of the model.
        """
        own = self.own(scale)
        return (
            self.free.error(value - own),
            self.negated.error(-value - own),
            self.alone.error(value),
        )

    def acceleration(self, error: float) -> float:
        """What a lasting error bends the free swing by, rad/s^2."""
        return error * self._bend

    def correct(self, errors: tuple[float, float, float]) -> None:
        """Take over the errors of a measurement."""
        self.free.correct(errors[0])
        self.negated.correct(errors[1])
        self.alone.correct(errors[2])

    def own(self, scale: float) -> float:
        """What the sensor would show if own motion were all."""
        return scale * (self.late.rate if self._rates else self.late.angle)

    def step(self, velocity: float, added: float) -> None:
        """Advance a tick in which ``velocity`` was sent, and ``added`` by a two-axis motion."""
        by = self._by
        self.late.step(velocity, added)
        self.free.step(by)
        self.negated.step(by)
        self.alone.step(self._straight)

    def swing(self, free: FreeSwing) -> None:
        """Let another free swing swing on for a tick."""
        free.step(self._by)

    def ahead(self, free: FreeSwing) -> tuple[float, float]:
        """A free swing when the model's state is the grapple's: angle, rate; rad, rad/s."""
        by, angle, rate = self._ahead, free.angle, free.rate
        return angle + by[0] * angle + by[1] * rate, rate + by[2] * angle + by[3] * rate
