"""The observer against a plain matrix computation: four ideas, their gains, the prediction."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from canshaper.shaping import free_swing
from canshaper.shaping.free_swing import (
    ANGLE_PER_RATE,
    OFFSET_NOISE,
    FreeSwing,
    observer_gains,
)
from canshaper.shaping.sway import Measured, SensorLimits, SwayMode, SwayModel
from tests.shaping.observed import MODE, TICK_S, observer_of, timing

SCALE, TICKS = 0.8, 5
PERIOD_S = TICKS * TICK_S
LIMITS = SensorLimits(math.radians(0.1), math.radians(3.0))
BOTH = pytest.mark.parametrize("measured", list(Measured))


def swung(mode: SwayMode, time_s: float) -> np.ndarray:
    """Angle and rate after a time, by theta'' + 2 zeta w theta' + w^2 theta = 0."""
    w, zeta = mode.omega_rad_s, mode.damping_ratio
    return np.asarray(expm(np.array([[0.0, 1.0], [-w * w, -2.0 * zeta * w]]) * time_s))


def velocity_at(tick: int) -> float:
    """A drive of both signs that never rests."""
    return 0.3 + 0.6 * math.sin(0.21 * tick)


class Ideas:
    """Four filters of two states and an offset, and the tip with its swing."""

    def __init__(self, measured: Measured) -> None:
        time = replace(timing(measured), period_s=PERIOD_S)
        gains = np.array(observer_gains(MODE, PERIOD_S, time, LIMITS))
        self.shown = int(measured is Measured.RATE)
        self.gains = [gains, gains, gains * [1.0, 1.0, 0.0], gains * [1.0, 1.0, 0.0]]
        self.swing = np.zeros(2)
        self.tip = np.zeros(2)  # position and speed
        self.states, self.offsets, self.count = np.zeros((4, 2)), np.zeros(4), 0
        swing, smooth = swung(MODE, TICK_S), np.array([[1.0, TICK_S], [0.0, 1.0]])
        self.by = [swing, swing, smooth, smooth]

    def step(self, speed: float) -> None:
        """The tip jumps to another speed, its swing by as much, and both go on for a tick."""
        self.swing[1] += speed - self.tip[1]
        self.swing = self.by[0] @ self.swing
        self.tip = np.array([self.tip[0] + TICK_S * speed, speed])
        self.states = np.array([f @ x for f, x in zip(self.by, self.states, strict=True)])

    def begin(self, value: float) -> None:
        """Nothing is known but the offset."""
        self.states[:], self.tip[0], self.count = 0.0, 0.0, 0
        self.correct(self.errors(value))

    def errors(self, value: float) -> np.ndarray:
        """Own motion is the swing; or nothing; or the tip itself, which takes the grapple along."""
        own, tip = SCALE * self.swing[self.shown], SCALE * self.tip[self.shown]
        seen = np.array([value - own, -value - own, value, value - tip])
        return np.asarray(seen - self.states[:, self.shown] - self.offsets)

    def correct(self, errors: np.ndarray) -> None:
        for which in range(4):
            gain = self.gains[which][self.count] * errors[which]
            self.states[which] += gain[:2]
            self.offsets[which] += gain[2]
        self.count += 1


@BOTH
@pytest.mark.parametrize("delayed", [0, 2])
def test_the_four_ideas_are_four_kalman_filters(measured: Measured, delayed: int) -> None:
    """The crane drives all the time; measured is every fifth tick, and twice it begins again."""
    time = replace(timing(measured, delay_s=delayed * TICK_S), period_s=PERIOD_S)
    observer, ideas = observer_of(SwayModel(MODE, TICK_S), time, LIMITS), Ideas(measured)
    for tick in range(120):
        value = 0.1 + 0.2 * math.cos(0.13 * tick)
        if tick in (10, 70):
            observer.begin(value, SCALE)
            ideas.begin(value)
        elif tick > 10 and tick % TICKS == 0:
            got, expected = observer.errors(value, SCALE), ideas.errors(value)
            assert got == pytest.approx(tuple(expected), abs=1e-11)
            left = observer.correct(got)
            ideas.correct(expected)
            assert left == pytest.approx(ideas.errors(value)[0], abs=1e-11)
        observer.step(velocity_at(tick), 0.0)
        ideas.step(velocity_at(tick - delayed) if tick >= delayed else 0.0)


