"""Measures of a setting, held to published ones, and what the valve does to fast poles."""

import math
from functools import partial

import pytest

from canshaper.design.tuning.evaluate import Machine, evaluate, gff, press
from canshaper.design.tuning.formulation import POLE_PER_RATE
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.registry import KINDS, build_shaper
from canshaper.shaping.sway import SwayMode
from canshaper.shaping.transfer import Off

MODE = SwayMode.from_grapple(1.2, 120.0, 300.0)
WIDE = Machine(
    OutputLimits(
        rise_per_s=1e6, fall_per_s=1e6, tail_s=20.0, allow_faster=True, allow_reverse=True
    ),
    grid_steps=10**6,
)

# poles -> largest output, time to 95 %, run-on, mean delay, residual % at -30 ... +30 % length
KNOWN = {
    (-5.655, -4.112): (2.587, 1.26, 1.26, 0.386, (31.08, 18.56, 8.43, 0, 7.14, 13.28, 18.63)),
    (-3.558, -2.342): (1.000, 1.90, 1.90, 0.674, (19.31, 11.93, 5.57, 0, 4.94, 9.38, 13.38)),
    (-5.0, -5.0): (2.778, 1.22, 1.22, 0.366, (32.17, 19.16, 8.68, 0, 7.32, 13.60, 19.06)),
    (-3.0, -3.0): (1.040, 1.78, 1.78, 0.633, (20.66, 12.72, 5.93, 0, 5.24, 9.92, 14.13)),
}


@pytest.mark.parametrize("poles", KNOWN)
def test_known_measures(poles: tuple[float, float]) -> None:
    peak, rise, run_on, delay, residuals = KNOWN[poles]
    measures = evaluate(MODE, 0.02, gff(poles))
    assert measures.peak == pytest.approx(peak, rel=2e-3)
    assert measures.rise_s == pytest.approx(rise, abs=0.021)
    assert measures.run_on_s == pytest.approx(run_on, abs=0.021)
    assert measures.mean_delay_s == pytest.approx(delay, abs=2e-3)
    assert [100.0 * r.linear for r in measures.residuals] == pytest.approx(residuals, abs=0.03)


@pytest.mark.parametrize("poles", KNOWN)
def test_a_machine_without_limits_leaves_what_the_filter_leaves(poles: tuple[float, float]) -> None:
    for residual in evaluate(MODE, 0.02, gff(poles), WIDE).residuals:
        # 1.0 is the most an axis sends, so filters that ask for more are clipped.
        within = poles[0] * poles[1] < 1.01 * MODE.omega_rad_s**2
        assert residual.machine == pytest.approx(residual.linear, abs=1e-3 if within else 0.08)


def test_no_filter_leaves_everything() -> None:
    measures = evaluate(MODE, 0.02, lambda _sway: Off())
    assert (measures.first_jump, measures.rise_s, measures.run_on_s) == (1.0, 0.0, 0.0)
    for residual in measures.residuals:
        assert residual.linear == pytest.approx(1.0)
        assert residual.machine == pytest.approx(1.0)


@pytest.mark.parametrize("kind", KINDS)
def test_every_filter_of_the_registry_can_be_measured(kind: str) -> None:
    """And leaves no more of the swing than none does."""
    for given in KINDS[kind].settings(MODE, 0.02).values():
        measures = evaluate(
            MODE, 0.02, partial(build_shaper, kind, 0.02, **given), lengths_pct=(0,)
        )
        assert measures.residuals[0].linear <= 1.0
        assert (measures.run_on_s > 0.0) is (kind != "off")


def test_a_known_filter_leaves_what_it_should() -> None:
    measures = evaluate(MODE, 0.02, lambda sway: build_shaper("zv", 0.02, sway))
    assert measures.run_on_s == pytest.approx(1.10, abs=0.021)
    assert 100.0 * measures.residuals[0].linear == pytest.approx(35.9, abs=0.2)


def test_third_pole_removes_the_jump_and_keeps_the_zeros() -> None:
    measures = evaluate(MODE, 0.02, gff((-4.0, -4.0), -4.0))
    assert measures.first_jump < 0.15
    assert measures.residuals[3].linear < 1e-9
    assert measures.run_on_s == pytest.approx(1.82, abs=0.021)


def test_a_short_tail_costs_residual_sway() -> None:
    def left(tail_s: float) -> float:
        machine = Machine(OutputLimits(tail_s=tail_s))
        return evaluate(MODE, 0.02, gff((-2.859, -2.859)), machine, (0,)).worst()

    assert left(3.0) < 0.01
    assert 0.03 < left(2.0) < left(1.0)


@pytest.mark.parametrize("omega", [1.8, 2.86, 4.5])
@pytest.mark.parametrize("rate", [2.5, 5.0, 10.0])
def test_poles_that_the_valve_allows_work_behind_it(omega: float, rate: float) -> None:
    """The table of docs/tuning.md: up to the bound all is well, half above it no more."""
    mode = SwayMode(omega, 0.03)
    machine = Machine(OutputLimits(rise_per_s=rate, fall_per_s=rate))

    def left(factor: float) -> float:
        pole = -factor * POLE_PER_RATE * math.sqrt(rate * omega)
        return evaluate(mode, 0.02, gff((pole, pole)), machine, (0,)).worst()

    assert left(1.0) < 0.07
    if omega < 4.0:
        assert left(1.5) > 0.2
    else:
        assert left(1.5) < 0.01


def test_press_is_what_the_picture_shows() -> None:
    traces = press(MODE, 0.02, gff((-2.859, -2.859)), Machine(), 4.0)
    assert len(traces.t_s) == len(traces.sent) == len(traces.swing) == len(traces.swing_raw) == 200
    assert max(traces.sent) <= 1.0
    assert abs(traces.swing[-1]) < 0.05 * max(traces.swing_raw)
    # The largest swing of a step through a lag of 0.1 s, in s: a little below 1/w.
    assert max(traces.swing_raw) == pytest.approx(1.0 / MODE.omega_rad_s, rel=0.15)
