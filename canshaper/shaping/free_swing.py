"""Free swing: the swing that own motion does not explain, estimated with Kalman gains."""

import math
from collections.abc import Sequence
from dataclasses import replace
from operator import mul
from typing import NamedTuple

from canshaper.shaping.sway import (
    TICK_OF_NOISE_S,
    Measured,
    SensorLimits,
    SensorTiming,
    SwayMode,
    swing_over,
)

# After so many steps, some 10 ms, the gains are within a thousandth of the steady ones.
MOST_STEPS = 5000


def kalman_gains(
    step: Sequence[Sequence[float]],
    shown: Sequence[float],
    noise: Sequence[float],
    first: Sequence[float],
) -> tuple[tuple[float, ...], ...]:
    """Return Kalman gains for successive measurements; the last ones are the steady state's.

    Args:
        step: transition of the states to the next measurement, a row for each state.
        shown: part of each state in the measurement, whose noise has a variance of 1.
        noise: process noise of each state between two measurements, variance.
        first: variance of each state before the first measurement.
    """
    states = range(len(shown))
    covariance = [[first[k] if k == other else 0.0 for other in states] for k in states]
    gains = [(0.0,) * len(shown)]
    for _ in range(MOST_STEPS):
        half = [[sum(map(mul, row, column)) for column in covariance] for row in step]
        covariance = [[sum(map(mul, row, other)) for other in step] for row in half]
        for k in states:
            covariance[k][k] += noise[k]
        seen = [sum(map(mul, row, shown)) for row in covariance]
        spread = sum(map(mul, seen, shown)) + 1.0
        gains.append(tuple(one / spread for one in seen))
        covariance = [
            [old - gain * other for old, other in zip(row, seen, strict=True)]
            for row, gain in zip(covariance, gains[-1], strict=True)
        ]
        if max(abs(new - old) for new, old in zip(gains[-1], gains[-2], strict=True)) < 1e-9:
            break
    return tuple(gains[1:])


# Process noise in a tick of 20 ms, with a measurement noise of 1: of angle and rate for the
# quickness of the sensor's timing, and of the offset. The offset of a gyro may jump by as much as
# a grapple's rate at most: it is estimated before the damping of a false swing does harm.
ANGLE_PER_RATE = 0.02
OFFSET_NOISE = {Measured.ANGLE: 0.02, Measured.RATE: 0.04}
# Standard deviations at the first measurement: of the swing, deg and deg/s; of the offset, as a
# part of the largest one.
FIRST_DEG, FIRST_DEG_S, FIRST_OFFSET = 10.0, 30.0, 1.0 / 12.0
# From then on the gains are those of the steady state.
FIRST_S = 4.0
# With a second mode: process noise of the first mode's rate and of the second mode, and standard
# deviations of the second mode at the first measurement, deg and deg/s. The first mode is estimated
# so slowly that the second one, which is driven too, hardly disturbs it.
QUICKNESS_OF_TWO, SECOND_QUICKNESS = 0.4, 5.0
FIRST_SECOND_DEG, FIRST_SECOND_DEG_S = 2.0, 20.0

Gains = tuple[tuple[float, ...], ...]
"""Gains for successive measurements; the last ones are those of the steady state."""


class SensorGains(NamedTuple):
    """Gains of one sensor on one axis; their computation takes longer than a tick.

    Attributes:
        period_s: time between two measurements, seconds, a whole number of ticks.
        one: gains of angle, rate and offset.
        two: gains of these and of angle and rate of a second mode; () without a second mode.
    """

    period_s: float
    one: Gains
    two: Gains


class FreeSwing:
    """Free swing and offset of the sensor, corrected by measurements.

    Args:
        measured: angle or rate.
        gains: gains of angle, rate and offset for each measurement from the first on; the last
            ones stay.

    Attributes:
        angle, rate: free swing at the time of the measurement, rad and rad/s.
        offset: offset of the sensor, rad or rad/s.
    """

    __slots__ = ("_first", "_gains", "_rates", "_steady", "angle", "offset", "rate")

    def __init__(self, measured: Measured, gains: Sequence[tuple[float, ...]]) -> None:
        self._rates = measured is Measured.RATE
        self._first, self._steady = gains, gains[-1]
        self._gains = iter(gains)
        self.angle = self.rate = self.offset = 0.0

    def step(self, by: tuple[float, float, float, float]) -> None:
        """Advance a tick; ``by`` is an undriven swing's change in it, see ``swing_over``."""
        angle, rate = self.angle, self.rate
        self.angle = angle + by[0] * angle + by[1] * rate
        self.rate = rate + by[2] * angle + by[3] * rate

    def error(self, unexplained: float) -> float:
        """Return ``unexplained`` (measurement less own motion) less free swing and offset."""
        return unexplained - (self.rate if self._rates else self.angle) - self.offset

    def glide(self, tick_s: float) -> None:
        """Advance a tick without gravity."""
        self.angle += tick_s * self.rate

    def correct(self, error: float) -> float:
        """Correct by the error of a measurement, and return the error that is left."""
        angle, rate, offset = next(self._gains, self._steady)
        self.angle += angle * error
        self.rate += rate * error
        self.offset += offset * error
        return error * (1.0 - offset - (rate if self._rates else angle))

    def begin(self, unexplained: float) -> None:
        """Begin angle, rate and gains with this measurement, as of ``error``; keep the offset."""
        self.angle = self.rate = 0.0
        self._gains = iter(self._first)
        self.correct(self.error(unexplained))


