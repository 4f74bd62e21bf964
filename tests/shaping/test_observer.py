"""The observer behind a sway sensor: its gains, its prediction."""

import math
from dataclasses import replace

import numpy as np
import pytest

from canshaper.shaping.free_swing import (
    ANGLE_PER_RATE,
    OFFSET_NOISE,
    QUICKNESS_OF_TWO,
    SECOND_QUICKNESS,
    TwoFreeSwings,
    observer_gains,
)
from canshaper.shaping.sway import Measured, SensorLimits, SwayMode, SwayModel, swing_over
from tests.shaping.observed import MODE, TICK_S, observer_of, pulses, timing

SCALE = 0.8
LIMITS = SensorLimits(math.radians(0.1), math.radians(3.0))
BOTH = pytest.mark.parametrize("measured", list(Measured))


@BOTH
@pytest.mark.parametrize("second", [None, SwayMode(9.0, 0.04)])
@pytest.mark.parametrize("quickness", [1.0, 3.0])
def test_the_gains_are_those_of_a_kalman_filter_that_knows_next_to_nothing(
    measured: Measured, second: SwayMode | None, quickness: float
) -> None:
    """Next to a second mode of a filter of both, which has a quickness of its own."""
    time, limits = timing(measured, quickness=quickness), replace(LIMITS, second=second)
    gains = observer_gains(MODE, TICK_S, time, limits)
    quick = quickness if second is None else QUICKNESS_OF_TWO
    a, states = np.eye(5), 3 if second is None else 5
    a[:2, :2] += np.array(swing_over(MODE, TICK_S)).reshape(2, 2)
    if second is not None:
        a[3:, 3:] += np.array(swing_over(second, TICK_S)).reshape(2, 2)
    rate = measured is Measured.RATE
    c = np.array([0.0, 1.0, 1.0, 0.0, 1.0] if rate else [1.0, 0.0, 1.0, 1.0, 0.0])[:states]
    other, noise = SECOND_QUICKNESS, math.degrees(LIMITS.noise)
    each = [ANGLE_PER_RATE * quick, quick, OFFSET_NOISE[measured], ANGLE_PER_RATE * other, other]
    a, q = a[:states, :states], np.diag(each[:states]) ** 2
    p = np.diag([10.0 / noise, 30.0 / noise, 0.25 / noise, 2.0 / noise, 20.0 / noise][:states]) ** 2
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
