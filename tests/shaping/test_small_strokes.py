"""Taps and small strokes: one movement, as long as the joystick asked for."""

import math
import random
from itertools import pairwise
from unittest.mock import Mock

import pytest

from canshaper.shaping.limits import OutputLimits, ValveCurve
from canshaper.shaping.shapers.fir import Fir, zv_taps
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.limit_aware import LimitAware
from canshaper.shaping.small_strokes import SMALL_S, SmallStrokes, least_velocity
from canshaper.shaping.states import CommandInput
from canshaper.shaping.sway import Measured, SensorLimits, SensorTiming
from tests.shaping.observed import sensed_sway
from tests.shaping.taps import LIMITS, MODE, TICK_S, axis_with, tapped

LEVELS = (0.1, 0.13, 0.2, 0.34, 0.55, 0.79, 1.0)
CURVE = ValveCurve((-1, -0.1, 0.1, 1), (-1, 0, 0, 0.8))
SENSOR = SensorTiming(Measured.ANGLE, TICK_S, 0.0, 0.0, lost_s=0.07)
DURATIONS = (0.06, 0.1, 0.14, 0.2, 0.3, 0.36, 0.46, 1.0)


def movements(sent: list[float]) -> int:
    return sum(before == 0.0 != after for before, after in pairwise([0.0, *sent]))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("level", LEVELS)
def test_a_tap_is_one_movement_of_its_length(level: float, sign: float) -> None:
    for duration_s in DURATIONS:
        sent = tapped(axis_with(), sign * level, duration_s)
        commanded_s = sign * level * round(duration_s / TICK_S) * TICK_S
        assert movements(sent) == 1, duration_s
        assert sum(sent) * TICK_S == pytest.approx(commanded_s, rel=0.05), duration_s
        assert all(velocity * sign >= 0.0 for velocity in sent)
        assert max(map(abs, sent)) <= level


@pytest.mark.parametrize(
    ("limits", "steps"),
    [
        (LIMITS, 1000),
        (OutputLimits(tail_s=2.2), 125),
        (OutputLimits(deadband=0.054, tail_s=2.2), 125),  # its first step is next to nothing
        (OutputLimits(deadband=0.05, minimum=0.03, tail_s=2.2), 125),
        (OutputLimits(deadband=0.05, tail_s=2.2, rise_per_s=0.5, fall_per_s=0.5), 125),
        (OutputLimits(tail_s=2.2, curve=CURVE), 125),
    ],
    ids=["fine grid", "no deadband", "odd deadband", "minimum", "slow valve", "curve"],
)
@pytest.mark.parametrize("level", [0.1, 0.3])
@pytest.mark.parametrize("duration_s", [0.1, 0.3])
def test_so_it_is_on_other_valves(
    limits: OutputLimits, steps: int, level: float, duration_s: float
) -> None:
    sent = tapped(axis_with(limits, steps), level, duration_s)
    least = least_velocity(limits, steps) * TICK_S
    commanded_s = level * round(duration_s / TICK_S) * TICK_S
    assert movements(sent) == 1
    assert sum(sent) * TICK_S == pytest.approx(commanded_s, rel=0.05, abs=least)


def test_the_valve_rests_between_taps_and_each_is_a_movement_of_its_own() -> None:
    axis = axis_with()
    sent = [*tapped(axis, 0.1, 0.1), *tapped(axis, 0.1, 0.1), *tapped(axis, -0.1, 0.1)]
    assert movements(sent) == 3
    assert sum(sent) * TICK_S == pytest.approx(0.01, rel=0.05)


def test_taps_one_after_another_are_as_long_as_all_of_them() -> None:
    axis = axis_with()
    sent = [v for _ in range(5) for v in tapped(axis, 0.1, 0.1, rest_s=0.3)]
    sent += tapped(axis, 0.0, 0.0)
    assert movements(sent) == 1
    assert sum(sent) * TICK_S == pytest.approx(0.05, rel=0.05)


def test_a_large_stroke_is_what_the_filter_makes_of_it() -> None:
    """Of the same numbers, whether there is a rule for small ones or not."""
    with_rule, without = axis_with(), axis_with(shaper="ruleless")
    for level, duration_s in ((1.0, 2.0), (0.7, 1.6), (-0.6, 3.0)):
        assert tapped(with_rule, level, duration_s) == tapped(without, level, duration_s)
    assert tapped(with_rule, 0.1, 0.1) != tapped(without, 0.1, 0.1)


def test_after_a_large_stroke_a_small_one_may_damp_its_swing() -> None:
    """By travel that no one asked for: limits have cut the large one short."""
    limits = OutputLimits(deadband=0.05, tail_s=2.2)  # not along the filter after a reversal
    with_rule, without = axis_with(limits), axis_with(limits, shaper="ruleless")
    for axis in (with_rule, without):
        tapped(axis, 1.0, 1.0, rest_s=0.0)
        tapped(axis, -0.6, 0.3, rest_s=1.0)
    assert tapped(with_rule, -0.3, 0.2) == tapped(without, -0.3, 0.2)


