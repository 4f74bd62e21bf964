"""An added velocity: its range, its time, and how it ends."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.shaping.added import AddedTime, range_with_added
from canshaper.shaping.axis import Axis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.fir import Fir
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.shapers.off import Off
from canshaper.shaping.states import CommandInput, Reason, State

TICK_S = 0.05
# So fine that rounding does not hide what is added.
STEPS = 1_000_000
SLACK = 1e-4
LARGEST, TIME_S = 0.25, 1.5
SHAPERS: list[Callable[[], Shaper]] = [Off, lambda: Fir([0.3, 0.1, 0.0, 0.2, 0.4])]

joysticks = st.sampled_from([0.0, 0.0, 0.021, -0.021, 0.3, -0.3, 1.0, -1.0])
additions = st.sampled_from([0.0, 0.01, -0.01, 0.2, -0.2, 1.0, -1.0]) | st.floats(-1.0, 1.0)
rates = st.sampled_from([0.3, 1.0, 5.0, 20.0])
steps = st.lists(
    st.tuples(joysticks, additions, st.integers(1, 12), st.sampled_from([0, 0, 0, 1, 3])),
    min_size=1,
    max_size=25,
)


def pair(limits: OutputLimits, shaper: Callable[[], Shaper] = Off) -> tuple[Axis, Axis]:
    """An axis that may be added to, and one to which nothing is added."""
    one, plain = (
        Axis(TICK_S, limits, sway=None, shaper=shaper(), grid_steps=STEPS) for _ in range(2)
    )
    one.allow_added(LARGEST, TIME_S)
    one.tick(CommandInput())
    plain.tick(CommandInput())
    return one, plain


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("commands", "own", "expected"),
    [
        # no one asked: what may be added to either side
        ((0.0, 0.0, 0.0), 0.0, (-0.25, 0.25)),
        # held: nothing against it, nothing faster than asked within the tail
        ((0.5, 0.5, 0.0), 0.1, (0.0, 0.5)),
        ((0.5, 0.8, 0.0), 0.1, (0.0, 0.8)),
        # held after a reversal: as far back as the own part still is
        ((0.5, 0.5, -1.0), -0.7, (-0.7, 0.5)),
        # released: as fast as asked in its direction, the added part in the other
        ((0.0, 0.1, 0.0), 0.05, (-0.25, 0.1)),
        ((0.0, 0.1, -0.4), 0.0, (-0.4, 0.1)),
        # on its way back from beyond
        ((0.0, 0.0, 0.0), 0.6, (-0.25, 0.6)),
    ],
)
def test_the_range_of_both_parts(
    sign: float,
    commands: tuple[float, float, float],
    own: float,
    expected: tuple[float, float],
) -> None:
    """Asked: now, and most within the tail to either side."""
    command, forth, back = (sign * value for value in commands)
    low, high = min(forth, back, 0.0), max(forth, back, 0.0)
    bounds = range_with_added(command, low, high, sign * own, 0.25)
    assert bounds == (expected if sign > 0.0 else (-expected[1], -expected[0]))


@given(
    rise=rates,
    fall=rates,
    maximum=st.sampled_from([1.0, 0.5]),
    shaper=st.sampled_from(SHAPERS),
    inputs=steps,
)
def test_whatever_is_asked_speed_and_time_are_bounded(
    rise: float,
    fall: float,
    maximum: float,
    shaper: Callable[[], Shaper],
    inputs: list[tuple[float, float, int, int]],
) -> None:
    limits = OutputLimits(rise_per_s=rise, fall_per_s=fall, maximum=maximum, tail_s=0.4)
    one, plain = pair(limits, shaper)
    recent_commands: list[tuple[int, float]] = []
    now = alone = 0
    for command, added, ticks, missed in inputs:
        if missed:
            for axis in (one, plain):
                axis.hold(missed)
            now += missed
        for _ in range(ticks):
            now += 1
            alone = 0 if one.commanded or not added or one.raw == 0 else alone + 1
            before = one.sent
            one.tick(CommandInput(command), added)
            plain.tick(CommandInput(command))
            if abs(command) > 0.02:
                recent_commands.append((now, command))
            recent = [c for at, c in recent_commands if now - at <= 8]
            for sign in (1.0, -1.0):
                most = max([0.0, *(sign * c for c in recent)])
                if not most and sign * command > -0.02:
                    most = LARGEST
                falling = min(sign * before, sign * before - fall * TICK_S + SLACK)
                allowed = max(min(most, maximum), sign * plain.sent, falling)
                assert sign * one.sent <= allowed + SLACK
            if alone > 1 + (TIME_S + 1.0 / fall) / TICK_S:
                assert one.sent == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_time_counts_while_the_axis_is_moved_and_no_one_commands_it(sign: float) -> None:
    time = AddedTime(3)
    for _ in range(5):  # below what the valve can: it does not move
        assert time.allowed(sign, commanded=False, moved=False)
    assert time.allowed(sign, commanded=False, moved=True)
    assert time.allowed(sign, commanded=False, moved=True)
    assert not time.allowed(sign, commanded=False, moved=True)
    assert not time.allowed(sign, commanded=False, moved=False)
    assert time.allowed(sign, commanded=True, moved=True)
    assert time.allowed(sign, commanded=False, moved=True, ticks=2)
    assert not time.allowed(sign, commanded=False, moved=True)
    assert time.allowed(0.0, commanded=False, moved=True)
    assert time.allowed(sign, commanded=False, moved=True)


def test_when_the_time_is_over_it_falls_and_rests() -> None:
    axis, _ = pair(OutputLimits(fall_per_s=2.0))
    for _ in range(30):
        axis.tick(CommandInput(), 0.2)
        assert axis.state is State.ACTIVE
    sent = []
    for _ in range(4):
        axis.tick(CommandInput(), 0.2)
        sent.append(round(axis.sent, 3))
    assert sent == [0.1, 0.0, 0.0, 0.0]


def test_missed_ticks_use_up_time() -> None:
    axis, _ = pair(OutputLimits())
    axis.tick(CommandInput(), 0.2)
    axis.hold(29)
    axis.tick(CommandInput(), 0.2)
    axis.tick(CommandInput(), 0.2)
    assert axis.raw == 0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("fall_per_s", [5.0, 1.0])
def test_a_joystick_that_is_pushed_the_other_way_ends_it_by_the_rate(
    fall_per_s: float, sign: float
) -> None:
    axis, _ = pair(OutputLimits(fall_per_s=fall_per_s))
    for _ in range(10):
        axis.tick(CommandInput(), -sign * 0.2)
    assert sign * axis.sent < -0.19
    left = 0.2
    for _ in range(20):
        axis.tick(CommandInput(sign * 0.1), -sign * 0.2)
        left = max(0.0, left - fall_per_s * TICK_S)
        assert sign * axis.sent == pytest.approx(-left, abs=SLACK)
    for _ in range(5):
        axis.tick(CommandInput(sign * 0.5), -sign * 0.2)
    assert sign * axis.sent == pytest.approx(0.3, abs=0.02)
    assert sign * axis.applied == pytest.approx(0.5, abs=0.02)


def test_what_is_cut_of_the_sum_is_cut_from_the_own_part() -> None:
    """The added part counts as sent whole: the filter makes up for the rest, see the model."""
    axis, _ = pair(OutputLimits())
    for _ in range(10):
        axis.tick(CommandInput(0.1), -0.2)
    assert axis.sent == 0.0
    assert axis.applied == pytest.approx(0.2)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_makes_no_axis_faster_than_its_operator_asks(sign: float) -> None:
    axis, plain = pair(OutputLimits(), lambda: Fir([0.5] + [0.0] * 20 + [0.5]))
    for _ in range(10):
        axis.tick(CommandInput(sign * 0.3), sign * 0.2)
        plain.tick(CommandInput(sign * 0.3))
    assert sign * plain.sent == pytest.approx(0.15, abs=SLACK)
    assert sign * axis.sent == pytest.approx(0.3, abs=SLACK)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1.1, -1.1])
def test_no_velocity_trips(bad: float) -> None:
    axis, _ = pair(OutputLimits())
    axis.tick(CommandInput(), 0.1)
    axis.tick(CommandInput(), bad)
    assert (axis.state, axis.reason, axis.raw) == (State.TRIPPED, Reason.OUTPUT_INVALID, 0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("command", "left"), [(0.0, 0.0), (0.3, 0.3)])
def test_who_adds_and_loses_the_right_to_leaves_nothing(
    sign: float, command: float, left: float
) -> None:
    axis, _ = pair(OutputLimits(rise_per_s=1.0))
    axis.tick(CommandInput(sign * command and sign))  # it asked for more before
    for _ in range(20):
        axis.tick(CommandInput(sign * command))
    for _ in range(6):
        axis.tick(CommandInput(sign * command), sign * 0.2)
    assert sign * axis.sent == pytest.approx(left + 0.2, abs=SLACK)
    axis.drop_added()
    axis.tick(CommandInput(sign * command))
    assert sign * axis.sent == pytest.approx(left, abs=SLACK)


def test_what_was_added_against_the_own_part_ends_by_the_rates() -> None:
    axis, _ = pair(OutputLimits(rise_per_s=1.0))
    for _ in range(20):
        axis.tick(CommandInput(0.5), -0.2)
    assert axis.sent == pytest.approx(0.3, abs=SLACK)
    axis.drop_added()
    axis.tick(CommandInput(0.5))
    assert axis.sent == pytest.approx(0.35, abs=SLACK)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_was_added_beyond_the_own_part_stops_before_the_own_part_begins(sign: float) -> None:
    axis, _ = pair(OutputLimits(rise_per_s=1.0, tail_s=2.0), lambda: Fir([0.0] * 40 + [1.0]))
    axis.allow_added(1.0, TIME_S)
    for command, ticks in ((0.4, 30), (-1.0, 2)):
        for _ in range(ticks):
            axis.tick(CommandInput(sign * command))
    for _ in range(20):
        axis.tick(CommandInput(), -sign)
    assert sign * axis.sent < -0.5
    assert sign * axis._own > 0.1
    axis.drop_added()
    seen = []
    for _ in range(3):
        axis.tick(CommandInput())
        seen.append(sign * axis.sent)
    assert seen == pytest.approx([0.0, 0.05, 0.1], abs=SLACK)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_was_added_to_an_own_part_that_turns_ends_before_the_other_side(sign: float) -> None:
    limits = OutputLimits(rise_per_s=1.0, fall_per_s=0.9, tail_s=3.0, brake_shaped=True)
    axis, _ = pair(limits, lambda: Fir([0.0] * 30 + [1.0]))
    axis.tick(CommandInput())
    for command, ticks in ((-1.0, 1), (-0.4, 10), (1.0, 11)):
        for _ in range(ticks):
            axis.tick(CommandInput(sign * command))
    for _ in range(27):
        axis.tick(CommandInput(), -sign * 0.1)
    assert sign * axis._own == pytest.approx(-0.04)
    assert sign * axis.sent == pytest.approx(-0.14, abs=SLACK)
    axis.drop_added()
    axis.tick(CommandInput())
    assert axis.sent == 0.0
    axis.tick(CommandInput())
    assert sign * axis.sent == pytest.approx(0.05, abs=SLACK)


def test_an_axis_at_rest_has_nothing_to_drop() -> None:
    axis, _ = pair(OutputLimits())
    axis.drop_added()
    axis.tick(CommandInput())
    assert (axis.state, axis.raw) == (State.READY, 0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_command_after_what_was_added_begins_at_rest(sign: float) -> None:
    axis, _ = pair(OutputLimits(rise_per_s=1.0))
    for _ in range(10):
        axis.tick(CommandInput(), sign * 0.2)
    axis.drop_added()
    axis.tick(CommandInput(sign * 0.5))
    assert sign * axis.sent == pytest.approx(0.05, abs=SLACK)


@pytest.mark.parametrize("fault", [Reason.JOYSTICK_TIMEOUT, Reason.JOYSTICK_ERROR])
def test_what_was_added_falls_by_the_rate_when_the_joystick_is_lost(fault: Reason) -> None:
    axis, _ = pair(OutputLimits(fall_per_s=2.0))
    for _ in range(10):
        axis.tick(CommandInput(), 0.2)
    for left in (0.1, 0.0):
        axis.tick(CommandInput(fault=fault), 0.2)
        assert axis.sent == pytest.approx(left, abs=SLACK)
    axis.tick(CommandInput(fault=fault), 0.2)
    assert axis.state is State.NEUTRAL_WAIT


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_leaves_nothing_at_once_however_slowly_the_valve_may_fall(sign: float) -> None:
    axis, _ = pair(OutputLimits(rise_per_s=5.0, fall_per_s=0.2))
    axis.tick(CommandInput(sign))
    for _ in range(5):
        axis.tick(CommandInput(sign * 0.3), sign * 0.2)
    assert sign * axis.sent > 0.4
    axis.drop_added()
    axis.tick(CommandInput(sign * 0.3))
    assert sign * axis.sent == pytest.approx(0.3, abs=SLACK)


def test_nor_while_it_falls_already() -> None:
    axis, _ = pair(OutputLimits(fall_per_s=0.2))
    for _ in range(10):
        axis.tick(CommandInput(), 0.2)
    axis.tick(CommandInput())
    assert axis.sent == pytest.approx(0.19, abs=SLACK)
    axis.drop_added()
    axis.tick(CommandInput())
    assert axis.sent == 0.0


def test_nor_what_rounding_has_left_out() -> None:
    axis = Axis(TICK_S, OutputLimits(), sway=None, shaper=Off(), grid_steps=10)
    axis.allow_added(LARGEST, TIME_S)
    axis.tick(CommandInput())
    axis.tick(CommandInput(1.0))
    for _ in range(10):
        axis.tick(CommandInput(0.3))
    axis.drop_added()
    axis.tick(CommandInput(0.3), 0.001)
    assert axis.sent == pytest.approx(0.3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_falls_is_rounded_to_the_side_of_rest(sign: float) -> None:
    axis = Axis(TICK_S, OutputLimits(fall_per_s=0.07), sway=None, shaper=Off(), grid_steps=50)
    axis.allow_added(LARGEST, TIME_S)
    axis.tick(CommandInput())
    for _ in range(10):
        axis.tick(CommandInput(), sign * 0.2)
    for _ in range(40):
        axis.tick(CommandInput())
        assert 0.0 <= sign * axis.sent <= sign * axis._limited + 1e-12


def test_with_anti_sway_off_nothing_that_is_added_begins_a_motion() -> None:
    axis, _ = pair(OutputLimits())
    axis.tick(CommandInput(bypass=True), 0.2)
    assert (axis.state, axis.raw) == (State.READY, 0)
