"""Period, damping and full speed of machines whose truth is known, from noisy data."""

import math

import mujoco
import numpy as np
import pytest

from canshaper.commissioning.identification.series import Array, Kind, Series, Unit
from canshaper.commissioning.identification.verdict import SwingFinding, identify
from canshaper_sim.grapple import Grapple, Sway
from studies.crane.config import load_crane
from studies.crane.tests.mujoco_crane import model_of, simulate
from tests.commissioning.identification.driven import drive
from tests.commissioning.identification.machine import (
    EMPTY,
    LOADED,
    Coloured,
    Push,
    driven,
    period_of,
)
from tests.rigs.files import ROOT

DEGREES = Unit(Kind.ANGLE, math.radians(1.0), "deg")
SLEW, NEAR_FAR = 0, 1


def noisy(time: Array, angle: Array, seed: int, noise_deg: float, memory: float = 0.8) -> Series:
    noise = Coloured(seed, math.radians(noise_deg), memory)
    return Series(f"log {seed}", DEGREES, time, angle + np.array([noise() for _ in time]))


def swung(
    grapple: Grapple, degrees: float, direction: int, seconds: float = 30.0
) -> tuple[Array, Array]:
    """Times and swing of the tool let go at an angle, then hanging on."""
    start = math.radians(degrees)
    sway = Sway(start) if direction == SLEW else Sway(0.0, start)
    reported = [state for state, _ in driven(seconds, grapple=grapple, sway=sway)]
    angles = [(s.theta5_rad, s.theta6_rad)[direction] for s in reported]
    return np.array([s.time_s for s in reported]), np.array(angles)


def truth(grapple: Grapple, direction: int) -> tuple[float, float]:
    """Period of small swings and damping ratio."""
    mode = (grapple.mode5, grapple.mode6)[direction]
    return period_of(mode), mode.zeta


def check(
    finding: SwingFinding, expected: tuple[float, float], *, period: float, ratio: float = math.inf
) -> None:
    """Good enough to use, and the period and the damping ratio within such parts of the truth."""
    assert finding.usable, finding.problems
    assert finding.period_s and finding.damping_ratio
    assert finding.period_s.value == pytest.approx(expected[0], rel=period)
    assert finding.damping_ratio.value == pytest.approx(expected[1], rel=ratio)


@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 6))]
)
@pytest.mark.parametrize("direction", [SLEW, NEAR_FAR])
@pytest.mark.parametrize("grapple", [EMPTY, LOADED], ids=["empty", "loaded"])
def test_two_degrees_in_noise(grapple: Grapple, direction: int, seed: int) -> None:
    time, angle = swung(grapple, 2.0, direction)
    finding = identify("slew", "", [noisy(time, angle, seed, 0.15)])
    check(finding, truth(grapple, direction), period=0.01, ratio=0.2)
    assert not any("second swing" in note for note in finding.notes)


@pytest.mark.slow
def test_the_interval_holds_the_truth() -> None:
    """Of sixty logs with noise whose neighbours are alike, nineteen in twenty, with some luck."""
    time, angle = swung(EMPTY, 3.0, NEAR_FAR, 20.0)
    period, ratio = truth(EMPTY, NEAR_FAR)
    held = np.zeros(2)
    halves = []
    for seed in range(60):
        finding = identify("near_far", "", [noisy(time, angle, seed, 0.25, memory=0.9)])
        assert finding.period_s and finding.damping_ratio
        held += [
            abs(finding.period_s.value - period) < finding.period_s.half,
            abs(finding.damping_ratio.value - ratio) < finding.damping_ratio.half,
        ]
        halves.append(finding.period_s.relative)
    assert (held >= 54).all(), held
    assert float(np.median(halves)) < 0.01  # an interval as wide as the world would hold it too


def test_a_large_swing_is_slower_and_reported_as_a_small_one() -> None:
    time, angle = swung(EMPTY, 40.0, SLEW)
    expected = truth(EMPTY, SLEW)
    check(identify("slew", "", [noisy(time, angle, 1, 0.2)]), expected, period=0.003, ratio=0.05)
    # In a unit that tells no angle there is nothing to correct by, and it comes out too long.
    bars = noisy(time, angle, 1, 0.2)
    plain = identify("slew", "", [Series("p", Unit(Kind.OTHER, 1.0, "bar"), time, bars.value)])
    assert plain.period_s
    assert plain.period_s.value > 1.004 * expected[0]


def test_the_interval_holds_what_the_model_leaves_out() -> None:
    """Large swings, hardly any noise: the tool on two joints is not quite a pendulum."""
    time, angle = swung(EMPTY, 30.0, SLEW)
    finding = identify("slew", "", [noisy(time, angle, 1, 0.02)])
    assert finding.period_s and finding.damping_ratio
    period, ratio = truth(EMPTY, SLEW)
    assert abs(finding.period_s.value - period) < finding.period_s.half < 0.003 * period
    assert abs(finding.damping_ratio.value - ratio) < finding.damping_ratio.half < 0.05 * ratio


