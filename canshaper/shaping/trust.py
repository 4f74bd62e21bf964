"""Trust in the sway sensor: tests of measurements against the model, which give named states.

The sensor is trusted once driven motion has proved that it shows the swing of this axis with this
sign, until it contradicts motion, stands still or jumps, or the load does not hang free.
"""

import math
from collections import deque

from canshaper.shaping.free_swing import FreeSwing, Gains
from canshaper.shaping.observer import Errors, SwayObserver
from canshaper.shaping.states import Trust
from canshaper.shaping.sway import TICK_OF_NOISE_S, Measured, SensorTiming

LATCHED = (Trust.JUMP, Trust.RESTLESS)
"""States that stay until the axis is at rest."""

# Log-likelihood ratios: for a proof, for a proof after a fault in this motion, and their bound.
PROVED, PROVED_AGAIN, BOUND = 6.0, 11.9, 12.0
# Least standard deviation of what is expected, for errors of the model: deg, deg/s.
MODEL_DEG, MODEL_DEG_S = 0.25, 0.7
# Weight of the error that the better hypothesis makes too; largest step of a ratio; time
# over which errors are averaged; factor by which a mean square is far larger.
COMMON_SHARE, MOST_STEP, ENERGY_S, FAR = 8.0, 2.0, 0.08, 4.0
# Largest error, as an acceleration that free swing needs for it: full speeds a second.
SURPRISE_PER_S = 2.0
# A grapple does not jump so far beyond what was expected within 20 ms, and noise: deg, deg/s.
JUMP_DEG, JUMP_DEG_S, JUMP_NOISE = 1.5, 2.5, 5.0
# A value is stuck for this time and this number of measurements, if a swing would change its rate
# by this meanwhile: deg/s.
STUCK_S, LEAST_STILL, STUCK_DEG_S = 0.12, 3, 2.5
# A grapple is held if the value stays for this part of a swing within this many times the noise and
# within the first number of the angle or the rate (deg or deg/s), while a swing would change its
# rate by the second number (deg/s). For a rate an offset that is not yet known does the same.
HELD_SWINGS, HELD_NOISE, HELD_ANGLE, HELD_RATE = 0.1, 3.0, (0.35, 5.0), (1.0, 20.0)

# Time over which paths are compared; largest path of the velocity: times that of the command, plus
# full speeds.
RESTLESS_S, RESTLESS_SHARE, RESTLESS_MORE = 2.0, 1.5, 1.0


