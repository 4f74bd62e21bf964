"""The observer behind a sway sensor: its gains, its prediction."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from canshaper.shaping.free_swing import (
    ANGLE_PER_RATE,
    OFFSET_NOISE,
    QUICKNESS_OF_TWO,
    SECOND_QUICKNESS,
    FreeSwing,
    TwoFreeSwings,
    observer_gains,
)
from canshaper.shaping.sway import SwayMode, SwayModel, swing_over
from canshaper.shaping.sway_sensor import Measured, SensorLimits
from tests.shaping.observed import MODE, TICK_S, observer_of, pulses, timing

SCALE = 0.8
LIMITS = SensorLimits(math.radians(0.1), math.radians(3.0))
BOTH = pytest.mark.parametrize("measured", list(Measured))


@BOTH
@pytest.mark.parametrize("ticks", [1, 5])
@pytest.mark.parametrize("omega", [1.0, 2.86, 6.0])
def test_the_gains_are_those_of_the_steady_kalman_filter(
    measured: Measured, ticks: int, omega: float
) -> None:
    period_s = ticks * TICK_S
    mode = SwayMode(omega, 0.05)
    swing = swing_over(mode, period_s)
    every = observer_gains(mode, period_s, timing(measured), LIMITS)
    assert len(every) == 4.0 / period_s + 1  # those of four seconds before
    gains = every[-1]
    a = np.eye(3)
    a[:2, :2] += np.array(swing).reshape(2, 2)
    c = np.array([[0.0, 1.0, 1.0] if measured is Measured.RATE else [1.0, 0.0, 1.0]])
    q = np.diag([ANGLE_PER_RATE**2, 1.0, OFFSET_NOISE[measured] ** 2]) * ticks
    p = solve_discrete_are(a.T, c.T, q, np.eye(1))
    expected = (p @ c.T / (c @ p @ c.T + 1.0))[:, 0]
    within = 1e-3 if omega == 1.0 else 5e-6  # slow ones take longer than it goes on
    assert list(gains) == pytest.approx(list(expected), abs=within)


@BOTH
@pytest.mark.parametrize("quickness", [1.0, 3.0])
def test_the_first_gains_are_those_of_a_kalman_filter_that_knows_next_to_nothing(
    measured: Measured, quickness: float
) -> None:
    swing = swing_over(MODE, TICK_S)
    gains = observer_gains(MODE, TICK_S, timing(measured, quickness=quickness), LIMITS)
    noise = math.degrees(LIMITS.noise)
    a = np.eye(3)
    a[:2, :2] += np.array(swing).reshape(2, 2)
    c = np.array([0.0, 1.0, 1.0] if measured is Measured.RATE else [1.0, 0.0, 1.0])
    q = np.diag([ANGLE_PER_RATE * quickness, quickness, OFFSET_NOISE[measured]]) ** 2
    p = np.diag([10.0 / noise, 30.0 / noise, 3.0 / 12.0 / noise]) ** 2
    for step in range(100):
        p = a @ p @ a.T + q
        gain = p @ c / (c @ p @ c + 1.0)
        p = p - np.outer(gain, c @ p)
        assert gains[step] == pytest.approx(tuple(gain), rel=1e-6, abs=1e-9)


@BOTH
def test_next_to_a_second_mode_the_gains_are_those_of_a_kalman_filter_of_both(
    measured: Measured,
) -> None:
    second = SwayMode(9.0, 0.04)
    gains = observer_gains(MODE, TICK_S, timing(measured), replace(LIMITS, second=second))
    a = np.eye(5)
    a[:2, :2] += np.array(swing_over(MODE, TICK_S)).reshape(2, 2)
    a[3:, 3:] += np.array(swing_over(second, TICK_S)).reshape(2, 2)
    rate = measured is Measured.RATE
    c = np.array([0.0, 1.0, 1.0, 0.0, 1.0] if rate else [1.0, 0.0, 1.0, 1.0, 0.0])
    quick, other = QUICKNESS_OF_TWO, SECOND_QUICKNESS
    each = [ANGLE_PER_RATE * quick, quick, OFFSET_NOISE[measured], ANGLE_PER_RATE * other, other]
    q, noise = np.diag(each) ** 2, math.degrees(LIMITS.noise)
    p = np.diag([10.0 / noise, 30.0 / noise, 0.25 / noise, 2.0 / noise, 20.0 / noise]) ** 2
    for step in range(100):
        p = a @ p @ a.T + q
        gain = p @ c / (c @ p @ c + 1.0)
        p = p - np.outer(gain, c @ p)
        assert gains[step] == pytest.approx(tuple(gain), rel=1e-6, abs=1e-9)


@BOTH
def test_a_second_swing_is_kept_apart_from_the_first(measured: Measured) -> None:
    """Both swing freely, of the same size: the first one is what it really is."""
    second = SwayMode(9.0, 0.04)
    observer = observer_of(
        SwayModel(MODE, TICK_S), timing(measured), replace(LIMITS, second=second)
    )
    swings = SwayModel(MODE, TICK_S), SwayModel(second, TICK_S)
    for one in swings:
        one.angle = 0.05
    for tick in range(300):
        shown = [one.rate if measured is Measured.RATE else one.angle for one in swings]
        if tick:
            observer.correct(observer.errors(sum(shown), SCALE))
        else:
            observer.begin(sum(shown), SCALE)
        if tick > 150:
            assert observer.free.angle == pytest.approx(swings[0].angle, abs=0.004)
            assert observer.free.rate == pytest.approx(swings[0].rate, abs=0.012)
        observer.step(0.0, 0.0)
        for one in swings:
            one.step(0.0)


def test_a_new_beginning_forgets_the_second_swing() -> None:
    by = (0.0, 0.0, 0.0, 0.0)
    free = TwoFreeSwings(Measured.ANGLE, [(0.5, 0.25, 0.125, 0.25, 1.0), (0.0,) * 5], by)
    for _ in range(2):
        free.begin(1.0)
        assert (free.angle, free.rate, free.offset) == (0.5, 0.25, 0.125)
        assert free.error(1.0) == 1.0 - 0.5 - 0.125 - 0.25
        free.offset = 0.0


@BOTH
def test_what_is_left_of_an_error_counts_the_second_swing(measured: Measured) -> None:
    free = TwoFreeSwings(measured, [(0.5, 0.25, 0.125, 0.0625, 0.03125)], (0.0, 0.0, 0.0, 0.0))
    left = free.correct(free.error(1.0))
    assert left == free.error(1.0)


def test_an_undriven_swing_changes_by_its_matrix() -> None:
    free = FreeSwing(Measured.ANGLE, [(0.5, 0.25, 0.125)])
    free.correct(4.0)  # before any other, by the first gains
    assert (free.angle, free.rate, free.offset) == (2.0, 1.0, 0.5)
    free.step((0.25, 0.5, -1.0, -0.125))
    assert (free.angle, free.rate, free.offset) == (3.0, -1.125, 0.5)


def test_each_measurement_has_its_gains_and_a_new_beginning_the_first() -> None:
    free = FreeSwing(Measured.ANGLE, [(0.5, 0.25, 0.125), (0.25, 0.0, 0.0)])
    for _ in range(2):
        free.offset = 0.0
        free.begin(1.0)
        assert (free.angle, free.rate, free.offset) == (0.5, 0.25, 0.125)
        free.correct(1.0)
        free.correct(1.0)
        assert (free.angle, free.rate, free.offset) == (1.0, 0.25, 0.125)


@BOTH
def test_free_swing_and_offset_are_found_and_predicted(measured: Measured) -> None:
    """A grapple that swings while the crane drives, behind an exact model, with an offset."""
    delay_s, offset = 0.04, 0.02
    sway, free = SwayModel(MODE, TICK_S), SwayModel(MODE, TICK_S)
    observer = observer_of(sway, timing(measured, delay_s=delay_s), LIMITS)
    free.angle = 0.1
    seen: list[float] = []
    for tick in range(1000):
        angle = free.angle + SCALE * sway.angle
        rate = free.rate + SCALE * (sway.rate + (pulses(tick - 1) if tick else 0.0))
        seen.append((rate if measured is Measured.RATE else angle) + offset)
        value = seen[-3] if tick >= 2 else seen[0]
        if tick == 0:
            observer.begin(value, SCALE)
        observer.correct(observer.errors(value, SCALE))
        if tick > 700:
            assert observer.ahead(observer.free) == pytest.approx(
                (free.angle, free.rate), abs=0.004
            )
        sway.step(pulses(tick))
        observer.step(pulses(tick), 0.0)
        free.step(0.0)
    assert observer.free.offset == pytest.approx(offset, abs=0.002)


def test_a_retune_keeps_the_swing() -> None:
    sway = SwayModel(MODE, TICK_S)
    observer = observer_of(sway, timing(Measured.ANGLE, delay_s=0.04, lag_s=0.1), LIMITS)
    for tick in range(70):
        sway.step(pulses(tick))
        observer.step(pulses(tick), 0.0)
    other = SwayMode(2.2, 0.03)
    before = observer.own(MODE.angle_per_speed_rad)
    observer.retune(sway.retuned(other, 0.0))
    assert observer.own(other.angle_per_speed_rad) == pytest.approx(before)


@BOTH
def test_each_idea_explains_what_it_is_about(measured: Measured) -> None:
    """A pendulum, the same turned round, a sensor that stands, and a grapple that is dragged."""
    world, worlds = SwayModel(MODE, TICK_S), 4
    observers = [
        observer_of(SwayModel(MODE, TICK_S), timing(measured), LIMITS) for _ in range(worlds)
    ]
    rates, dragged, squares = measured is Measured.RATE, 0.0, [[0.0] * 4 for _ in range(worlds)]
    for tick in range(200):
        speed = pulses(tick - 1) if tick else 0.0
        dragged += TICK_S * speed
        shown = SCALE * (world.rate + speed if rates else world.angle)
        moved = SCALE * (speed if rates else dragged)
        for which, value in enumerate((shown, -shown, 0.1, moved)):
            one = observers[which]
            if not tick:
                one.begin(value, SCALE)
            errors = one.errors(value, SCALE)
            one.correct(errors)
            squares[which] = [a + b * b for a, b in zip(squares[which], errors, strict=True)]
            one.step(pulses(tick), 0.0)
        world.step(pulses(tick))
    for which in range(worlds):
        least = min(squares[which])
        assert squares[which].index(least) == which
        assert sorted(squares[which])[1] > 5.0 * least


@BOTH
def test_what_is_left_of_an_error_is_what_the_same_measurement_still_shows(
    measured: Measured,
) -> None:
    observer = observer_of(SwayModel(MODE, TICK_S), timing(measured), LIMITS)
    observer.begin(0.0, SCALE)
    for value in (0.3, -0.1, 0.2):
        left = observer.correct(observer.errors(value, SCALE))
        assert observer.errors(value, SCALE)[0] == pytest.approx(left, abs=1e-12)
