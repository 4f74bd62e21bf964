"""Sway observer: the swing that a sensor shows and own motion does not explain.

A second sway model runs late, driven by what the valve made of the velocity at the time of the
measurement. What is measured beyond it is free swing (it was there before, the pendulum is longer,
the load was pushed), and the offset of the sensor:

    measured = late model + free swing + offset + noise

Free swing moves as a pendulum that is not driven; a Kalman filter corrects its angle, its rate and
the offset, with gains that are constant some seconds after the first measurement. For the model,
which runs ahead of the grapple by the lag of the valve, it is predicted ahead by that lag and the
age of the measurement.
"""

import math
from collections import deque

from canshaper.shaping.free_swing import FreeSwing, SensorGains, TwoFreeSwings
from canshaper.shaping.sway import (
    Measured,
    SensorLimits,
    SensorTiming,
    SwayMode,
    SwayModel,
    swing_over,
)

# The lead that a two-axis motion makes ends with the motion. The rest that rounding leaves decays
# with this time constant, and is 0 below this value (full speed times seconds).
LEAD_S, NO_LEAD = 1.0, 1e-5


class Late:
    """Velocity of an axis at the time when the sensor's newest value was measured.

    It is the commanded velocity, delayed by the sensor and behind the valve's lag.

    Args:
        timing: delay of the sensor and lag of the valve, s.
        tick_s: time between two ticks, s.

    Attributes:
        now: velocity at the end of the tick, part of full speed.
        middle: velocity in the middle of the tick, part of full speed.
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

    The velocity that a motion of two axes adds makes no swing of the grapple, but it moves the tip
    ahead of the grapple: the measured angle includes that lead.

    Args:
        sway: sway model of the axis.
        timing: delay of the sensor and lag of the valve.

    Attributes:
        speed: speed of the tip, full speeds.
    """

    __slots__ = ("_added", "_lead", "_own", "speed", "sway")

    def __init__(self, sway: SwayModel, timing: SensorTiming) -> None:
        tick_s = sway.tick_s
        self.sway = SwayModel(sway.mode, tick_s)
        self._own, self._added = Late(timing, tick_s), Late(timing, tick_s)
        self._lead = self.speed = 0.0

    def step(self, velocity: float, added: float) -> None:
        """Advance a tick in which the axis' own ``velocity`` was sent, and ``added`` besides."""
        own, tick_s = self._own, self.sway.tick_s
        own.step(velocity)
        self.sway.step(own.middle)
        late = self._added
        if added or self._lead or late.now:
            late.step(added)
            self._lead += tick_s * late.middle
            if not added:
                self._lead -= tick_s / LEAD_S * self._lead
                if abs(self._lead) < NO_LEAD and abs(late.now) < NO_LEAD:
                    self._lead = late.now = 0.0
        self.speed = own.now + late.now

    @property
    def angle(self) -> float:
        """Normalised angle between tip and grapple, as in ``SwayModel``."""
        return self.sway.angle + self._lead

    @property
    def rate(self) -> float:
        """Rate of ``angle``, in the unit of ``SwayModel.rate``."""
        return self.sway.rate + self.speed

    def restart(self) -> None:
        """Begin with no swing."""
        self.sway.angle = self.sway.rate = self._lead = 0.0

    def retune(self, mode: SwayMode) -> None:
        """Continue with another mode at the same physical swing."""
        self.sway = self.sway.retuned(mode, self._own.now)


Errors = tuple[float, float, float, float]
"""Errors of a measurement, rad or rad/s: (free, negated, alone, dragged) of ``SwayObserver``."""


