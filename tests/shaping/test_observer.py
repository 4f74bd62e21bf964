"""The observer behind a sway sensor: its late model, its gains, its prediction."""

import math

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from canshaper.shaping.observer import (
    ANGLE_PER_RATE,
    OFFSET_NOISE,
    LateModel,
    Measured,
    SensorTiming,
    SwayObserver,
    steady_gains,
)
from canshaper.shaping.sway import SwayMode, SwayModel, swing_over

TICK_S = 0.02
MODE = SwayMode(2.86, 0.05)
SCALE = 0.8
BOTH = pytest.mark.parametrize("measured", list(Measured))


def timing(measured: Measured, *, delay_s: float = 0.0, lag_s: float = 0.0) -> SensorTiming:
    return SensorTiming(measured, TICK_S, delay_s, lag_s, lost_s=0.1)


def pulses(tick: int) -> float:
    return (0.0, 1.0, -0.4, 0.7)[tick // 40 % 4]


def test_without_delay_and_lag_the_late_model_is_the_model() -> None:
    sway = SwayModel(MODE, TICK_S)
    late = LateModel(sway, timing(Measured.ANGLE))
    for tick in range(500):
        sway.step(pulses(tick))
        late.step(pulses(tick), 0.0)
        assert late.angle == pytest.approx(sway.angle, abs=1e-12)


@pytest.mark.parametrize("delay_s", [0.02, 0.05, 0.1])
def test_a_delay_makes_it_so_much_later(delay_s: float) -> None:
    sway = SwayModel(MODE, TICK_S)
    late = LateModel(sway, timing(Measured.ANGLE, delay_s=delay_s))
    angles = []
    for tick in range(500):
        sway.step(pulses(tick))
        late.step(pulses(tick), 0.0)
        angles.append(sway.angle)
        before = tick - delay_s / TICK_S
        if before >= 1.0:
            expected = np.interp(before, range(len(angles)), angles)
            assert late.angle == pytest.approx(float(expected), abs=2e-3)


def test_a_lag_drives_it_as_a_valve_does() -> None:
    # The same pendulum in steps of 0.1 ms behind a first-order lag.
    late = LateModel(SwayModel(MODE, TICK_S), timing(Measured.ANGLE, lag_s=0.1))
    fine = SwayModel(MODE, 1e-4)
    flow = 0.0
    for tick in range(400):
        late.step(pulses(tick), 0.0)
        for _ in range(200):
            flow += (pulses(tick) - flow) * -math.expm1(-1e-4 / 0.1)
            fine.step(flow)
        assert late.angle == pytest.approx(fine.angle, abs=5e-4)
        assert late.rate == pytest.approx(fine.rate + flow, abs=5e-3)


def test_what_is_added_is_a_lead_and_no_swing() -> None:
    late = LateModel(SwayModel(MODE, TICK_S), timing(Measured.ANGLE))
    for _ in range(10):
        late.step(0.0, 0.5)
    assert late.angle == pytest.approx(0.1, rel=0.02)
    for _ in range(10):
        late.step(0.0, -0.5)
    assert late.angle == pytest.approx(0.0, abs=2e-3)
    for _ in range(5000):
        late.step(0.0, 0.0)
    assert late.angle == late.rate == 0.0


@BOTH
@pytest.mark.parametrize("ticks", [1, 5])
@pytest.mark.parametrize("omega", [1.0, 2.86, 6.0])
def test_the_gains_are_those_of_the_steady_kalman_filter(
    measured: Measured, ticks: int, omega: float
) -> None:
    period_s = ticks * TICK_S
    swing = swing_over(SwayMode(omega, 0.05), period_s)
    gains = steady_gains(swing, period_s, timing(measured))
    a = np.eye(3)
    a[:2, :2] += np.array(swing).reshape(2, 2)
    c = np.array([[0.0, 1.0, 1.0] if measured is Measured.RATE else [1.0, 0.0, 1.0]])
    q = np.diag([ANGLE_PER_RATE**2, 1.0, OFFSET_NOISE**2]) * ticks
    p = solve_discrete_are(a.T, c.T, q, np.eye(1))
    expected = (p @ c.T / (c @ p @ c.T + 1.0))[:, 0]
    assert list(gains) == pytest.approx(list(expected), abs=1e-3)


@BOTH
def test_free_swing_and_offset_are_found_and_predicted(measured: Measured) -> None:
    """A grapple that swings while the crane drives, behind an exact model, with an offset."""
    delay_s, offset = 0.04, 0.02
    sway, free = SwayModel(MODE, TICK_S), SwayModel(MODE, TICK_S)
    observer = SwayObserver(sway, timing(measured, delay_s=delay_s))
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
    observer = SwayObserver(sway, timing(Measured.ANGLE, delay_s=0.04, lag_s=0.1))
    for tick in range(70):
        sway.step(pulses(tick))
        observer.step(pulses(tick), 0.0)
    other = SwayMode(2.2, 0.03)
    before = observer.own(MODE.angle_per_speed_rad)
    observer.retune(sway.retuned(other, 0.0))
    assert observer.own(other.angle_per_speed_rad) == pytest.approx(before)
