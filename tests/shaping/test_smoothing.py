import math
import random
from itertools import pairwise

import pytest

from canshaper.shaping.shapers.smoothing import FirstOrder, SCurve


def test_first_order_reaches_63_percent_after_its_time_constant() -> None:
    lag = FirstOrder(0.02, 0.5)
    out = [lag.step(1.0) for _ in range(25)]
    assert out[-1] == pytest.approx(1.0 - math.exp(-1.0))


@pytest.mark.parametrize("tick_s", [0.005, 0.02])
@pytest.mark.parametrize("rate, jerk", [(2.0, 8.0), (5.0, 10.0), (1.0, 100.0), (1.0, 2.0)])
def test_s_curve_keeps_rate_and_jerk_and_arrives(tick_s: float, rate: float, jerk: float) -> None:
    curve = SCurve(tick_s, rate, jerk)
    out = [0.0]
    for command in (1.0, -1.0, 0.3, 0.0):
        out += [curve.step(command) for _ in range(round(5.0 / tick_s))]
        assert out[-1] == pytest.approx(command, abs=1e-9)
    steps = [b - a for a, b in pairwise(out)]
    assert max(map(abs, steps)) <= rate * tick_s * 1.001
    assert min(out) >= -1.0001  # no overshoot
    assert max(out) <= 1.0001
    changes = [b - a for a, b in pairwise(steps)]
    # the last step of an arrival may take up to two steps of the slope at once
    assert max(map(abs, changes)) <= 2.0 * jerk * tick_s**2 * 1.001


def test_s_curve_on_a_restless_joystick_stays_within_the_joystick() -> None:
    source = random.Random(2)
    curve = SCurve(0.02, 4.0, 20.0)
    command = 0.0
    for i in range(20_000):
        if i % 17 == 0:
            command = source.uniform(-1.0, 1.0)
        # a turn of the joystick in full motion costs one jerk-limited overshoot of what was asked
        assert abs(curve.step(command)) <= 1.0 + 4.0**2 / (2.0 * 20.0)


# Numbers that a float holds exactly: a step of the slope is 1, a tick at that slope moves by 0.5.
EXACT = {"tick_s": 0.5, "rate_per_s": 8.0, "jerk_per_s2": 2.0}


@pytest.mark.parametrize(
    ("commands", "expected"),
    [
        ((8.0, 8.0, 8.0), [0.5, 1.5, 3.0]),  # from rest it begins with one step of the slope
        ((0.5, 8.0, 8.0), [0.5, 1.0, 2.0]),  # where it has arrived it begins from rest again
        ((8.0, 8.0, 1.5), [0.5, 1.5, 2.0]),  # met by the joystick in motion it slows by the jerk
    ],
)
def test_s_curve_changes_its_slope_by_the_jerk(
    commands: tuple[float, ...], expected: list[float]
) -> None:
    curve = SCurve(**EXACT)
    assert [curve.step(command) for command in commands] == expected