def test_after_a_reversal_there_is_travel_both_ways() -> None:
    """They cancel out in what is due: the filter goes its way."""
    with_rule, without = axis_with(), axis_with(shaper="ruleless")
    for axis in (with_rule, without):
        tapped(axis, 0.8, 0.3, rest_s=0.0)
    assert tapped(with_rule, -0.8, 0.3, 1.6) == tapped(without, -0.8, 0.3, 1.6)


def test_a_filter_that_goes_further_is_left_alone() -> None:
    """G_FF catches its own first movement by a second one: travel that no one asked for."""
    sent = tapped(axis_with(shaper="gff"), 0.3, 0.1)
    assert movements(sent) > 1
    assert sum(sent) * TICK_S > 0.05


def test_without_a_filter_the_axis_stops_at_once() -> None:
    assert not any(tapped(axis_with(shaper="off"), 0.3, 0.1)[8:])


@pytest.mark.parametrize("ticks", [1, 7])
def test_missed_ticks_are_travelled_too(ticks: int) -> None:
    axis = axis_with()
    way = 0.0
    for tick in range(160):
        axis.tick(CommandInput(0.1 if tick < 10 else 0.0))
        way += axis.output.setpoint
        if tick == 30:
            assert axis.output.setpoint
            axis.hold(ticks)
            way += ticks * axis.output.setpoint
    assert way == pytest.approx(1.0, rel=0.05)


def test_of_what_was_commanded_in_bypass_nothing_is_known() -> None:
    """The filter has seen it, and goes on with it."""
    with_rule, without = axis_with(), axis_with(shaper="ruleless")
    for axis in (with_rule, without):
        for _ in range(100):
            axis.tick(CommandInput(0.3, bypass=True))
        axis.tick(CommandInput(0.3))
    assert tapped(with_rule, 0.0, 0.0) == tapped(without, 0.0, 0.0)
    assert movements(tapped(with_rule, 0.1, 0.1)) == 1  # from rest it is known again


@pytest.mark.parametrize("command", [0.1, 0.0])
def test_after_a_retune_nothing_is_known_until_it_rests(command: float) -> None:
    """A step is not held to the end of the tail for what another filter would have made."""
    axis = axis_with()
    tapped(axis, 0.1, 0.1, rest_s=0.2)
    axis.demand = command
    axis.retune(MODE, lambda sway: LimitAware(sway, Fir(zv_taps(MODE, TICK_S)), 5.0))
    sent = tapped(axis, 0.0, 0.0)
    assert not any(sent[80:])
    assert movements(tapped(axis, 0.1, 0.1)) == 1


def test_what_another_axis_wants_in_vain_is_not_due() -> None:
    """Of an added velocity that is cut, the axis' own part takes the rest."""
    small = SmallStrokes(LIMITS, 125, TICK_S)
    for _ in range(100):
        assert small.output(0.0, 0.35, 0.0, 0.0, 0.0) == 0.0
    small.output(0.1, 0.0, 0.0, 0.0, 0.1)
    assert small.output(0.0, 0.0, 0.0, 0.0, 0.1) == least_velocity(LIMITS, 125)


@pytest.mark.parametrize("path", [0.05, -0.05])
def test_what_is_added_for_the_path_is_no_part_of_the_stroke(path: float) -> None:
    axis = axis_with()
    axis.allow_added(0.25, 5.0)
    own = added = 0.0
    for tick in range(200):
        axis.tick(CommandInput(0.1 if tick < 5 else 0.0), path if 10 <= tick < 40 else 0.0)
        own += axis.output.applied
        added += axis.output.setpoint - axis.output.applied
    assert added == pytest.approx(30 * path)
    assert own == pytest.approx(0.5, rel=0.05)


LEAST = least_velocity(LIMITS, 125)
MOST = SMALL_S / TICK_S * LEAST  # full speed times ticks; larger strokes are not small


def test_nothing_is_due_of_an_axis_that_was_not_commanded_yet() -> None:
    small = SmallStrokes(LIMITS, 125, TICK_S)
    assert small.output(0.0, 0.0, 0.5, 0.0, 1.0) == 0.0
    small.output(0.1, 0.0, 0.0, 0.0, 1.0)
    assert small.output(0.0, 0.0, 0.5, 0.0, 1.0) == 0.1


@pytest.mark.parametrize(("more", "ends"), [(0.0, True), (1e-9, False)])
def test_strokes_are_small_up_to_what_the_least_step_would_take_too_long_for(
    more: float, ends: bool
) -> None:
    """In missed ticks, and in both directions: of the filter's output nothing is due."""
    small = SmallStrokes(LIMITS, 125, TICK_S)
    most = MOST * (1.0 + more)
    small.hold(0.25 * most, 0.25 * most, 2)
    small.hold(-0.5 * most, -0.5 * most, 1)
    assert small.output(0.0, 0.0, 0.3, 0.0, 1.0) == (0.0 if ends else 0.3)


