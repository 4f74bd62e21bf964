"""A sway sensor on one axis: adds free swing to the sway model, as far as it is trusted."""

from canshaper.shaping.free_swing import FreeSwing, SensorGains
from canshaper.shaping.observer import SwayObserver
from canshaper.shaping.states import Trust
from canshaper.shaping.sway import SensorLimits, SensorTiming, SwayModel
from canshaper.shaping.swing_length import SwingLengthEstimate
from canshaper.shaping.trust import (
    LATCHED,
    PROVED,
    PROVED_AGAIN,
    SURPRISE_PER_S,
    CrossedSway,
    Evidence,
    Restlessness,
    Standstill,
    largest_jump,
)

# Time in which the feedback of the sensor fades in and out.
FADE_S = 0.6
# The same where the grapple leans on something: feedback of that would drive the crane.
CONTACT_FADE_S = 0.1
# Part of the free swing that is fed back where there is a second mode: the first mode is known less
# well then, and a command that follows it excites the second one.
SECOND_MODE_WEIGHT = 0.75

# In these states nothing contradicts a free-hanging grapple and a sensor that shows it.
HANGING = (Trust.UNPROVED, Trust.TRUSTED)
# These states are seen in the measurements themselves: they replace every other state.
UNDOUBTED = (Trust.LOST, Trust.JUMP, Trust.UNPROVED)


