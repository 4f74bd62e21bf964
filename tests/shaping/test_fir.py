import math
import random
import tracemalloc

import numpy as np
import pytest

from canshaper.shaping.shapers.fir import Fir, convolved, ei_taps, stretched, zv_taps
from canshaper.shaping.sway import SwayMode
from tests.rigs.residual import residual_left

MODES = [SwayMode.from_period(2.2, zeta) for zeta in (0.0, 0.05, 0.3)]
TICKS_S = (0.001, 0.01, 0.02, 0.05)


@pytest.mark.parametrize("tick_s", TICKS_S)
@pytest.mark.parametrize("mode", MODES, ids=lambda m: f"zeta {m.damping_ratio}")
def test_zv_leaves_nothing_at_any_tick(mode: SwayMode, tick_s: float) -> None:
    taps = zv_taps(mode, tick_s)
    assert math.fsum(taps) == pytest.approx(1.0, abs=1e-12)
    assert min(taps) >= 0.0
    assert residual_left(taps, mode, tick_s) < 2e-9
    # half a swing long, to the tick
    assert len(taps) - 1 == math.ceil(0.5 * mode.period_s / tick_s - 1e-9)


# 55 ticks to half a swing, 36 2/3, 1 2/9 (impulses share a tick), and 2/5
@pytest.mark.parametrize("tick_s", [0.02, 0.03, 0.9, 2.75])
@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_ei_has_three_impulses_that_lose_what_the_swing_loses(
    damping: float, tick_s: float
) -> None:
    mode, residual = SwayMode.from_period(2.2, damping), 0.05
    taps = ei_taps(mode, tick_s, residual)
    lost = math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2))  # over half a swing
    weights = [0.25 * (1.0 + residual), 0.5 * (1.0 - residual) * lost]
    weights.append(weights[0] * lost**2)
    # an impulse between two ticks is shared by them, the nearer one takes more
    ticks = np.arange(math.ceil(2.2 / tick_s - 1e-9) + 1)
    hats = [np.maximum(0.0, 1.0 - abs(ticks - k * 1.1 / tick_s)) for k in range(3)]
    expected = sum(w * hat for w, hat in zip(weights, hats, strict=True)) / math.fsum(weights)
    assert taps == pytest.approx(expected.tolist(), abs=1e-12)
    # and at its period a swing is left as designed, in parts of the sum of the impulses
    left = residual_left(taps, mode, tick_s)
    assert left == pytest.approx(residual / math.fsum(weights), abs=(2.9 * tick_s) ** 2 / 8.0)


def test_shapers_in_series_are_the_convolution_and_no_longer() -> None:
    one, two = [0.5, 0.0, 0.5], [0.2, 0.3, 0.4, 0.1]
    assert convolved(one, two) == pytest.approx(np.convolve(one, two).tolist(), abs=1e-15)


def test_fir_is_the_convolution_of_the_newest_commands() -> None:
    source = random.Random(1)
    taps = [source.random() for _ in range(30)]
    taps = [t / math.fsum(taps) for t in taps]
    commands = [source.uniform(-1.0, 1.0) for _ in range(200)]
    fir = Fir(taps)
    out = [fir.step(c) for c in commands]
    assert out == pytest.approx(np.convolve(commands, taps)[:200].tolist(), abs=1e-12)
    assert max(map(abs, out)) <= max(map(abs, commands))


@pytest.mark.parametrize("taps", [[], [0.5, 0.4], [1.0, math.nan], [0.0]])
def test_taps_that_are_no_shaper_are_refused(taps: list[float]) -> None:
    with pytest.raises(ValueError, match=r"sum of the taps: expected 1, got .*"):
        Fir(taps)


@pytest.mark.parametrize("taps", [[0.5, 0.4995], [0.5, 0.5005]])
def test_taps_rounded_in_a_file_still_reach_the_command(taps: list[float]) -> None:
    fir = Fir(taps)
    assert math.fsum(fir.taps) == pytest.approx(1.0, abs=1e-15)
    assert [fir.step(1.0) for _ in range(2)][-1] == pytest.approx(1.0, abs=1e-15)
    assert fir.taps == pytest.approx([tap / math.fsum(taps) for tap in taps], abs=1e-15)


def test_a_long_day_takes_no_memory() -> None:
    fir = Fir([0.25] * 4)
    fir.step(0.5)
    tracemalloc.start()
    try:
        for _ in range(20_000):
            fir.step(0.5)
        grown, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert grown < 20_000  # a place kept for every command would take eight bytes each


@pytest.mark.parametrize("factor", [0.5, 0.84, 1.0, 1.07, 1.4, 2.0])
def test_taps_drawn_out_do_for_a_swing_that_is_so_much_slower(factor: float) -> None:
    taps = [0.1] * 3 + [0.03] + [0.0] * 39 + [0.005] + [0.1] * 4 + [0.007] + [0.0] * 39
    taps += [0.058, 0.1, 0.1]
    mode = SwayMode(2.67, 0.038)
    slower = SwayMode(mode.omega_rad_s / factor, mode.damping_ratio)
    drawn = stretched(taps, factor)
    assert len(drawn) == math.ceil(len(taps) * factor - 1e-9)
    assert min(drawn) >= 0.0
    assert math.fsum(drawn) == pytest.approx(math.fsum(taps), abs=1e-12)
    left = residual_left(taps, mode, 0.02)
    assert residual_left(drawn, slower, 0.02) == pytest.approx(left, abs=0.004)
    if factor == 1.0:
        assert drawn == pytest.approx(taps, abs=1e-15)


def test_in_its_own_time_a_response_is_what_it_was() -> None:
    for taps in ([1.0], [0.3, 0.7], [0.2, 0.3, 0.5]):
        assert stretched(taps, 1.0) == pytest.approx(taps, abs=1e-15)