@BOTH
def test_a_second_mode_is_none_of_what_a_sensor_shows_that_shows_no_swing(
    measured: Measured,
) -> None:
    """Alone and dragged are the same with and without one."""
    sway, time = SwayModel(MODE, TICK_S), timing(measured)
    one = observer_of(sway, time, LIMITS)
    other = observer_of(sway, time, replace(LIMITS, second=SwayMode(9.0, 0.04)))
    for tick in range(20):
        value = 0.1 + 0.2 * math.cos(0.13 * tick)
        if not tick:
            one.begin(value, SCALE)
            other.begin(value, SCALE)
        errors = one.errors(value, SCALE), other.errors(value, SCALE)
        assert errors[0][2:] == errors[1][2:]
        one.correct(errors[0])
        other.correct(errors[1])
        for observer in (one, other):
            observer.step(velocity_at(tick), 0.0)


@BOTH
@pytest.mark.parametrize(
    ("period_s", "between_s"), [(0.004, TICK_S), (TICK_S, TICK_S), (0.1, 0.1), (0.109, 0.1)]
)
def test_a_lasting_error_bends_the_swing_by_the_gain_of_the_rate_a_period(
    measured: Measured, period_s: float, between_s: float
) -> None:
    """Measurements come in whole ticks, one at least; the gain is that of the steady state."""
    mode, quickness = SwayMode(0.6, 0.0), 0.05
    time = replace(timing(measured, quickness=quickness), period_s=period_s)
    observer = observer_of(SwayModel(mode, TICK_S), time, LIMITS)
    a = np.eye(3)
    a[:2, :2] = swung(mode, between_s)
    c = np.array([[0.0, 1.0, 1.0] if measured is Measured.RATE else [1.0, 0.0, 1.0]])
    q = np.diag([ANGLE_PER_RATE * quickness, quickness, OFFSET_NOISE[measured]]) ** 2
    p = solve_discrete_are(a.T, c.T, q * between_s / TICK_S, np.eye(1))
    gain = (p @ c.T / (c @ p @ c.T + 1.0))[1, 0]
    assert observer.acceleration(0.3) == pytest.approx(0.3 * gain / between_s, rel=1e-4)


def test_the_gains_are_those_of_four_seconds_and_the_last_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    every = [(float(number), 0.0, 0.0) for number in range(300)]
    monkeypatch.setattr(free_swing, "kalman_gains", lambda *_: tuple(every))
    got = observer_gains(MODE, TICK_S, timing(Measured.ANGLE), LIMITS)
    assert got == (*every[:200], every[299])


@pytest.mark.parametrize("retuned", [False, True])
def test_a_free_swing_goes_on_and_is_predicted_as_a_pendulum(retuned: bool) -> None:
    """Ahead by the lag and the delay, by the mode of the model that it was retuned to."""
    sway, mode = SwayModel(MODE, TICK_S), MODE
    observer = observer_of(sway, timing(Measured.ANGLE, delay_s=0.06, lag_s=0.3), LIMITS)
    if retuned:
        mode = SwayMode(1.9, 0.2)
        observer.retune(sway.retuned(mode, 0.0))
    other = FreeSwing(Measured.ANGLE, [(0.0, 0.0, 0.0)])
    for free in (observer.free, observer.negated, other):
        free.angle, free.rate = 0.2, -0.3
    assert observer.ahead(other) == pytest.approx(tuple(swung(mode, 0.36) @ [0.2, -0.3]))
    observer.step(0.0, 0.0)
    observer.swing(other)
    for free in (observer.free, observer.negated, other):
        expected = tuple(swung(mode, TICK_S) @ [0.2, -0.3])
        assert (free.angle, free.rate) == pytest.approx(expected, rel=1e-12)


@BOTH
def test_a_model_that_starts_again_hangs_still(measured: Measured) -> None:
    """Only the speed of the tip is left, which a gyro shows and an inclinometer does not."""
    observer = observer_of(SwayModel(MODE, TICK_S), timing(measured), LIMITS)
    for tick in range(20):
        observer.step(velocity_at(tick), 0.0)
    assert abs(observer.own(SCALE)) > 0.1
    observer.restart()
    shown = SCALE * velocity_at(19) if measured is Measured.RATE else 0.0
    assert observer.own(SCALE) == pytest.approx(shown, abs=1e-12)
