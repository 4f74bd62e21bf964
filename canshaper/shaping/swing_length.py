"""Estimates length and damping of the swinging pendulum from a sway sensor and own motion.

A grapple that hung still before the tip moved swings as

    theta'' = -(g theta - a) / length - damping theta'        a: acceleration of the tip

Angle (or rate) and speed of the tip pass the same second-order filter, which gives the derivatives
of both; least squares over the time from the press on give length and damping. A grapple that
swung before, that is held, or that someone pushes would give a length without meaning: a result
counts only if the motion begins at rest, and own motion explains the swing.
"""

import math
from dataclasses import dataclass

from canshaper.shaping.sway import GRAVITY_M_S2, Measured, SensorLimits, SwayMode

# Measurements are averaged over this part of a swing, to save time; filter and averaging are the
# same for angle and speed.
MEAN_SWINGS = 0.03
# Corner of the filter, times the natural frequency of the file.
CORNER = 2.0
# A grapple is at rest if it swings less than this behind the filter: deg, and times the noise.
REST_DEG, REST_NOISE = 0.5, 3.0
# Parts of a swing from the press on: when there may be a result, and when the window ends.
LEAST_SWINGS, MOST_SWINGS = 0.3, 1.2
# Largest part of the motion that length and damping leave unexplained.
UNEXPLAINED = 0.02
# Largest standard deviation of a length that counts as a result, percent.
MOST_SD_PCT = 7.0
# Weight of the file's damping against the motion in a window.
DAMPING_WEIGHT = 0.05


@dataclass(frozen=True, slots=True)
class SwingLength:
    """Length and damping of the pendulum from one window of measurements.

    Attributes:
        length_m: length of the pendulum, m.
        damping_ratio: damping ratio of the pendulum.
        sd_pct: standard deviation of the length, percent.
    """

    length_m: float
    damping_ratio: float
    sd_pct: float


class Derivatives:
    """A signal behind a second-order filter, with its first two derivatives.

    Args:
        corner: corner frequency of the filter, rad/s, with two equal poles.
        period_s: time between two values, seconds.
    """

    __slots__ = ("_corner", "_decay", "_last", "_period_s", "first", "second", "value")

    def __init__(self, corner: float, period_s: float) -> None:
        self._corner, self._period_s = corner, period_s
        self._decay = math.exp(-corner * period_s)
        self.value = self.first = self.second = self._last = 0.0

    def add(self, signal: float) -> None:
        """Take the next value; the signal is linear between two values."""
        corner, step, decay = self._corner, self._period_s, self._decay
        slope = (signal - self._last) / step
        # In steady state the answer to a ramp is the ramp, two time constants late.
        late = 2.0 * slope / corner
        off = self.value - (self._last - late)
        turn = self.first - slope + corner * off
        off = (off + turn * step) * decay
        rate = turn * decay - corner * off
        self.value, self.first = signal - late + off, slope + rate
        self.second = corner * (corner * (signal - self.value) - 2.0 * self.first)
        self._last = signal


class SwingLengthEstimate:
    """Estimates the length in every motion that begins at rest.

    Args:
        mode: sway data of the file.
        measured: angle or rate.
        limits: bounds of the sensor's measurements.
        period_s: time between two measurements, seconds.

    Attributes:
        result: result of the last window that gave one; None before.
    """

    def __init__(
        self, mode: SwayMode, measured: Measured, limits: SensorLimits, period_s: float
    ) -> None:
        corner = CORNER * mode.omega_rad_s
        self._corner = corner
        self._rates = measured is Measured.RATE
        self._count = max(1, round(MEAN_SWINGS * mode.period_s / period_s))
        self._period_s = self._count * period_s
        self._waiting = 0
        self._value = self._way = 0.0  # sums of the measurements not yet averaged
        self._swing, self._speed = (Derivatives(corner, self._period_s) for _ in range(2))
        self._rest = math.radians(REST_DEG) * (mode.omega_rad_s if self._rates else 1.0)
        self._rest += REST_NOISE * limits.noise
        self._least_s, self._most_s = LEAST_SWINGS * mode.period_s, MOST_SWINGS * mode.period_s
        longest = 1.0 + limits.length_range
        per_length = mode.omega_rad_s**2 / GRAVITY_M_S2
        self._range = per_length / longest, per_length * longest
        self._damping = 2.0 * mode.damping_ratio * mode.omega_rad_s
        self._time_s = math.inf  # since the press; infinite without one
        self._offset = 0.0
        self._sums = [0.0] * 6
        self.result: SwingLength | None = None

    def add(
        self, value: float, offset: float, speed_m_s: float, *, pressed: bool, free: bool
    ) -> None:
        """Take a measurement; a window that gives a length puts it into ``result``.

        Args:
            value: measurement, rad or rad/s.
            offset: present estimate of the sensor's offset, rad or rad/s.
            speed_m_s: speed of the tip at the time of the measurement.
            pressed: whether the operator demanded motion within the tail.
            free: whether nothing contradicts a grapple that hangs free.
        """
        if pressed and not free:
            self._time_s = math.inf
        self._value += value
        self._way += speed_m_s
        self._waiting += 1
        if self._waiting < self._count:
            return
        swing, speed = self._swing, self._speed
        swing.add(self._value / self._waiting)
        speed.add(self._way / self._waiting)
        self._waiting, self._value, self._way = 0, 0.0, 0.0
        if not pressed:
            self._offset = offset
            still = abs(swing.value - offset) < self._rest and abs(speed.value) < 1e-3
            self._time_s = 0.0 if still else math.inf
            self._sums = [0.0] * 6
        elif self._time_s < self._most_s:
            self._time_s += self._period_s
            push = speed.second if self._rates else speed.first
            hung = GRAVITY_M_S2 * (swing.value - self._offset)
            self._accumulate(push - hung, -swing.first, swing.second)
            if self._time_s >= self._least_s:
                self.result = self._solved() or self.result

    def _accumulate(self, drive: float, drag: float, bend: float) -> None:
        sums = self._sums
        sums[0] += drive * drive
        sums[1] += drive * drag
        sums[2] += drag * drag
        sums[3] += drive * bend
        sums[4] += drag * bend
        sums[5] += bend * bend

    def _solved(self) -> SwingLength | None:
        """Solve bend = drive / length + damping drag, damping near the file's; None if unsure."""
        aa, ab, bb, ax, bx, xx = self._sums
        weight = DAMPING_WEIGHT * bb
        determinant = aa * (bb + weight) - ab * ab
        if not determinant > 0.0:
            return None
        pull = bx + weight * self._damping
        per_length = (ax * (bb + weight) - ab * pull) / determinant
        damping = (aa * pull - ab * ax) / determinant
        left = xx - 2.0 * (per_length * ax + damping * bx)
        left += per_length**2 * aa + 2.0 * per_length * damping * ab + damping**2 * bb
        low, high = self._range
        if not low <= per_length <= high or left > UNEXPLAINED * xx:
            return None
        omega = math.sqrt(GRAVITY_M_S2 * per_length)
        # What is left lasts for about the time constant of the filter.
        count = self._corner * self._time_s
        sd = math.sqrt(max(left, 0.0) / count * (bb + weight) / determinant)
        sd_pct = 100.0 * sd / per_length
        if sd_pct > MOST_SD_PCT:
            return None
        return SwingLength(1.0 / per_length, max(0.5 * damping / omega, 0.0), sd_pct)
