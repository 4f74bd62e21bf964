"""The sway and the sensor of the tests of the observer."""

from canshaper.shaping.free_swing import sensor_gains
from canshaper.shaping.observer import SwayObserver
from canshaper.shaping.sensed import SensedSway
from canshaper.shaping.sway import Measured, SensorLimits, SensorTiming, SwayMode, SwayModel

TICK_S = 0.02
MODE = SwayMode(2.86, 0.05)


def timing(
    measured: Measured, *, delay_s: float = 0.0, lag_s: float = 0.0, quickness: float = 1.0
) -> SensorTiming:
    return SensorTiming(measured, TICK_S, delay_s, lag_s, lost_s=0.1, quickness=quickness)


def pulses(tick: int) -> float:
    return (0.0, 1.0, -0.4, 0.7)[tick // 40 % 4]


def sensed_sway(
    sway: SwayModel, timing: SensorTiming, limits: SensorLimits, *, damps: bool
) -> SensedSway:
    gains = sensor_gains(sway.mode, sway.tick_s, timing, limits)
    return SensedSway(sway, timing, limits, gains, damps=damps)


def observer_of(sway: SwayModel, timing: SensorTiming, limits: SensorLimits) -> SwayObserver:
    gains = sensor_gains(sway.mode, sway.tick_s, timing, limits)
    return SwayObserver(sway, timing, limits, gains)