def test_after_a_large_stroke_small_ones_are_known_again_from_rest() -> None:
    small = SmallStrokes(LIMITS, 125, TICK_S)
    small.hold(0.5 * MOST, 0.0, 3)
    assert small.output(0.0, 0.0, 0.3, 0.0, 1.0) == 0.3
    small.output(0.0, 0.0, 0.0, 0.0, 0.0)
    small.output(0.1, 0.0, 0.0, 0.0, 1.0)
    assert small.output(0.0, 0.0, 0.3, 0.0, 1.0) == 0.1


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_of_half_a_tick_at_the_least_step_no_movement_is_made(sign: float) -> None:
    for due, sent in ((0.5 * LEAST, 0.0), (math.nextafter(0.5 * LEAST, 1.0), LEAST)):
        small = SmallStrokes(LIMITS, 125, TICK_S)
        small.hold(sign * due, 0.0, 1)
        low, high = (0.0, 0.2) if sign > 0.0 else (-0.2, 0.0)
        assert small.output(0.0, 0.0, 0.0, low, high) == sign * sent


def test_a_frame_of_one_step_has_full_speed_only() -> None:
    assert least_velocity(LIMITS, 1) == 1.0


def test_a_step_that_is_held_ends_with_the_tail() -> None:
    """Whatever is due: a valve's rate has kept the axis from it."""
    limits = OutputLimits(deadband=0.05, tail_s=0.4, rise_per_s=0.1)
    sent = tapped(axis_with(limits), 1.0, 0.1)
    assert sum(sent) * TICK_S < 0.05
    assert any(sent[20:])
    assert not any(sent[26:])


@pytest.mark.parametrize("seed", range(30))
def test_it_is_never_faster_than_asked_nor_against_the_joystick(seed: int) -> None:
    hand = random.Random(seed)
    axis = axis_with(OutputLimits(deadband=0.05, tail_s=0.5), steps=hand.choice([20, 125]))
    tail, before, moved = [0.0], 0.0, 0
    for _ in range(60):
        command = hand.choice([0.0, 0.0, hand.uniform(-0.3, 0.3)])
        for _ in range(hand.randint(1, 12)):
            axis.tick(CommandInput(command))
            tail = [*tail[-25:], axis.demand]
            low = 0.0 if axis.demand > 0.0 else min(0.0, *tail)
            high = 0.0 if axis.demand < 0.0 else max(0.0, *tail)
            if not low <= axis.output.setpoint <= high:  # on its way back by the rate
                assert abs(axis.output.setpoint) < abs(before)
            before = axis.output.setpoint
            moved += before != 0.0
    assert moved > 50


@pytest.mark.parametrize(
    ("limits", "steps", "velocity"),
    [
        (OutputLimits(), 125, 1 / 125),
        (OutputLimits(deadband=0.05), 125, (7 / 125 - 0.05) / 0.95),
        (OutputLimits(deadband=0.0559), 125, (8 / 125 - 0.0559) / 0.9441),
        (OutputLimits(minimum=0.021), 125, 3 / 125),
        (OutputLimits(minimum=3 / 125), 125, 3 / 125),  # what is just enough is enough
        (OutputLimits(curve=CURVE), 125, (14 / 125 - 0.1) * 0.8 / 0.9),
        (OutputLimits(deadband=0.5), 1, 1.0),
    ],
)
def test_the_least_velocity_of_a_frame(limits: OutputLimits, steps: int, velocity: float) -> None:
    assert least_velocity(limits, steps) == pytest.approx(velocity)


def test_small_strokes_are_left_alone_only_while_swing_is_damped() -> None:
    plain = tapped(axis_with(), 0.1, 0.1)
    sent = {}
    for weight in (0.0, 0.5):
        axis = axis_with()
        sway = axis.sway
        assert sway is not None
        axis.sensed = sensed_sway(sway, SENSOR, SensorLimits(0.002, 0.05), damps=True)
        sent[weight] = []
        for tick in range(len(plain)):
            axis.sensed.weight = weight
            axis.tick(CommandInput(0.1 if tick < 5 else 0.0))
            sent[weight].append(axis.output.setpoint)
    assert sent[0.0] == plain
    assert sent[0.5] != plain


def test_missed_ticks_count_and_a_retune_and_a_stop_lose_the_travel() -> None:
    axis = axis_with()
    for _ in range(20):
        axis.tick(CommandInput(0.3))
    axis.stage.small = small = Mock(wraps=axis.stage.small)
    axis.hold(5)
    small.hold.assert_called_once_with(axis.demand, axis.output.applied, 5)
    axis.tick(CommandInput(0.3))
    assert not small.lose.called
    axis.retune(MODE, lambda sway: Gff(sway, (-5.0, -4.0)))
    assert small.lose.call_count == 1
    axis.tick(CommandInput(enabled=False))
    assert small.lose.call_count == 2
