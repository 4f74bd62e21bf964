"""The length as it swings now: of a pendulum of this file's own, driven, held, pushed."""

import math
import random
from collections.abc import Callable

import pytest

from canshaper.shaping.sway import Measured, SensorLimits, SwayMode
from canshaper.shaping.swing_length import Derivatives, SwingLength, SwingLengthEstimate

TICK_S = 0.02
FILE_M = 1.2
MODE = SwayMode(math.sqrt(9.81 / FILE_M), 0.05)
NOISE = {Measured.ANGLE: math.radians(0.1), Measured.RATE: math.radians(0.3)}
BOTH = pytest.mark.parametrize("measured", list(Measured))
FINE = 20  # steps of the pendulum in a tick

Push = Callable[[float], float]


class World:
    """A point mass on a rod below a tip that follows its command with a lag of 0.1 s."""

    def __init__(
        self, measured: Measured, length_m: float, *, offset: float = 0.0, noise: float = 1.0
    ) -> None:
        self.noise_sd = noise * NOISE[measured]
        limits = SensorLimits(self.noise_sd, math.radians(3.0))
        self.estimate = SwingLengthEstimate(MODE, measured, limits, TICK_S)
        self.measured, self.length_m, self.offset = measured, length_m, offset
        self.angle = self.rate = self.speed = self.time_s = 0.0
        self.noise = random.Random(7)

    def run(
        self,
        seconds: float,
        command: float,
        *,
        push: Push = lambda _time_s: 0.0,
        held: float | None = None,
        free: bool = True,
        pressed: bool | None = None,
    ) -> SwingLength | None:
        """Run on; ``push`` is an acceleration by hand, rad/s^2, ``held`` an angle."""
        for _ in range(round(seconds / TICK_S)):
            for _ in range(FINE):
                step = TICK_S / FINE
                pull = (command - self.speed) / 0.1
                self.speed += step * pull
                bend = -(9.81 * math.sin(self.angle) - pull * math.cos(self.angle)) / self.length_m
                self.rate += step * (bend - 0.25 * self.rate + push(self.time_s))
                self.angle += step * self.rate
                if held is not None:
                    self.angle, self.rate = held, 0.0
                self.time_s += step
            true = self.rate if self.measured is Measured.RATE else self.angle
            value = true + self.offset + self.noise.gauss(0.0, self.noise_sd)
            moves = command != 0.0 if pressed is None else pressed
            self.estimate.add(value, self.offset, self.speed, pressed=moves, free=free)
        return self.estimate.result


@BOTH
@pytest.mark.parametrize("length_m", [0.8, 1.0, 1.2, 1.5, 1.8])
@pytest.mark.parametrize("command", [1.0, -0.8])
def test_a_second_after_the_press_it_is_within_seven_percent(
    measured: Measured, length_m: float, command: float
) -> None:
    world = World(measured, length_m, offset=math.radians(2.0))
    world.run(2.0, 0.0)
    seen = world.run(1.0, command)
    assert seen is not None
    assert seen.length_m == pytest.approx(length_m, rel=0.07)
    seen = world.run(1.0, command)
    assert seen is not None
    assert seen.length_m == pytest.approx(length_m, rel=0.04)
    assert seen.sd_pct < 5.0
    ratio = 0.25 / 2.0 / math.sqrt(9.81 / length_m)
    assert seen.damping_ratio == pytest.approx(ratio, abs=0.03)


@BOTH
def test_what_hangs_still_says_nothing(measured: Measured) -> None:
    assert World(measured, 1.5).run(60.0, 0.0) is None


@BOTH
def test_what_is_pushed_by_hand_changes_nothing(measured: Measured) -> None:
    world = World(measured, 1.5)
    world.run(2.0, 0.0)
    first = world.run(2.0, 1.0)
    assert first is not None
    for hertz in (0.2, 0.5, 0.8, 1.5):
        world.run(10.0, 0.0, push=lambda t, f=hertz: 1.5 * math.sin(2.0 * math.pi * f * t))
        last = world.run(2.0, 1.0, push=lambda t, f=hertz: 1.5 * math.sin(2.0 * math.pi * f * t))
        assert last is not None
        assert last.length_m == pytest.approx(first.length_m, rel=0.05)


@BOTH
@pytest.mark.parametrize("held_deg", [0.0, 3.0, 10.0])
def test_what_is_held_changes_nothing(measured: Measured, held_deg: float) -> None:
    world = World(measured, 1.5)
    world.run(2.0, 0.0)
    first = world.run(2.0, 1.0)
    assert first is not None
    for command in (0.0, 0.5, 0.0, -1.0):
        last = world.run(3.0, command, held=math.radians(held_deg))
        assert last is not None
        assert last.length_m == pytest.approx(first.length_m, rel=0.05)


@BOTH
def test_what_swung_before_the_press_says_nothing(measured: Measured) -> None:
    world = World(measured, 1.5)
    world.angle = math.radians(6.0)
    world.run(2.0, 0.0)
    assert world.run(3.0, 1.0) is None


def test_after_a_doubt_the_motion_says_nothing_more() -> None:
    world = World(Measured.ANGLE, 1.5)
    world.run(2.0, 0.0)
    world.run(0.3, 1.0)
    world.run(TICK_S, 1.0, free=False)
    assert world.run(2.0, 1.0) is None


def test_of_nothing_that_was_measured_there_is_no_length() -> None:
    limits = SensorLimits(math.radians(0.1), math.radians(3.0))
    estimate = SwingLengthEstimate(MODE, Measured.ANGLE, limits, TICK_S)
    for pressed in (False, True):
        for _ in range(100):
            estimate.add(0.0, 0.0, 0.0, pressed=pressed, free=True)
    assert estimate.result is None


@pytest.mark.parametrize("period_s", [0.02, 0.1])
def test_behind_the_filter_a_sine_is_the_sine_and_its_derivatives(period_s: float) -> None:
    omega, corner = 2.0, 6.0
    through = Derivatives(corner, period_s)
    gain = 1.0 / (1.0 + 1j * omega / corner) ** 2
    for step in range(1, 400):
        time_s = step * period_s
        through.add(math.sin(omega * time_s))
        if time_s > 5.0:
            turn = gain * complex(math.cos(omega * time_s), math.sin(omega * time_s))
            expected = [(turn * (1j * omega) ** k).imag for k in range(3)]
            got = (through.value, through.first, through.second)
            assert got == pytest.approx(expected, abs=0.06 * corner**2 * period_s)
