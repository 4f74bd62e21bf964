"""Sets of sway data and filter: between two of them, and bumpless in motion."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.registry import (
    KINDS,
    STEPS_BETWEEN,
    ParameterSet,
    at_position,
    build_shaper,
    position,
)
from canshaper.shaping.shapers.fir import Fir, zv_taps
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.shapers.limit_aware import LimitAware
from canshaper.shaping.shapers.smoothing import FirstOrder, SCurve
from canshaper.shaping.states import CommandInput
from canshaper.shaping.sway import SwayMode, SwayModel

TICK_S = 0.02
EMPTY = SwayMode.from_period(2.0, 0.03)
FULL = SwayMode.from_period(2.8, 0.05)
SETS = (
    ParameterSet(0.0, EMPTY, "gff", {"a1": 0.7, "a2": 0.12}),
    ParameterSet(800.0, FULL, "gff", {"a1": 1.0, "a2": 0.2}),
)


@pytest.mark.parametrize(
    ("value", "steps"),
    [(-50, 0), (0, 0), (400, STEPS_BETWEEN // 2), (800, STEPS_BETWEEN), (5000, STEPS_BETWEEN)],
)
def test_values_beyond_the_ends_are_the_ends(value: float, steps: int) -> None:
    assert position(SETS, value) == steps


def test_the_ends_are_the_sets_themselves() -> None:
    assert at_position(SETS, 0) is SETS[0]
    assert at_position(SETS, STEPS_BETWEEN) is SETS[1]


MODES = st.builds(SwayMode, st.floats(0.5, 50.0), st.floats(0.0, 0.95))


@given(MODES, MODES, st.integers(1, STEPS_BETWEEN - 1))
def test_a_mode_between_is_never_an_error_nor_quicker_than_both(
    first: SwayMode, second: SwayMode, steps: int
) -> None:
    """Quicker than both it could be too quick for a tick that both suit."""
    mode = first.towards(second, steps / STEPS_BETWEEN)
    assert mode.omega_rad_s <= max(first.omega_rad_s, second.omega_rad_s) * (1.0 + 1e-12)


def test_the_mode_between_is_that_of_its_period_to_the_last_bit() -> None:
    mode = EMPTY.towards(FULL, 0.375)
    period_s = EMPTY.period_s + 0.375 * (FULL.period_s - EMPTY.period_s)
    assert mode == SwayMode.from_period(period_s, 0.03 + 0.375 * (0.05 - 0.03))


def test_taps_stay_taps() -> None:
    sets = [
        ParameterSet(0.0, EMPTY, "robust", {"taps": [0.5, 0.5]}),
        ParameterSet(1.0, FULL, "robust", {"taps": [0.25, 0.25, 0.5]}),
    ]
    taps = at_position(sets, STEPS_BETWEEN // 4).parameters["taps"]
    assert taps == pytest.approx([0.4375, 0.4375, 0.125])
    assert math.fsum(taps) == pytest.approx(1.0)


def test_a_whole_number_stays_one() -> None:
    first = ParameterSet(0.0, EMPTY, "robust", {"tick_ms": 20, "taps": [1.0]})
    second = ParameterSet(1.0, FULL, "robust", {"tick_ms": 24, "taps": [1.0]})
    for steps in (1, STEPS_BETWEEN // 4, STEPS_BETWEEN // 3, STEPS_BETWEEN - 1):
        tick_ms = at_position((first, second), steps).parameters["tick_ms"]
        assert type(tick_ms) is int
        assert tick_ms == round(20 + 4 * steps / STEPS_BETWEEN)


def test_among_three_sets_the_two_around_a_value_count() -> None:
    heavy = ParameterSet(1000.0, SwayMode.from_period(3.4, 0.05), "gff", {"a1": 1.4, "a2": 0.3})
    sets = (*SETS, heavy)
    assert position(sets, 800.0) == STEPS_BETWEEN
    assert position(sets, 900.0) == STEPS_BETWEEN + STEPS_BETWEEN // 2
    assert position(sets, 1000.0) == position(sets, 1e6) == 2 * STEPS_BETWEEN
    sway_set = at_position(sets, position(sets, 900.0))
    assert (sway_set.at, sway_set.kind) == (900.0, "gff")
    assert sway_set.mode.period_s == pytest.approx(3.1)
    lower = at_position(sets, position(sets, 400.0))
    assert (lower.at, lower.mode.period_s) == (400.0, pytest.approx(2.4))


def test_poles_go_from_the_faster_one_to_the_faster_one() -> None:
    sets = (
        ParameterSet(0.0, EMPTY, "gff", {"a1": 0.5, "a2": 0.06}),  # poles -5 and -3.33
        ParameterSet(1.0, FULL, "gff", {"poles_rad_s": (-2.0, -4.0)}),
        ParameterSet(2.0, FULL, "gff", {"poles_rad_s": (-3.0, -1.0), "third_pole_rad_s": -5.0}),
    )
    first = at_position(sets, STEPS_BETWEEN // 2).parameters
    assert first == {"poles_rad_s": pytest.approx([-4.5, -8.0 / 3.0])}
    second = at_position(sets, 3 * STEPS_BETWEEN // 2).parameters
    assert second == {"poles_rad_s": pytest.approx([-3.5, -1.5])}


# -- in motion -------------------------------------------------------------------------------------


def axis_with(shaper_of: str) -> ShapedAxis:
    sway = SwayModel(EMPTY, TICK_S)
    return ShapedAxis(
        TICK_S,
        OutputLimits(rise_per_s=5.0, fall_per_s=5.0, tail_s=2.0),
        sway=sway,
        shaper=make(shaper_of, sway),
        grid_steps=10_000,
    )


def make(kind: str, sway: SwayModel) -> Shaper:
    settings = list(KINDS[kind].settings(EMPTY, TICK_S).values())
    parameters = settings[len(settings) // 2]  # of G_FF neither the quickest nor with a third pole
    return build_shaper(kind, TICK_S, sway, valve_rate_per_s=5.0, **parameters)


@pytest.mark.parametrize("new", KINDS)
@pytest.mark.parametrize("old", KINDS)
def test_a_change_in_steady_motion_is_not_felt(old: str, new: str) -> None:
    """Nothing jumps; and where the old filter has left no swing to damp, nothing changes at all."""
    axis = axis_with(old)
    axis.tick(CommandInput())
    for _ in range(800):
        axis.tick(CommandInput(0.8))
    before = last = axis.output.setpoint
    assert before == pytest.approx(0.8, abs=2e-3)
    assert axis.sway is not None
    swing = math.hypot(axis.sway.angle * EMPTY.omega_rad_s, axis.sway.rate + axis.output.applied)
    axis.retune(FULL, lambda sway: make(new, sway))
    for _ in range(150):
        axis.tick(CommandInput(0.8))
        assert abs(axis.output.setpoint - last) <= 0.02  # a fifth of the rate of the valve
        assert axis.output.setpoint == pytest.approx(before, abs=0.005 + 2.0 * swing)
        last = axis.output.setpoint


def test_a_robust_shaper_keeps_its_history_through_a_change() -> None:
    """Half-way through its taps: without them the output would fall to what is new."""
    axis = axis_with("robust")
    axis.tick(CommandInput())
    for _ in range(40):
        axis.tick(CommandInput(0.9))
    before = axis.output.setpoint
    axis.retune(EMPTY, lambda sway: make("robust", sway))
    for _ in range(8):
        axis.tick(CommandInput(0.9))
        assert axis.output.setpoint >= before - 1e-9


def test_a_load_that_is_known_late_has_hung_there_since_the_press_began() -> None:
    """It has swung by what was sent since, and what the twin has not asked for is damped."""
    late, known = axis_with("robust"), axis_with("robust")
    known.retune(FULL, lambda sway: make("robust", sway))
    past, own = [], SwayModel(FULL, TICK_S)
    for command in [0.0] + 25 * [0.9]:
        late.tick(CommandInput(command))
        known.tick(CommandInput(command))
        past.append(late.output.applied)
        own.step(late.output.applied)
    late.retune(FULL, lambda sway: make("robust", sway), past)
    assert late.sway is not None
    assert (late.sway.angle, late.sway.rate) == (own.angle, own.rate)
    for command in 20 * [0.9] + 60 * [0.0]:
        late.tick(CommandInput(command))
        known.tick(CommandInput(command))
        assert late.output.setpoint == pytest.approx(known.output.setpoint, abs=0.02)


def test_inherited_history_gives_the_same_output() -> None:
    old = Fir(zv_taps(EMPTY, TICK_S))
    for n in range(200):
        old.step(math.sin(n / 10))
    new = Fir(old.taps)
    new.copy_state(old)
    assert [new.step(0.3) for _ in range(60)] == [old.step(0.3) for _ in range(60)]


def test_a_limit_aware_shaper_goes_on_with_its_history() -> None:
    old, new = (LimitAware(SwayModel(EMPTY, TICK_S), Fir([0.1] * 10)) for _ in range(2))
    for n in range(30):
        old.step(0.02 * n)
    new.copy_state(old)
    assert [new.step(0.6) for _ in range(12)] == [old.step(0.6) for _ in range(12)]


def test_a_longer_shaper_takes_the_oldest_command_for_older_ones() -> None:
    old = Fir([0.5, 0.5])
    old.step(0.2)
    old.step(0.8)
    new = Fir([0.25] * 4)
    new.copy_state(old)
    assert new.step(1.0) == pytest.approx((1.0 + 0.8 + 0.2 + 0.2) / 4)
    stretchable = Fir([0.25] * 4)
    stretchable.lengthen(6)  # longer than its taps
    stretchable.copy_state(old)
    assert stretchable.step(1.0) == pytest.approx((1.0 + 0.8 + 0.2 + 0.2) / 4)
    shorter = Fir([1.0])
    shorter.copy_state(old)
    assert shorter.step(0.4) == 0.4


def test_every_shaper_begins_at_a_command() -> None:
    sway = SwayModel(EMPTY, TICK_S)
    sway.rate = -0.7  # the equilibrium under a constant 0.7
    shapers = [
        Fir([0.5, 0.5]),
        FirstOrder(TICK_S, 0.4),
        SCurve(TICK_S, 1.0, 5.0),
        Gff(sway, (-3.0, -2.0), -5.0),
        LimitAware(sway, Fir([0.5, 0.5])),
    ]
    for shaper in shapers:
        shaper.reset_to_steady_state(0.7)
        assert shaper.step(0.7) == pytest.approx(0.7, abs=1e-9)