class SensedSway:
    """Observer and trust of the sway sensor of one axis.

    Args:
        sway: sway model of the axis, which gets the free swing as far as the sensor is trusted.
        timing: quantity and timing of the sensor.
        limits: bounds of its measurements.
        gains: gains of its observer.
        damps: whether the free swing is fed back; else it is only watched.

    Attributes:
        state: trust state of the sensor.
        weight: part of the free swing that is fed back, 0 to 1.
        length: estimate of the pendulum's length.
    """

    def __init__(
        self,
        sway: SwayModel,
        timing: SensorTiming,
        limits: SensorLimits,
        gains: SensorGains,
        *,
        damps: bool,
    ) -> None:
        measured, tick_s = timing.measured, sway.tick_s
        self.state = Trust.NO_DATA
        self.weight = 0.0
        self._sway, self._limits = sway, limits
        self._most = (SECOND_MODE_WEIGHT if limits.second else 1.0) if damps else 0.0
        self._speed_per_angle = 1.0 / sway.mode.angle_per_speed_rad
        self._observer = SwayObserver(sway, timing, limits, gains)
        self._evidence = Evidence(measured, limits.noise, timing.period_s)
        self._timing, self._gains = timing, gains.one
        self._crossed: CrossedSway | None = None
        self._standstill = Standstill(measured, limits.noise, timing.period_s, sway.mode.period_s)
        self._restlessness = Restlessness(tick_s)
        self.length = SwingLengthEstimate(sway.mode, measured, limits, timing.period_s)
        self._jump = largest_jump(measured, limits.noise, timing.period_s)
        self._tick_s = tick_s
        self._age_s = 0.0  # since the last measurement
        self._begun = self._command_active = self._commanded = False
        self._needed = PROVED
        # The free swing that is fed back; after trust is lost it swings on as it was.
        self._fading = FreeSwing(measured, [(0.0, 0.0, 0.0)])
        self._left = 0.0  # what the last measurement left unexplained

    def measure(
        self,
        value: float | None,
        scale: float,
        *,
        commanded: bool,
        damps: bool = False,
        other: float | None = None,
    ) -> None:
        """Take the measurement of this tick, if there is one, before the filter runs.

        Args:
            value: a new measurement, rad or rad/s, with the sign of the model; None without one.
            scale: rad per normalised angle of the model.
            commanded: whether the operator demanded motion within the tail. Else the valve damps
                only where ``damps``, and swing of another axis proves nothing, but see ``other``.
            damps: whether the axis damps a swing that another axis makes.
            other: measurement that the other axis' sensor would show by that axis' own motion.
                With it such a swing proves a sensor that has had no fault, see ``CrossedSway``.
        """
        self._commanded = commanded
        if not commanded and self.state is not Trust.CONTACT:
            self._needed = PROVED
        if value is not None:
            self._age_s = 0.0
            if self._begun:
                crossed = damps and not commanded and self.state is Trust.UNPROVED
                by_other = other if crossed else None
                proves = commanded or by_other is not None or (damps and self.weight > 0.0)
                self._compare(value, scale, proves, by_other)
                self._estimate(value, scale, commanded)
            elif not commanded or self.state not in LATCHED:
                self._begin(value, scale)
        elif self._age_s > self._timing.lost_s and self.state not in (Trust.NO_DATA, Trust.LOST):
            self._doubt(Trust.LOST, again=True)
        self._feed_back(scale)

    def own(self, scale: float) -> float:
        """Return the measurement that own motion alone would give; ``scale`` as in ``measure``."""
        return self._observer.own(scale)

    def step(self, velocity: float, command: float, added: float = 0.0) -> None:
        """Advance a tick.

        Args:
            velocity: velocity sent in the tick without the added one, [-1, 1].
            command: demand of the operator, [-1, 1].
            added: velocity that a motion of two axes added, [-1, 1].
        """
        self._age_s += self._tick_s
        self._command_active = command != 0.0
        # Motion for another axis has bounds of its own.
        own = velocity if self._commanded else 0.0
        if self._restlessness.add(own, command) and self.state is Trust.TRUSTED:
            self._doubt(Trust.RESTLESS, again=True)
        self._observer.step(velocity, added)
        if self._crossed:
            self._crossed.step(self._observer)
        if self.weight:
            self._observer.swing(self._fading)

    def retune(self, sway: SwayModel) -> None:
        """Continue with another model of the axis; trust and weight stay."""
        self._sway = sway
        self._speed_per_angle = 1.0 / sway.mode.angle_per_speed_rad
        self._observer.retune(sway)

    def restart(self) -> None:
        """Feed nothing back until proved again: the model restarts and does not know its swing."""
        self._observer.restart()
        self.weight = 0.0
        self._sway.free_angle = self._sway.free_rate = 0.0
        self._doubt(Trust.UNPROVED, again=True)

    def _begin(self, value: float, scale: float) -> None:
        observer = self._observer
        observer.begin(value, scale)
        self._evidence.clear()
        self._crossed = None
        self._standstill.clear()
        self._left = 0.0
        self._begun = True
        if self.state in (Trust.NO_DATA, Trust.LOST):
            self.state = Trust.UNPROVED

    def _compare(self, value: float, scale: float, proves: bool, other: float | None) -> None:
        observer, evidence, trusted = self._observer, self._evidence, self.state is Trust.TRUSTED
        errors = observer.errors(value, scale)
        if not abs(errors[0] - self._left) <= self._jump:
            self._doubt(Trust.JUMP, again=True)
            return
        before = observer.free.rate
        self._left = observer.correct(errors)
        bent = observer.free.rate - before
        refuted = self._refuted(value, other, errors[0])
        if not proves:
            self._standstill.clear()
            return
        evidence.add(errors)
        if fault := self._standstill.check(value, bent, command_active=self._command_active):
            self._doubt(fault, again=True)
        elif fault := evidence.fault(0.0 if trusted else -PROVED):
            self._doubt(fault)
        elif observer.acceleration(evidence.surprise) > SURPRISE_PER_S * scale:
            self._doubt(Trust.CONTACT)
        elif evidence.proved(self._needed) and refuted:
            if abs(observer.free.offset) > self._limits.offset:
                self._doubt(Trust.OFFSET)
            elif not trusted and not self.weight:
                self.state = Trust.TRUSTED

    def _refuted(self, value: float, other: float | None, error: float) -> bool:
        """Return whether ``CrossedSway`` refutes that it measures ``other``; True where None."""
        if other is None:
            if self._crossed and self.state is not Trust.TRUSTED:
                self._evidence.clear()  # that is no proof without the other axis
            self._crossed = None
            return True
        if self._crossed:
            return self._crossed.refuted(value, other, error)
        self._crossed = CrossedSway(self._timing, self._limits.noise, self._gains, value, other)
        return False

    def _estimate(self, value: float, scale: float, commanded: bool) -> None:
        observer = self._observer
        # What a model angle of 1 means is the speed of the tip by the mode.
        speed_m_s = observer.late.speed * scale * self._speed_per_angle
        free = self.state in HANGING
        offset = observer.free.offset
        self.length.add(value, offset, speed_m_s, pressed=commanded, free=free)

    def _doubt(self, why: Trust, *, again: bool = False) -> None:
        """Distrust the sensor, where no older fault stays; ``again``: the observer begins again."""
        if self.state is Trust.TRUSTED:
            self._needed = PROVED_AGAIN
            self._evidence.clear()
        if why in UNDOUBTED or self.state in (Trust.UNPROVED, Trust.TRUSTED):
            self.state = why
        self._begun = self._begun and not again

    def _feed_back(self, scale: float) -> None:
        sway, free, fading = self._sway, self._observer.free, self._fading
        fade = self._tick_s / (CONTACT_FADE_S if self.state is Trust.CONTACT else FADE_S)
        if self.state is Trust.TRUSTED:
            fading.angle, fading.rate = free.angle, free.rate
        else:
            fade = -fade
        weight = self.weight = min(max(self.weight + fade, 0.0), self._most)
        if weight:
            angle, rate = self._observer.ahead(fading)
            part = weight / scale
            sway.free_angle, sway.free_rate = part * angle, part * rate
        else:
            sway.free_angle = sway.free_rate = 0.0