class SwayObserver:
    """Late model and free swing of one axis, under four hypotheses of what the sensor shows.

    Args:
        sway: sway model of the axis.
        timing: timing of the sensor.
        limits: bounds of its measurements.
        gains: gains for this timing and these limits, by ``sensor_gains``.

    Attributes:
        late: the late model.
        free: free swing, if the sensor shows this axis.
        negated: free swing, if the sensor shows this axis with the opposite sign.
        alone: smooth motion, if the measurement is no swing at all.
        dragged: smooth motion, if the grapple is on the ground and the moving tip turns it.
    """

    __slots__ = (
        "_ahead",
        "_ahead_s",
        "_bend",
        "_by",
        "_rates",
        "_tick_s",
        "_way",
        "alone",
        "dragged",
        "free",
        "late",
        "negated",
    )

    def __init__(
        self, sway: SwayModel, timing: SensorTiming, limits: SensorLimits, gains: SensorGains
    ) -> None:
        self._rates = timing.measured is Measured.RATE
        self._ahead_s = timing.lag_s + timing.delay_s
        self.late = LateModel(sway, timing)
        self._set_mode(sway)
        measured, second = timing.measured, limits.second
        self.free, self.negated = (FreeSwing(measured, gains.one) for _ in range(2))
        if second:
            by = swing_over(second, sway.tick_s)
            self.free, self.negated = (TwoFreeSwings(measured, gains.two, by) for _ in range(2))
        smooth = [(*one[:2], 0.0) for one in gains.one]
        self.alone, self.dragged = (FreeSwing(measured, smooth) for _ in range(2))
        self._way = 0.0  # way of the tip since the last measurement, normalised
        self._bend = (gains.two or gains.one)[-1][1] / gains.period_s
        self._tick_s = sway.tick_s

    def _set_mode(self, sway: SwayModel) -> None:
        self._by = (sway.f11, sway.f12, sway.f21, sway.f22)
        self._ahead = swing_over(sway.mode, self._ahead_s)

    def retune(self, sway: SwayModel) -> None:
        """Continue with the mode of another model of the axis; the gains stay."""
        self.late.retune(sway.mode)
        self._set_mode(sway)

    def restart(self) -> None:
        """Restart the late model, because the model of the axis has restarted."""
        self.late.restart()

    def begin(self, value: float, scale: float) -> None:
        """Start every hypothesis from the first measurement; arguments as of ``errors``."""
        own = self.own(scale)
        self.free.begin(value - own)
        self.negated.begin(-value - own)
        self.alone.begin(value)
        self._way = 0.0
        self.dragged.begin(value - scale * self.late.speed if self._rates else value)

    def errors(self, value: float, scale: float) -> Errors:
        """Return the errors of a measurement under each of the four hypotheses.

        Call it once for each measurement.

        Args:
            value: the measurement, rad or rad/s.
            scale: rad per normalised angle of the model.
        """
        own, dragged, turned = self.own(scale), self.dragged, value
        if self._rates:
            turned -= scale * self.late.speed
        else:
            dragged.angle += scale * self._way
            self._way = 0.0
        return (
            self.free.error(value - own),
            self.negated.error(-value - own),
            self.alone.error(value),
            dragged.error(turned),
        )

    def acceleration(self, error: float) -> float:
        """Return the acceleration of the free swing that a lasting error causes, rad/s^2."""
        return error * self._bend

    def correct(self, errors: Errors) -> float:
        """Correct every hypothesis by its error; return the error that is left of the first."""
        self.dragged.correct(errors[3])
        self.negated.correct(errors[1])
        self.alone.correct(errors[2])
        return self.free.correct(errors[0])

    def own(self, scale: float) -> float:
        """Return the measurement that own motion alone would give; ``scale`` as of ``errors``."""
        return scale * (self.late.rate if self._rates else self.late.angle)

    def step(self, velocity: float, added: float) -> None:
        """Advance a tick in which ``velocity`` was sent, and ``added`` by a two-axis motion."""
        by = self._by
        self.late.step(velocity, added)
        self.free.step(by)
        self.negated.step(by)
        tick_s = self._tick_s
        self.alone.glide(tick_s)
        self.dragged.glide(tick_s)
        self._way += tick_s * self.late.speed

    def swing(self, free: FreeSwing) -> None:
        """Advance another free swing by a tick."""
        free.step(self._by)

    def ahead(self, free: FreeSwing) -> tuple[float, float]:
        """Predict a free swing to the time of the model's state; return (rad, rad/s)."""
        by, angle, rate = self._ahead, free.angle, free.rate
        return angle + by[0] * angle + by[1] * rate, rate + by[2] * angle + by[3] * rate