class Evidence:
    """Sequential likelihood ratio test of the hypotheses of what a sensor shows.

    Args:
        measured: angle or rate.
        noise: standard deviation of the measurement, rad or rad/s.
        period_s: time between two measurements, seconds.

    Attributes:
        sign: log-likelihood ratio of the right sign against the opposite one.
        own: log-likelihood ratio of own motion against none.
        free: log-likelihood ratio of a hanging grapple against a dragged one.
    """

    __slots__ = ("_count", "_energies", "_fade", "_least", "free", "own", "sign")

    def __init__(self, measured: Measured, noise: float, period_s: float) -> None:
        model = MODEL_DEG_S if measured is Measured.RATE else MODEL_DEG
        self._least = noise**2 + math.radians(model) ** 2
        # Errors of the model last: fewer measurements each say more.
        self._count = 0.5 * period_s / TICK_OF_NOISE_S
        self._fade = -math.expm1(-period_s / ENERGY_S)
        self.sign = self.own = self.free = 0.0
        self._energies = 0.0, 0.0, 0.0, 0.0

    def add(self, errors: Errors) -> None:
        """Add a measurement.

        Args:
            errors: errors if this axis moved it as modelled, with the other sign, not at all, and
                if the grapple was dragged (``SwayObserver.errors``).
        """
        fade = self._fade
        known, negated, alone, dragged = self._energies
        known += fade * (errors[0] * errors[0] - known)
        negated += fade * (errors[1] * errors[1] - negated)
        alone += fade * (errors[2] * errors[2] - alone)
        dragged += fade * (errors[3] * errors[3] - dragged)
        self._energies = known, negated, alone, dragged
        self.sign = self._added(self.sign, negated, known)
        self.own = self._added(self.own, alone, known)
        self.free = self._added(self.free, dragged, known)

    @property
    def surprise(self) -> float:
        """Root mean square of the last errors if the sensor shows this axis, rad or rad/s."""
        return math.sqrt(self._energies[0])

    def _added(self, ratio: float, other: float, known: float) -> float:
        """Return the updated ratio against another hypothesis, by mean squares of both errors."""
        # What neither explains, an undriven swing of another period, speaks for none of them.
        if other >= known:
            step = (other - known) / (self._least + COMMON_SHARE * known)
            ratio += self._count * (step if step < MOST_STEP else MOST_STEP)
            return ratio if ratio < BOUND else BOUND
        # The other one is ahead only where its error is far the smaller one.
        if FAR * other < known:
            step = (known - FAR * other) / (self._least + COMMON_SHARE * other)
            ratio -= self._count * (step if step < MOST_STEP else MOST_STEP)
        return ratio if ratio > -BOUND else -BOUND

    def proved(self, least: float) -> bool:
        """Return whether the ratios of right sign and own motion both exceed ``least``."""
        return self.sign > least and self.own > least

    def fault(self, least: float) -> Trust | None:
        """Return WRONG_SIGN or CONTACT, by the lowest ratio, if it is below ``least``, or None."""
        contact = min(self.own, self.free)
        if min(self.sign, contact) >= least:
            return None
        return Trust.WRONG_SIGN if self.sign < contact else Trust.CONTACT

    def clear(self) -> None:
        """Begin again without the evidence for the sensor; evidence against it stays."""
        self.sign, self.own = min(self.sign, 0.0), min(self.own, 0.0)
        self.free = min(self.free, 0.0)
        self._energies = 0.0, 0.0, 0.0, 0.0


class CrossedSway:
    """Two more hypotheses of what a sensor shows: the other axis' swing, with either sign.

    While slew moves and no one commands near-far, near-far's sensor shows the swing along the boom
    that slewing makes. That proves the sensor too, if slew's sensor would not show the same:
    signals of two axes are easily swapped, and a swing from before fits either of them.

    Args:
        timing: timing of the sensor.
        noise: standard deviation of the measurement, rad or rad/s.
        gains: gains of angle, rate and offset, for the free swing of each hypothesis.
        value: the first measurement, rad or rad/s.
        other: measurement that the other axis' sensor would show by that axis' own motion.
    """

    __slots__ = ("_evidence", "_negated", "_same")

    def __init__(
        self, timing: SensorTiming, noise: float, gains: Gains, value: float, other: float
    ) -> None:
        self._same, self._negated = (FreeSwing(timing.measured, gains) for _ in range(2))
        self._same.begin(value - other)
        self._negated.begin(value + other)
        self._evidence = Evidence(timing.measured, noise, timing.period_s)

    def refuted(self, value: float, other: float, error: float) -> bool:
        """Take a measurement and its error by this axis; return whether both are refuted."""
        errors = self._same.error(value - other), self._negated.error(value + other)
        self._same.correct(errors[0])
        self._negated.correct(errors[1])
        self._evidence.add((error, *errors, errors[1]))
        return self._evidence.proved(PROVED)

    def step(self, observer: SwayObserver) -> None:
        """Advance the free swings of both hypotheses a tick, by the sway mode of ``observer``."""
        observer.swing(self._same)
        observer.swing(self._negated)


def largest_jump(measured: Measured, noise: float, period_s: float) -> float:
    """Return the largest error of a measurement that is no jump, rad or rad/s."""
    jump = math.radians(JUMP_DEG_S if measured is Measured.RATE else JUMP_DEG)
    return jump * max(1.0, period_s / TICK_OF_NOISE_S) + JUMP_NOISE * noise