@pytest.mark.parametrize("direction", [SLEW, NEAR_FAR])
def test_a_crane_in_mujoco(direction: int) -> None:
    crane = load_crane(ROOT / "studies" / "crane" / "forwarder.yaml")[0]
    step_s = 0.01
    rest = np.array([0.0, 0.3, -0.6, 0.5])
    count = round(25.0 / step_s) * 2 + 1
    still = np.tile(rest, (count, 1)), np.zeros((count, 4)), np.zeros((count, 4))
    start = np.zeros(2)
    start[direction] = math.radians(6.0)
    model: mujoco.MjModel = model_of(crane)
    swings, _ = simulate(model, step_s, still, start)
    time = np.arange(len(swings)) * step_s
    finding = identify("slew", "", [noisy(time, swings[:, direction], 3, 0.2)])
    g = crane.grapple
    grapple = Grapple(g.l1_m, g.l2_m, g.m1_kg, g.m2_kg, g.c5_n_m_s_rad, g.c6_n_m_s_rad)
    check(finding, truth(grapple, direction), period=0.005, ratio=0.1)


STROKES = [Push("near_far", 2, 0.7, 0.4), Push("near_far", 22, 0.7, -0.3)]
BUSY = [Push("near_far", 2.0 * k, 1.0, 0.3 * (-1) ** k) for k in range(20)]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [Kind.ANGLE, Kind.RATE])
def test_full_speed_by_single_strokes(kind: Kind) -> None:
    finding = identify("near_far", "", [drive(STROKES, 45.0, kind, 1)])
    check_driven(finding)
    assert finding.free and finding.free.swings > 10
    assert finding.free.segments[0].segment.start_s > 2.7 + 0.5  # not while it was driven


@pytest.mark.slow
@pytest.mark.parametrize("kind", [Kind.ANGLE, Kind.RATE])
def test_never_free_but_driven(kind: Kind) -> None:
    finding = identify("near_far", "", [drive(BUSY, 41.0, kind, 2)])
    check_driven(finding)
    assert finding.free is None
    assert any("from driven motion" in note for note in finding.notes)


def check_driven(finding: SwingFinding) -> None:
    check(finding, truth(EMPTY, NEAR_FAR), period=0.01, ratio=0.2)
    assert finding.full_speed_m_s
    assert finding.full_speed_m_s.value == pytest.approx(1.0, rel=0.12)


@pytest.mark.slow
def test_driving_in_the_log_is_not_taken_for_a_free_swing() -> None:
    """Without commands too: the shape tells where the free swing begins."""
    reported = driven(40.0, STROKES)
    time = np.array([s.time_s for s, _ in reported])
    angle = np.array([s.theta6_rad for s, _ in reported])
    finding = identify("near_far", "", [noisy(time, angle, 4, 0.05)])
    check(finding, truth(EMPTY, NEAR_FAR), period=0.005)
    assert finding.free
    assert len(finding.free.segments) == 2
    for part, stroke in zip(finding.free.segments, STROKES, strict=True):
        ended = stroke.start_s + stroke.duration_s
        assert ended < part.segment.start_s < ended + 2.0


def test_a_slow_sensor_with_jitter_and_lost_values() -> None:
    time, angle = swung(EMPTY, 5.0, SLEW)
    random = np.random.default_rng(5)
    keep = (np.arange(len(time)) % 7 == 0) & (random.random(len(time)) > 0.1)
    shaken = time[keep] + random.uniform(0.0, 0.01, int(keep.sum()))
    value = np.interp(shaken, time, angle)
    finding = identify("slew", "", [noisy(shaken, value, 6, 0.1)])
    check(finding, truth(EMPTY, SLEW), period=0.003)


def test_a_hole_in_the_log_parts_a_swing() -> None:
    time, angle = swung(EMPTY, 10.0, SLEW)
    keep = (time < 8.0) | (time > 14.0)
    finding = identify("slew", "", [noisy(time[keep], angle[keep], 7, 0.05)])
    check(finding, truth(EMPTY, SLEW), period=0.005)
    assert finding.free and len(finding.free.segments) == 2


@pytest.mark.slow
def test_several_logs_count_together() -> None:
    time, angle = swung(EMPTY, 2.0, SLEW, 20.0)
    logs = [noisy(time, angle, seed, 0.2, memory=0.9) for seed in range(4)]
    one, all_ = identify("slew", "", logs[:1]), identify("slew", "", logs)
    assert one.period_s and all_.period_s and all_.free
    assert len(all_.free.segments) == 4
    assert all_.period_s.half < 0.8 * one.period_s.half


@pytest.mark.slow
def test_swings_that_differ_widen_the_interval() -> None:
    """Another pose, another rope, wind: what one log cannot know."""
    grapples = [Grapple(l2_m=length) for length in (1.14, 1.2, 1.26)]
    swings = [swung(g, 8.0, NEAR_FAR) for g in grapples]
    logs = [noisy(time, angle, seed, 0.05) for seed, (time, angle) in enumerate(swings)]
    finding = identify("near_far", "", logs)
    assert finding.period_s
    assert finding.period_s.value == pytest.approx(truth(EMPTY, NEAR_FAR)[0], rel=0.01)
    periods = [truth(g, NEAR_FAR)[0] for g in grapples]
    assert 0.5 * (periods[2] - periods[0]) < finding.period_s.half < 4.0 * (periods[2] - periods[0])
