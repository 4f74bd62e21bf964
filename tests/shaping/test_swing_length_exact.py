"""The length as it swings now, against least squares of the same samples, and its exact limits."""

import math
import random
from dataclasses import dataclass

import numpy as np
import pytest

from canshaper.shaping.sway import Measured, SensorLimits, SwayMode
from canshaper.shaping.swing_length import Derivatives, SwingLength, SwingLengthEstimate

G = 9.81
FILE = SwayMode(math.sqrt(G / 1.2), 0.05)
# A file whose length range and whose parts of a swing are numbers without a rounding error.
ROUND = SwayMode(math.sqrt(G), 0.0)
ROUND_PERIOD = SwayMode(2.0 * math.pi / 2.5, 0.0)
NOISE, OFFSET = math.radians(0.2), math.radians(0.4)
BOTH = pytest.mark.parametrize("measured", list(Measured))
FINE = 10  # steps of the pendulum between two samples


@dataclass(frozen=True)
class Sample:
    value: float
    speed: float
    pressed: bool


def samples_of(
    measured: Measured,
    period_s: float,
    *,
    resting: int,
    pressed: int,
    length_m: float = 1.5,
    damping: float = 0.4,
    offset: float = 0.0,
    noise: float = 0.0,
    speed: float = 1.0,
) -> list[Sample]:
    """Samples of a pendulum at rest, then driven; its equation is that of the module."""
    angle = rate = tip = 0.0
    by_chance = random.Random(3)
    samples = []
    for number in range(resting + pressed):
        for _ in range(FINE):
            step = period_s / FINE
            pull = (speed - tip) / 0.1 if number >= resting else 0.0
            tip += step * pull
            rate += step * ((pull - G * angle) / length_m - damping * rate)
            angle += step * rate
        seen = rate if measured is Measured.RATE else angle
        value = seen + offset + by_chance.gauss(0.0, noise)
        samples.append(Sample(value, tip, number >= resting))
    return samples


def estimate_of(
    mode: SwayMode, measured: Measured, period_s: float, *, noise: float = NOISE
) -> SwingLengthEstimate:
    limits = SensorLimits(noise, math.radians(3.0), length_range=1.0)
    return SwingLengthEstimate(mode, measured, limits, period_s)


def results_of(
    estimate: SwingLengthEstimate, samples: list[Sample], offset: float = 0.0
) -> list[SwingLength | None]:
    """The result after each of the samples."""
    results = []
    for sample in samples:
        estimate.add(sample.value, offset, sample.speed, pressed=sample.pressed, free=True)
        results.append(estimate.result)
    return results


def least_squares(
    mode: SwayMode,
    measured: Measured,
    samples: list[Sample],
    block_s: float,
    *,
    block: int = 1,
    offset: float = 0.0,
) -> SwingLength:
    """numpy's solution of bend = drive / length + damping drag, the damping weighted as a row."""
    corner = 2.0 * mode.omega_rad_s
    swing, speed = Derivatives(corner, block_s), Derivatives(corner, block_s)
    rows = []
    for first in range(0, len(samples), block):
        part = samples[first : first + block]
        swing.add(float(np.mean([sample.value for sample in part])))
        speed.add(float(np.mean([sample.speed for sample in part])))
        if part[-1].pressed:
            push = speed.second if measured is Measured.RATE else speed.first
            rows.append((push - G * (swing.value - offset), -swing.first, swing.second))
    table = np.array(rows)
    of, bend = table[:, :2], table[:, 2]
    weight = 0.05 * float(np.sum(of[:, 1] ** 2))
    row = np.array([[0.0, math.sqrt(weight)]])
    target = math.sqrt(weight) * 2.0 * mode.damping_ratio * mode.omega_rad_s
    all_rows, all_bends = np.vstack([of, row]), np.append(bend, target)
    per_length, damping = np.linalg.lstsq(all_rows, all_bends, rcond=None)[0]
    left = float(np.sum((bend - of @ np.array([per_length, damping])) ** 2))
    spread = float(np.linalg.inv(all_rows.T @ all_rows)[0, 0])
    sd = math.sqrt(left / (corner * len(rows) * block_s) * spread)
    ratio = 0.5 * damping / math.sqrt(G * per_length)
    return SwingLength(1.0 / per_length, ratio, 100.0 * sd / per_length)


def assert_same(seen: SwingLength | None, expected: SwingLength) -> None:
    assert seen is not None
    got = (seen.length_m, seen.damping_ratio, seen.sd_pct)
    wanted = (expected.length_m, expected.damping_ratio, expected.sd_pct)
    assert got == pytest.approx(wanted, rel=1e-9)


@BOTH
@pytest.mark.parametrize(("period_s", "block"), [(0.02, 3), (0.1, 1)])
@pytest.mark.parametrize("until_s", [1.2, 2.1])
def test_a_window_gives_the_least_squares_of_its_samples(
    measured: Measured, period_s: float, block: int, until_s: float
) -> None:
    """Length, damping and standard deviation are those of numpy, of means over 3 % of a swing."""
    blocks = round(until_s / (block * period_s))
    samples = samples_of(
        measured, period_s, resting=2 * block, pressed=blocks * block, offset=OFFSET, noise=NOISE
    )
    expected = least_squares(FILE, measured, samples, block * period_s, block=block, offset=OFFSET)
    assert expected.damping_ratio > 0.05
    assert expected.sd_pct > 0.3
    seen = results_of(estimate_of(FILE, measured, period_s), samples, OFFSET)[-1]
    assert_same(seen, expected)