class TwoFreeSwings(FreeSwing):
    """Free swing of the first mode; a second mode is estimated to keep it out of the first.

    Args:
        measured: angle or rate.
        gains: gains of the first mode and offset, then those of angle and rate of the second mode.
        by: change of the second mode in a tick, as of ``swing_over``.
    """

    __slots__ = ("_by", "_first_of_second", "_gains_of_second", "_second")

    def __init__(
        self,
        measured: Measured,
        gains: Sequence[tuple[float, ...]],
        by: tuple[float, float, float, float],
    ) -> None:
        super().__init__(measured, [(one[0], one[1], one[2]) for one in gains])
        self._first_of_second = [(one[3], one[4]) for one in gains]
        self._by = by
        self._gains_of_second = iter(self._first_of_second)
        self._second = FreeSwing(measured, [(0.0, 0.0, 0.0)])

    def step(self, by: tuple[float, float, float, float]) -> None:
        """Advance both modes a tick; ``by`` is the change of the first one."""
        super().step(by)
        self._second.step(self._by)

    def error(self, unexplained: float) -> float:
        """Return ``unexplained`` less the free swing of both modes and the offset."""
        return self._second.error(super().error(unexplained))

    def correct(self, error: float) -> float:
        """Correct both modes and the offset, and return the error that is left."""
        angle, rate = next(self._gains_of_second, self._first_of_second[-1])
        second = self._second
        second.angle += angle * error
        second.rate += rate * error
        return super().correct(error) - error * (rate if self._rates else angle)

    def begin(self, unexplained: float) -> None:
        """Begin both modes again as ``FreeSwing.begin`` does; keep the offset."""
        self._second.angle = self._second.rate = 0.0
        self._gains_of_second = iter(self._first_of_second)
        super().begin(unexplained)


def observer_gains(
    mode: SwayMode, tick_s: float, timing: SensorTiming, limits: SensorLimits
) -> Gains:
    """Return the Kalman gains of the first measurements, the steady state's last.

    Each has the gains of angle, rate and offset, then of angle and rate of any second mode.
    ``tick_s`` is the time between two measurements.
    """
    swing, ticks, offset = swing_over(mode, tick_s), tick_s / TICK_OF_NOISE_S, limits.offset
    rates, second = timing.measured is Measured.RATE, limits.second
    quickness = timing.quickness if second is None else QUICKNESS_OF_TWO
    shown = [float(not rates), float(rates), 1.0]
    step = [[1.0 + swing[0], swing[1], 0.0], [swing[2], 1.0 + swing[3], 0.0], [0.0, 0.0, 1.0]]
    noise = [ANGLE_PER_RATE * quickness, quickness, OFFSET_NOISE[timing.measured]]
    first = [math.radians(FIRST_DEG), math.radians(FIRST_DEG_S), FIRST_OFFSET * offset]
    if second:
        other = swing_over(second, tick_s)
        shown += shown[:2]
        step = [[*row, 0.0, 0.0] for row in step]
        step += [[0.0, 0.0, 0.0, 1.0 + other[0], other[1]]]
        step += [[0.0, 0.0, 0.0, other[2], 1.0 + other[3]]]
        noise += [ANGLE_PER_RATE * SECOND_QUICKNESS, SECOND_QUICKNESS]
        first += [math.radians(FIRST_SECOND_DEG), math.radians(FIRST_SECOND_DEG_S)]
    variances = [sd * sd * ticks for sd in noise], [(sd / limits.noise) ** 2 for sd in first]
    gains = kalman_gains(step, shown, *variances)
    return (*gains[: round(FIRST_S / tick_s)], gains[-1])


def sensor_gains(
    mode: SwayMode, tick_s: float, timing: SensorTiming, limits: SensorLimits
) -> SensorGains:
    """Return the gains of a sensor on an axis, whose period is ``tick_s``."""
    period_s = max(1, round(timing.period_s / tick_s)) * tick_s
    one = observer_gains(mode, period_s, timing, replace(limits, second=None))
    two = observer_gains(mode, period_s, timing, limits) if limits.second else ()
    return SensorGains(period_s, one, two)
