"""May the sway sensor be believed? Named states, from what it shows beside the model.

It is believed once driven motion has proved that it shows the swing of this axis with this sign,
and no longer when it contradicts motion, stands still, jumps, or the load does not hang free.
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import IntEnum

from canshaper.shaping.observer import TICK_OF_NOISE_S, Measured


class Trust(IntEnum):
    """What is thought of a sway sensor; codes of the status message.

    After a fault its name stays until the sensor is trusted again.
    """

    NO_DATA = 0
    """Nothing was received yet."""
    UNPROVED = 1
    """No driven motion has shown yet that it measures this axis with this sign."""
    TRUSTED = 2
    LOST = 3
    """Measurements do not come any more."""
    STUCK = 4
    """The same value again and again while the model swings."""
    JUMP = 5
    """It has jumped further than a grapple can; until the axis is at rest."""
    WRONG_SIGN = 6
    """It shows the opposite of what motion makes."""
    OFFSET = 7
    """Its offset is larger than configured; until the axis is at rest."""
    CONTACT = 8
    """It shows nothing of what motion makes: the grapple leans on something."""
    RESTLESS = 9
    """The command moves far more than the operator asks for; until the axis is at rest."""


LATCHED = (Trust.JUMP, Trust.OFFSET, Trust.RESTLESS)
"""They stay until the axis is at rest."""

# Log-likelihood ratios: from here on it is proved, the same after a fault in this motion, and most
# that they count.
PROVED, PROVED_AGAIN, BOUND = 6.0, 11.9, 12.0
# Least standard deviation of what is expected, for errors of the model: deg, deg/s.
MODEL_DEG, MODEL_DEG_S = 0.25, 0.7
# What counts of the error that the better of two ideas makes too; most that a measurement says;
# time over which errors are averaged; how many times a mean square is far larger.
COMMON_SHARE, MOST_STEP, ENERGY_S, FAR = 8.0, 2.0, 0.08, 4.0
# Largest error, as an acceleration that free swing needs for it: full speeds a second.
SURPRISE_PER_S = 2.0
# A grapple does not jump so far beyond what was expected within 20 ms, and noise: deg, deg/s.
JUMP_DEG, JUMP_DEG_S, JUMP_NOISE = 2.5, 3.0, 5.0
# The same value for so long, or three of them, while a swing would change its rate by that: deg/s.
STUCK_S, STUCK_DEG_S = 0.12, 3.0
# The same for a value that stays within so much, for so much of a swing. Of angle, and of rate,
# where an offset that is not yet known does the same for a while: deg or deg/s, deg/s.
HELD_SWINGS, HELD_ANGLE, HELD_RATE = 0.12, (0.35, 6.0), (1.0, 20.0)

# Path of the velocity over so long, against that of the command: times, and full speeds besides.
RESTLESS_S, RESTLESS_SHARE, RESTLESS_MORE = 2.0, 1.5, 1.0


@dataclass(frozen=True, slots=True)
class SensorLimits:
    """What a sensor may show.

    Attributes:
        noise: standard deviation, rad or rad/s.
        offset: largest offset, rad or rad/s.
    """

    noise: float
    offset: float


class Evidence:
    """Which idea of the sensor explains its measurements: a sequential likelihood ratio test.

    Args:
        measured: angle or rate.
        noise: standard deviation of it, rad or rad/s.
        period_s: time between two measurements.

    Attributes:
        sign: for the sign against the opposite one.
        own: for own motion against none.
    """

    __slots__ = ("_count", "_energies", "_fade", "_least", "own", "sign")

    def __init__(self, measured: Measured, noise: float, period_s: float) -> None:
        model = MODEL_DEG_S if measured is Measured.RATE else MODEL_DEG
        self._least = noise**2 + math.radians(model) ** 2
        # Errors of the model last: fewer measurements each say more.
        self._count = 0.5 * period_s / TICK_OF_NOISE_S
        self._fade = -math.expm1(-period_s / ENERGY_S)
        self.sign = self.own = 0.0
        self._energies = [0.0, 0.0, 0.0]

    def add(self, errors: tuple[float, float, float]) -> None:
        """A measurement: its errors under the three ideas, see ``SwayObserver.errors``."""
        fade, energies = self._fade, self._energies
        for i, error in enumerate(errors):
            energies[i] += fade * (error * error - energies[i])
        known, negated, alone = energies
        self.sign = self._added(self.sign, negated, known)
        self.own = self._added(self.own, alone, known)

    @property
    def surprise(self) -> float:
        """Root mean square of the last errors under the idea that it shows this axis."""
        return math.sqrt(self._energies[0])

    def _added(self, ratio: float, other: float, known: float) -> float:
        """The ratio against another idea, with the mean squares of the last errors of both."""
        # What neither explains, an undriven swing of another period, speaks for none of them.
        spread = self._least + COMMON_SHARE * min(known, other)
        # The other one is ahead only where its error is far the smaller one.
        step = other - known if other >= known else min(0.0, FAR * other - known)
        step = self._count * min(max(step / spread, -MOST_STEP), MOST_STEP)
        return min(max(ratio + step, -BOUND), BOUND)

    def proved(self, least: float) -> bool:
        """Whether both other ideas are ruled out, by ratios beyond ``least``."""
        return self.sign > least and self.own > least

    def fault(self, least: float) -> Trust | None:
        """Which of the others is the better one, by a ratio below ``least``."""
        if min(self.sign, self.own) >= least:
            return None
        return Trust.WRONG_SIGN if self.sign < self.own else Trust.CONTACT

    def clear(self) -> None:
        """Begin again; what speaks against the sensor stays."""
        self.sign, self.own = min(self.sign, 0.0), min(self.own, 0.0)
        self._energies = [0.0, 0.0, 0.0]


def largest_jump(measured: Measured, noise: float, period_s: float) -> float:
    """Farthest that a measurement may jump beyond what was expected, rad or rad/s."""
    jump = math.radians(JUMP_DEG_S if measured is Measured.RATE else JUMP_DEG)
    return jump * max(1.0, period_s / TICK_OF_NOISE_S) + JUMP_NOISE * noise


class Standstill:
    """Finds a sensor, or a grapple, that stands still.

    Args:
        measured: angle or rate.
        noise: standard deviation of it, rad or rad/s.
        period_s: time between two measurements.
        swing_s: period of the swing.
    """

    __slots__ = ("_held", "_stuck")

    def __init__(self, measured: Measured, noise: float, period_s: float, swing_s: float) -> None:
        within, least = HELD_RATE if measured is Measured.RATE else HELD_ANGLE
        held_s = max(HELD_SWINGS * swing_s, 4.0 * period_s)
        self._stuck = Still(0.0, max(STUCK_S, 3.0 * period_s), math.radians(STUCK_DEG_S))
        self._held = Still(2.0 * noise + math.radians(within), held_s, math.radians(least))

    def clear(self, value: float) -> None:
        """Begin with a measurement."""
        self._stuck.clear(value)
        self._held.clear(value)

    def check(self, value: float, bent: float, passed_s: float) -> Trust | None:
        """What a measurement says.

        Args:
            value: the measurement.
            bent: what it changed the rate of the free swing by, rad/s.
            passed_s: time since the one before.
        """
        if self._stuck.check(value, bent, passed_s):
            return Trust.STUCK
        return Trust.CONTACT if self._held.check(value, bent, passed_s) else None


class Still:
    """A value that stays where it is, though a swing would not."""

    __slots__ = ("_bent", "_high", "_least", "_least_s", "_low", "_time_s", "_within")

    def __init__(self, within: float, least_s: float, least: float) -> None:
        self._within, self._least_s, self._least = within, least_s, least
        self.clear(0.0)

    def clear(self, value: float) -> None:
        """Begin with a value."""
        self._low = self._high = value
        self._bent = self._time_s = 0.0

    def check(self, value: float, bent: float, passed_s: float) -> bool:
        """Whether it has stayed too long; see ``Standstill.check``."""
        low, high = min(self._low, value), max(self._high, value)
        if high - low > self._within:
            self.clear(value)
            return False
        self._low, self._high = low, high
        self._time_s += passed_s
        self._bent += bent
        return self._time_s >= self._least_s and abs(self._bent) > self._least


class Restlessness:
    """Does the velocity go to and fro far more than the operator's command?

    Args:
        tick_s: time between two ticks.
    """

    __slots__ = ("_asked", "_moved")

    def __init__(self, tick_s: float) -> None:
        self._moved = Path(round(RESTLESS_S / tick_s))
        # A filter may run on for as long again.
        self._asked = Path(round(2.0 * RESTLESS_S / tick_s))

    def add(self, velocity: float, command: float) -> bool:
        """A tick with this velocity and this command; whether they differ too much."""
        moved = self._moved.add(velocity)
        return moved > RESTLESS_SHARE * self._asked.add(command) + RESTLESS_MORE


class Path:
    """Length of the path of a number over the last ticks."""

    __slots__ = ("_last", "_length", "_steps")

    def __init__(self, ticks: int) -> None:
        self._steps = deque([0.0] * ticks, maxlen=ticks)
        self._last = self._length = 0.0

    def add(self, value: float) -> float:
        """Take the next number."""
        step = abs(value - self._last)
        self._last = value
        self._length += step - self._steps[0]
        self._steps.append(step)
        return self._length