class Standstill:
    """Detects a sensor, or a grapple, that stands still.

    Args:
        measured: angle or rate.
        noise: standard deviation of the measurement, rad or rad/s.
        period_s: time between two measurements, seconds.
        swing_s: period of the swing, seconds.
    """

    __slots__ = ("_held", "_stuck")

    def __init__(self, measured: Measured, noise: float, period_s: float, swing_s: float) -> None:
        within, least = HELD_RATE if measured is Measured.RATE else HELD_ANGLE
        self._stuck = Still(STUCK_S, period_s, 0.0, STUCK_DEG_S)
        within = HELD_NOISE * noise + math.radians(within)
        self._held = Still(HELD_SWINGS * swing_s, period_s, within, least)

    def clear(self) -> None:
        """Begin again."""
        self._stuck.clear()
        self._held.clear()

    def check(self, value: float, bent: float, *, command_active: bool) -> Trust | None:
        """Return STUCK or CONTACT where the measurement shows a standstill, else None.

        Args:
            value: the measurement, rad or rad/s.
            bent: change of the free swing's rate that the measurement caused, rad/s.
            command_active: whether the operator demands motion now. Else a still value is not taken
                for contact: at the end of the tail it may be the turn of a swing, of a pendulum
                that is far shorter than the model.
        """
        stuck, held = self._stuck.check(value, bent), self._held.check(value, bent)
        return Trust.STUCK if stuck else Trust.CONTACT if held and command_active else None


class Still:
    """Detects a value that stays constant while a swing would change it.

    Args:
        least_s: time for which the value is constant, s; at least ``LEAST_STILL`` measurements.
        period_s: time between two measurements, seconds.
        within: largest change of the value in that time, rad or rad/s.
        least_deg_s: least change of rate that a swing would make in that time, deg/s.
    """

    __slots__ = ("_bends", "_bent", "_count", "_least", "_stays", "_values", "_within")

    def __init__(self, least_s: float, period_s: float, within: float, least_deg_s: float) -> None:
        self._count = max(math.ceil(least_s / period_s), LEAST_STILL) + 1
        self._values: deque[float] = deque(maxlen=self._count)
        self._bends: deque[float] = deque(maxlen=self._count)
        self._within, self._least = within, math.radians(least_deg_s)
        self._bent = 0.0  # change of rate while the value is constant
        self._stays = False

    def clear(self) -> None:
        """Begin again."""
        self._values.clear()
        self._bends.clear()
        self._stays = False

    def check(self, value: float, bent: float) -> bool:
        """Return whether the value stays though a swing would change it; see ``Standstill``."""
        values, bends = self._values, self._bends
        values.append(value)
        bends.append(bent)
        within = self._within
        if abs(value - values[0]) > within or max(values) - min(values) > within:
            self._stays = False
            return False
        self._bent = self._bent + bent if self._stays else sum(bends)
        self._stays = True
        return len(values) == self._count and abs(self._bent) > self._least


class Restlessness:
    """Detects a velocity that goes to and fro far more than the operator's command.

    Args:
        tick_s: time between two ticks.
    """

    __slots__ = ("_commanded", "_moved")

    def __init__(self, tick_s: float) -> None:
        self._moved = Path(round(RESTLESS_S / tick_s))
        # A filter may run on for as long again.
        self._commanded = Path(round(2.0 * RESTLESS_S / tick_s))

    def add(self, velocity: float, command: float) -> bool:
        """Take velocity and command of a tick; return whether the velocity's path is too long."""
        moved = self._moved.add(velocity)
        return moved > RESTLESS_SHARE * self._commanded.add(command) + RESTLESS_MORE


class Path:
    """Length of the path of a number over the last ticks."""

    __slots__ = ("_last", "_length", "_steps")

    def __init__(self, ticks: int) -> None:
        self._steps = deque([0.0] * ticks, maxlen=ticks)
        self._last = self._length = 0.0

    def add(self, value: float) -> float:
        """Take the next number, and return the length."""
        step = abs(value - self._last)
        self._last = value
        self._length += step - self._steps[0]
        self._steps.append(step)
        return self._length
