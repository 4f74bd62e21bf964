"""The late model of the observer: behind by the delay, the lag and the lead of its sensor."""

import math

import numpy as np
import pytest

from canshaper.shaping.observer import LateModel
from canshaper.shaping.sway import Measured, SwayModel
from tests.shaping.observed import MODE, TICK_S, pulses, timing


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


def test_a_lead_that_lasts_is_gone_when_it_was_taken_back() -> None:
    late = LateModel(SwayModel(MODE, TICK_S), timing(Measured.ANGLE))
    for velocity in (0.4, 1e-3, -1e-3, -0.4):
        for _ in range(100):
            late.step(0.0, velocity)
    assert late.angle == pytest.approx(0.0, abs=1e-9)
    for _ in range(1000):
        late.step(0.0, 0.0)
    assert late.angle == late.rate == 0.0


def test_a_lead_goes_with_its_time_constant() -> None:
    late = LateModel(SwayModel(MODE, TICK_S), timing(Measured.ANGLE))
    for _ in range(10):
        late.step(0.3, 0.5)
        assert late.speed == pytest.approx(0.8)
    swing = late.angle - 0.1
    assert swing == pytest.approx(late.sway.angle)
    late.restart()
    assert (late.angle, late.rate) == (0.0, 0.8)
    for _ in range(10):
        late.step(0.0, 0.5)
    for tick in range(1, 51):
        late.step(0.0, 0.0)
        lead = 0.1 * (1.0 - TICK_S / 1.0) ** tick
        assert late.angle - late.sway.angle == pytest.approx(lead, rel=1e-9)
