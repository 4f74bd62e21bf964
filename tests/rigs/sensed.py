"""One axis with a sway sensor on the nonlinear crane with a real valve, without frames."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from canshaper.config.inputs import Kind
from canshaper.machine.sway_sensor import SECOND_DAMPING
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.free_swing import sensor_gains
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.sensed import SensedSway
from canshaper.shaping.shapers.fir import zv_taps
from canshaper.shaping.states import CommandInput, Trust
from canshaper.shaping.sway import Measured, SensorLimits, SensorTiming, SwayMode, SwayModel
from canshaper_sim.crane import Crane, CraneParameters, CraneState
from canshaper_sim.grapple import Sway
from canshaper_sim.strokes import Script, Stroke
from canshaper_sim.sway_sensor import SwaySensor, SwaySensorParameters
from tests.rigs import double_pendulum
from tests.rigs.double_pendulum import DoublePendulum

TICK_S = 0.02
LENGTH_M, FULL_SPEED_M_S = 1.2, 1.0
MODE = SwayMode.from_grapple(LENGTH_M, 120.0, 300.0)
SCALE = MODE.angle_per_speed_rad * FULL_SPEED_M_S
ZV = zv_taps(MODE, TICK_S)
LIMITS = OutputLimits(deadband=0.05, rise_per_s=5.0, fall_per_s=5.0, tail_s=2.0)
NOISE_DEG = {Measured.ANGLE: 0.1, Measured.RATE: 0.3}
SETTLE_S = 2.5
STEPS = 125

Contact = Callable[[CraneState], float | None]
"""Angle, rad, at which something holds the grapple now; None where it hangs free."""


def script(name: str, *strokes: tuple[float, float, float], rest_s: float = 5.0) -> Script:
    """Strokes of near-far: start, duration, level."""
    row = tuple(Stroke("near_far", 0.5 + s, d, v, 0.1) for s, d, v in strokes)
    return Script(name, row, max(one.end_s for one in row) + rest_s)


SCRIPTS = {
    one.name: one
    for one in (
        script("pulse", (0.0, 3.0, 1.0)),
        script("partial stroke", (0.0, 2.5, 0.4)),
        script("early release", (0.0, 0.6, 1.0)),
        script("reversal", (0.0, 1.5, 1.0), (1.5, 1.5, -1.0)),
        script("double tap", (0.0, 0.4, 1.0), (0.7, 0.4, 1.0)),
    )
}


@dataclass
class Drive:
    """Result of a drive, a row a tick."""

    script: Script
    time_s: list[float] = field(default_factory=list)
    swing_deg: list[float] = field(default_factory=list)
    sent: list[float] = field(default_factory=list)
    speed: list[float] = field(default_factory=list)
    radius_m: list[float] = field(default_factory=list)
    trust: list[Trust] = field(default_factory=list)

    @property
    def residual_deg(self) -> float:
        """Largest swing after the last stroke, and the time that it may take to end."""
        quiet_s = self.script.strokes[-1].end_s + SETTLE_S
        return max(abs(s) for t, s in zip(self.time_s, self.swing_deg, strict=True) if t >= quiet_s)

    @property
    def stop_s(self) -> float:
        """From the joystick in neutral to the tip below 5 % of full speed."""
        moving = [t for t, v in zip(self.time_s, self.speed, strict=True) if abs(v) > 0.05]
        return moving[-1] - self.script.strokes[-1].end_s

    @property
    def path(self) -> float:
        """How far what was sent has gone to and fro, full speeds."""
        return sum(abs(new - old) for old, new in itertools.pairwise(self.sent))

    @property
    def travel_m(self) -> float:
        """How far the tip has gone."""
        return self.radius_m[-1] - self.radius_m[0]

    @property
    def states(self) -> list[Trust]:
        """States of the sensor, each once in a row."""
        return [now for now, _ in itertools.groupby(self.trust)]


@dataclass(frozen=True)
class Setup:
    """A drive before it begins.

    Attributes:
        measured: by the sensor; None without one.
        every: ticks between two measurements.
        damps: the sensor is fed back, not only watched.
        sensor: what the sensor makes of the swing.
        length_m: of the real pendulum; the model has ``LENGTH_M``.
        load: mass of the real grapple against that of the model.
        swing_deg: at the start.
        taps: of the filter.
        contact: what holds the grapple.
        delay_s: as the observer has it.
        long_log: natural frequencies of a double pendulum that hangs there instead, rad/s.
        second_s: period of a second swing, as the observer has it.
    """

    measured: Measured | None = Measured.ANGLE
    every: int = 1
    damps: bool = True
    sensor: SwaySensorParameters = field(default_factory=SwaySensorParameters)
    length_m: float = LENGTH_M
    load: float = 1.0
    swing_deg: float = 0.0
    taps: list[float] = field(default_factory=lambda: ZV)
    contact: Contact = lambda _state: None
    delay_s: float = 0.02
    lag_s: float = 0.1
    long_log: tuple[float, float] | None = None
    second_s: float | None = None

    def timing(self, measured: Measured) -> SensorTiming:
        """As the observer has it."""
        period_s = self.every * TICK_S
        return SensorTiming(measured, period_s, self.delay_s, 0.1, lost_s=3.5 * period_s)

    def drive(self, name: str | Script) -> Drive:
        """Drive a script."""
        drive = Drive(SCRIPTS[name] if isinstance(name, str) else name)
        sway = SwayModel(MODE, TICK_S)
        shaper = build_shaper("robust", TICK_S, sway, valve_rate_per_s=5.0, taps=self.taps)
        axis = ShapedAxis(TICK_S, LIMITS, sway=sway, shaper=shaper, grid_steps=STEPS)
        sensor, sensed = None, None
        if self.measured:
            noise = math.radians(NOISE_DEG[self.measured])
            second = self.second_s and SwayMode.from_period(self.second_s, SECOND_DAMPING)
            limits = SensorLimits(noise, math.radians(3.0), second=second or None)
            timing = self.timing(self.measured)
            gains = sensor_gains(MODE, TICK_S, timing, limits)
            sensed = SensedSway(sway, timing, limits, gains, damps=self.damps)
            noisy = replace(self.sensor, noise_deg=NOISE_DEG[self.measured])
            kind: Kind = "rate" if self.measured is Measured.RATE else "angle"
            sensor = SwaySensor(noisy, "near_far", across=False, kind=kind)
        axis.sensed = sensed
        crane = self._crane()
        log = DoublePendulum(*self.long_log) if self.long_log else None
        for tick in range(round(drive.script.duration_s / TICK_S)):
            state = self._held(crane)
            if log:
                state = state._replace(theta6_rad=log.angle, theta6_rate_rad_s=log.rate)
            if sensor and sensed:
                value = self._measured(sensor, state, tick)
                sensed.measure(value, SCALE, commanded=axis.output.commanded)
            command = drive.script.command("near_far", state.time_s)
            axis.tick(CommandInput(command=round(1000.0 * command) / 1000.0, enabled=True))
            drive.time_s.append(state.time_s)
            drive.swing_deg.append(math.degrees(state.theta6_rad))
            drive.sent.append(axis.output.setpoint)
            drive.speed.append(state.radius_rate_m_s)
            drive.radius_m.append(state.radius_m)
            drive.trust.append(sensed.state if sensed else Trust.NO_DATA)
            if log:
                swing_on(log, crane, axis.output.steps / STEPS)
            else:
                crane.step(TICK_S, {"near_far": axis.output.steps / STEPS})
        return drive

    def _crane(self) -> Crane:
        crane = CraneParameters()
        grapple = replace(crane.grapple, l2_m=self.length_m, m2_kg=self.load * crane.grapple.m2_kg)
        valve = replace(crane.near_far, lag_s=self.lag_s)
        crane = replace(crane, grapple=grapple, near_far=valve)
        return Crane(crane, Sway(theta6_rad=math.radians(self.swing_deg)))

    def _held(self, crane: Crane) -> CraneState:
        state = crane.state
        angle = self.contact(state)
        if angle is None:
            return state
        rate = (angle - state.theta6_rad) / TICK_S
        crane._sway = Sway(theta6_rad=angle)
        return state._replace(theta6_rad=angle, theta6_rate_rad_s=rate)

    def _measured(self, sensor: SwaySensor, state: CraneState, tick: int) -> float | None:
        sensor.swing(state.time_s, Sway(0.0, state.theta6_rad, 0.0, state.theta6_rate_rad_s))
        value = math.radians(sensor.value(state.time_s))
        gone = state.time_s >= self.sensor.lost_s or tick % self.every
        return None if gone else value


def swing_on(log: DoublePendulum, crane: Crane, command: float) -> None:
    """Drive the crane on for a tick, and let the log swing below its tip."""
    step_s = TICK_S / double_pendulum.STEPS
    for _ in range(double_pendulum.STEPS):
        before = crane.state.radius_rate_m_s
        crane.step(step_s, {"near_far": command})
        log.step((crane.state.radius_rate_m_s - before) / step_s, step_s)