def test_the_filter_begins_at_zero() -> None:
    """A signal that is zero from the start has no value and no derivatives."""
    through = Derivatives(6.0, 0.02)
    through.add(0.0)
    assert (through.value, through.first, through.second) == (0.0, 0.0, 0.0)


def test_a_window_counts_from_a_part_of_a_swing_to_another_both_included() -> None:
    """A result comes at 0.3 swings to the sample, and the last one at 1.2 swings."""
    period_s, resting = 0.125, 4
    samples = samples_of(Measured.ANGLE, period_s, resting=resting, pressed=30, speed=0.3)
    results = results_of(estimate_of(ROUND_PERIOD, Measured.ANGLE, period_s), samples)[resting:]
    first, last = 6 - 1, 24 - 1  # 0.75 s and 3 s
    assert results[first - 1] is None
    for at in (first, last):
        part = samples[: resting + at + 1]
        expected = least_squares(ROUND_PERIOD, Measured.ANGLE, part, period_s)
        assert_same(results[at], expected)
    assert results[last] is not results[last - 1]
    assert all(result is results[last] for result in results[last:])


def at_rest(measured: Measured, off: float, *, noise: float = NOISE) -> bool:
    """Whether a motion counts that begins so far from the offset."""
    samples = samples_of(measured, 0.1, resting=3, pressed=20, speed=3.0)
    return results_of(estimate_of(FILE, measured, 0.1, noise=noise), samples, off)[-1] is not None


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("noise", [0.0, NOISE])
@pytest.mark.parametrize(
    ("measured", "rest"),
    [
        (Measured.ANGLE, math.radians(0.5)),
        (Measured.RATE, math.radians(0.5) * FILE.omega_rad_s),
    ],
)
def test_a_motion_counts_that_begins_below_half_a_degree_and_the_noise(
    measured: Measured, rest: float, noise: float, sign: float
) -> None:
    """The limit is 0.5 deg, as a rate times the frequency, and three times the noise."""
    limit = rest + 3.0 * noise
    assert at_rest(measured, sign * math.nextafter(limit, 0.0), noise=noise)
    assert not at_rest(measured, sign * limit, noise=noise)


@pytest.mark.parametrize(
    ("speed_m_s", "counts"), [(0.9e-3, True), (1e-3, False), (1.1e-3, False), (0.5, False)]
)
def test_a_motion_counts_that_begins_with_a_tip_slower_than_a_millimetre_a_second(
    speed_m_s: float, counts: bool
) -> None:
    estimate = estimate_of(FILE, Measured.ANGLE, 0.125)
    results_of(estimate, [Sample(0.0, speed_m_s, False)] * 400)
    driven = samples_of(Measured.ANGLE, 0.125, resting=0, pressed=20, speed=1.0)
    moved = [Sample(each.value, each.speed + speed_m_s, True) for each in driven]
    assert (results_of(estimate, moved)[-1] is not None) == counts


def solved(sums: tuple[float, ...], time_s: float) -> SwingLength | None:
    """Of sums that were chosen; the file has no damping and a length range of 0.5 to 2 m."""
    estimate = estimate_of(ROUND, Measured.ANGLE, 0.02)
    estimate._sums, estimate._time_s = list(sums), time_s
    return estimate._solved()


@pytest.mark.parametrize("scale", [1.0, 2.0**-12])
def test_a_length_leaves_two_percent_of_the_motion_unexplained_at_most(scale: float) -> None:
    """However small the motion is: 2 of 100 is a length, and a little more is none."""
    sums = (98.0, 0.0, 20.0, 98.0, 0.0, 100.0)
    result = solved(tuple(scale * each for each in sums), 100.0)
    assert result is not None
    assert result.length_m == 1.0
    sums = (98.0, 0.0, 20.0, 98.0, 0.0, 100.0001)
    assert solved(tuple(scale * each for each in sums), 100.0) is None


@pytest.mark.parametrize(("drive", "length_m", "beyond"), [(64.0, 2.0, 31.99), (4.0, 0.5, 8.001)])
def test_the_shortest_and_the_longest_length_of_the_range_are_lengths(
    drive: float, length_m: float, beyond: float
) -> None:
    """A length at an end of the range is one, and beyond it is none."""
    result = solved((drive, 0.0, 20.0, drive / length_m, 0.0, 1.01 * drive / length_m**2), 100.0)
    assert result is not None
    assert result.length_m == length_m
    assert solved((drive, 0.0, 20.0, beyond, 0.0, 1.01 * beyond**2 / drive), 100.0) is None


def test_a_standard_deviation_of_seven_percent_is_that_of_a_length() -> None:
    """The largest one is allowed, and what is above it is not."""
    time_s = 4.0 / (2.0 * ROUND.omega_rad_s)
    motion = 6.25**2 / 7.0 + 7.0 / 64.0
    result = solved((7.0, 0.0, 20.0, 6.25, 0.0, motion), time_s)
    assert result is not None
    assert result.sd_pct == 7.0
    assert solved((7.0, 0.0, 20.0, 6.25, 0.0, motion + 1e-6), time_s) is None
