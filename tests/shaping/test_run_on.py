"""Bounds of the run-on: how far it goes beyond the demand, how long against the joystick."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from canshaper.commissioning.stopping import needed_s, travel
from canshaper.machine.stop_distance import allowed_s
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits, ValveCurve
from canshaper.shaping.states import CommandInput, Reason, State
from tests.shaping.added_pair import run
from tests.shaping.test_stopping import axis_with

DriveWith = Callable[..., Any]
TICK_S = 0.02
STEP = 1.0 / 125
LIMITS = OutputLimits(tail_s=2.0, rise_per_s=5.0, fall_per_s=4.0, run_on=0.5, reversal_s=0.45)
LATE = Reason.LOOP_OVERRUN


class Anything:
    """A filter that asks for whatever the test says."""

    def __init__(self, asks: float = 0.0) -> None:
        self.asks = asks

    def step(self, command: float) -> float:
        return self.asks


def axis_of(shaper: Anything, limits: OutputLimits = LIMITS) -> ShapedAxis:
    axis = ShapedAxis(TICK_S, limits, sway=None, shaper=shaper, stop_s=5.0)
    axis.tick(CommandInput())
    return axis


velocities = st.sampled_from([-1.0, -0.7, -0.1, 0.0, 0.03, 0.3, 1.0])
strokes = st.lists(st.tuples(velocities, velocities, st.integers(1, 30)), min_size=1, max_size=6)


@given(strokes, st.lists(velocities, min_size=1, max_size=5), st.booleans())
@example([(1.0, 1.0, 30)], [1.0], False)
@example([(1.0, 1.0, 30), (-1.0, 1.0, 6)], [1.0, -1.0], False)
def test_it_goes_no_farther_than_the_limit(
    before: list[tuple[float, float, int]], after: list[float], lost: bool
) -> None:
    """Whatever the filter asks for, before and after the release, and in a shaped stop."""
    shaper = Anything()
    axis = axis_of(shaper)
    for command, shaper.asks, ticks in before:
        run(axis, ticks, command)
    way = 0.0
    for tick in range(150):
        shaper.asks = after[tick // 7 % len(after)]
        axis.tick(CommandInput(fault=LATE if lost else None))
        way += abs(axis.output.setpoint) * TICK_S
    # A tick at full speed while it rises, and the rounding of each frame.
    assert way <= LIMITS.run_on + TICK_S + 150 * TICK_S * 0.5 * STEP
    assert axis.output.setpoint == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_reaches_the_limit_and_falls(sign: float) -> None:
    axis = axis_of(Anything(sign))
    run(axis, 40, sign)
    seen = []
    while axis.output.setpoint:
        axis.tick(CommandInput())
        seen.append(sign * axis.output.setpoint)
    assert sum(seen) * TICK_S == pytest.approx(0.5, abs=0.03)
    fall = 4.0 * TICK_S
    assert seen[-14:-1] == pytest.approx([1.0, *(1.0 - fall * n for n in range(1, 13))], abs=STEP)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("turns", [20, 999])
def test_what_is_added_beyond_its_bound_counts_too(sign: float, turns: int) -> None:
    """As fast as was asked within the tail, to one side or to both; then as what may be added."""
    axis = axis_of(Anything(), replace(LIMITS, tail_s=4.0))
    axis.allow_added(0.25, 9.0)
    for tick in range(60):
        axis.tick(CommandInput(sign if tick // 20 % 2 else -sign))
    sent = []
    for tick in range(140):
        axis.tick(CommandInput(), sign if tick // turns % 2 else -sign)
        sent.append(abs(axis.output.setpoint))
    beyond = sum(max(size - 0.25, 0.0) for size in sent) * TICK_S
    assert beyond == pytest.approx(0.5, abs=TICK_S)
    assert max(sent[-40:]) == pytest.approx(0.25, abs=STEP)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_lower_demand_bounds_what_runs_on_beyond_it(sign: float) -> None:
    """The axis ends at the demand, which goes on for as long as it is held."""
    axis = axis_of(Anything(sign))
    run(axis, 40, sign)
    beyond = 0.0
    for _ in range(200):
        axis.tick(CommandInput(sign * 0.3))
        beyond += (sign * axis.output.setpoint - 0.3) * TICK_S
    assert sign * axis.output.setpoint == pytest.approx(0.3, abs=STEP)
    assert beyond == pytest.approx(0.5, abs=0.03)
    way = 0.0  # and from there the whole way again
    for _ in range(99):  # the tail of what was asked first is over
        axis.tick(CommandInput())
        way += sign * axis.output.setpoint * TICK_S
    assert way == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_against_the_joystick_the_way_counts_as_in_neutral(sign: float) -> None:
    axis = axis_of(Anything(sign), replace(LIMITS, reversal_s=5.0))
    run(axis, 40, sign)
    way = 0.0
    for _ in range(60):
        axis.tick(CommandInput(-sign))
        way += sign * axis.output.setpoint * TICK_S
    assert way == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_new_stroke_has_the_whole_way_again(sign: float) -> None:
    shaper = Anything(sign)
    axis = axis_of(shaper)
    ways = []
    for _ in range(2):
        run(axis, 40, sign)
        way = 0.0
        for _ in range(100):
            axis.tick(CommandInput())
            way += sign * axis.output.setpoint * TICK_S
        ways.append(way)
    assert ways[0] == pytest.approx(0.5, abs=0.03)
    assert ways[1] == pytest.approx(ways[0])


def test_missed_ticks_count_as_way() -> None:
    axis = axis_of(Anything(1.0))
    run(axis, 40, 1.0)
    way = 0.0
    for _ in range(60):
        axis.tick(CommandInput())
        way += axis.output.setpoint * TICK_S
        if way == pytest.approx(0.1):
            axis.hold(8)
            way += 8 * axis.output.setpoint * TICK_S
    assert way == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("lost", [False, True])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("size", [0.03, 1.0])
def test_against_the_joystick_it_ends_in_time(sign: float, lost: bool, size: float) -> None:
    axis = axis_of(Anything(sign), replace(LIMITS, run_on=9.0))
    run(axis, 40, sign)
    fault = LATE if lost else None
    old = []
    for _ in range(60):
        axis.tick(CommandInput(-sign * size, fault=fault))
        old.append(sign * axis.output.setpoint > 0.0)
    assert old == [True] * 22 + [False] * 38  # 0.2 s, and the fall of 0.25 s


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("reversal_s", [0.0, 0.45])
def test_a_touch_the_other_way_is_enough(sign: float, reversal_s: float) -> None:
    """The old direction ends in the same time when the joystick is let go of again."""
    axis = axis_of(Anything(sign), replace(LIMITS, run_on=9.0, reversal_s=reversal_s))
    run(axis, 40, sign)
    axis.tick(CommandInput(-sign))
    run(axis, round(max(reversal_s, 0.25) / TICK_S))
    for _ in range(100):
        assert axis.output.setpoint == 0.0
        axis.tick(CommandInput())


def test_missed_ticks_count_as_time_against_the_joystick() -> None:
    axis = axis_of(Anything(1.0), replace(LIMITS, run_on=9.0))
    run(axis, 40, 1.0)
    run(axis, 5, -1.0)
    axis.hold(5)
    assert axis.output.setpoint == 1.0
    axis.tick(CommandInput(-1.0))
    assert axis.output.setpoint < 1.0


def test_with_allow_reverse_the_old_direction_has_no_time() -> None:
    axis = axis_of(Anything(1.0), replace(LIMITS, run_on=9.0, allow_reverse=True))
    run(axis, 40, 1.0)
    run(axis, 60, -1.0)
    assert (axis.output.setpoint, axis.state) == (1.0, State.ACTIVE)


@pytest.mark.parametrize("kind", ["first_order", "gff", "zv"])
def test_what_a_filter_needs_cuts_nothing_of_it(kind: str) -> None:
    parameters = {"first_order": {"time_constant_s": 0.3}, "gff": {"a1": 0.42, "a2": 0.043}}
    times = {"timeout_s": 0.1, "period_s": TICK_S}
    free = OutputLimits(tail_s=2.0)

    def axis(limits: OutputLimits) -> ShapedAxis:
        return axis_with(limits, kind, **parameters.get(kind, {}))

    needed = needed_s(lambda: axis(free), free.tail_s, **times)
    waits = 0.1 + 2 * TICK_S
    exact = replace(free, run_on=needed - waits + TICK_S)
    got, whole = (travel(lambda one=one: axis(one), **times) for one in (exact, free))
    assert (got.release, got.lost) == pytest.approx((whole.release, whole.lost), abs=1e-3)
    short = replace(free, run_on=0.8 * (needed - waits))
    assert travel(lambda: axis(short), **times).lost < whole.lost - 0.01
    assert allowed_s(short, stop_s=5.0, **times) == pytest.approx(short.run_on + waits)


def test_a_slow_valve_needs_the_wait_for_its_command() -> None:
    times = {"timeout_s": 0.6, "period_s": 0.2}
    needed = needed_s(lambda: axis_with(OutputLimits(), "off", period_s=0.2), 2.0, **times)
    assert needed == pytest.approx(1.0, abs=0.01)  # timeout and two periods; it falls in one


@pytest.mark.parametrize("speeds", [[-1.0, 0.0, 0.0, 0.5], [-0.5, 0.0, 0.0, 1.0]])
def test_the_quicker_side_of_a_valve_counts(speeds: list[float]) -> None:
    limits = OutputLimits(curve=ValveCurve([-1.0, -0.05, 0.05, 1.0], speeds))
    needed = needed_s(lambda: axis_with(limits), limits.tail_s, timeout_s=0.1, period_s=TICK_S)
    assert needed == pytest.approx(0.14 + 0.09, abs=1e-3)
