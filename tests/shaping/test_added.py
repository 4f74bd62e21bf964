"""Bounds of an added velocity: speed, way and time hold whatever is asked, and whatever moves."""

import math
from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.shaping.added import AddedBounds
from canshaper.shaping.axis import Axis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.fir import Fir
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.shapers.off import Off
from canshaper.shaping.states import Reason, State, StickInput

TICK_S = 0.05
# So fine that rounding does not hide what is added.
STEPS = 1_000_000
SLACK = 1e-4
LARGEST, PATH_S, TIME_S = 0.25, 0.2, 1.5
SHAPERS: list[Callable[[], Shaper]] = [Off, lambda: Fir([0.3, 0.1, 0.0, 0.2, 0.4])]

sticks = st.sampled_from([0.0, 0.0, 0.021, -0.021, 0.3, -0.3, 1.0, -1.0])
wishes = st.sampled_from([0.0, 0.01, -0.01, 0.2, -0.2, 1.0, -1.0]) | st.floats(-1.0, 1.0)
rates = st.sampled_from([0.3, 1.0, 5.0, 20.0])
steps = st.lists(
    st.tuples(sticks, wishes, st.integers(1, 12), st.sampled_from([0, 0, 0, 1, 3])),
    min_size=1,
    max_size=25,
)


def bounds(
    *, largest: float = LARGEST, path_s: float = PATH_S, time_s: float = TIME_S, least: float = 1e-3
) -> AddedBounds:
    return AddedBounds(TICK_S, largest=largest, path_s=path_s, time_s=time_s, least=least)


def pair(limits: OutputLimits, shaper: Callable[[], Shaper]) -> tuple[Axis, Axis]:
    """An axis with bounds, and one to which nothing is added."""
    one, plain = (
        Axis(TICK_S, limits, sway=None, shaper=shaper(), grid_steps=STEPS) for _ in range(2)
    )
    one.bound_added(bounds())
    one.tick(StickInput())
    plain.tick(StickInput())
    return one, plain


@given(
    rise=rates,
    fall=rates,
    maximum=st.sampled_from([1.0, 0.5]),
    shaper=st.sampled_from(SHAPERS),
    inputs=steps,
)
def test_whatever_is_asked_speed_way_and_time_are_bounded(
    rise: float,
    fall: float,
    maximum: float,
    shaper: Callable[[], Shaper],
    inputs: list[tuple[float, float, int, int]],
) -> None:
    limits = OutputLimits(rise_per_s=rise, fall_per_s=fall, maximum=maximum, tail_s=0.4)
    one, plain = pair(limits, shaper)
    way_s = moved_s = late_s = 0.0
    for command, wish, ticks, missed in inputs:
        if missed:
            for axis in (one, plain):
                axis.hold(missed)
        extra = one.sent - plain.sent
        way_s += missed * TICK_S * extra
        moved_s += missed * TICK_S * (abs(extra) >= 1e-3)
        # What could not be ended: the last output while ticks were missed.
        late_s += missed * TICK_S
        for _ in range(ticks):
            one.tick(StickInput(command), wish)
            plain.tick(StickInput(command))
            extra = one.sent - plain.sent
            way_s += extra * TICK_S
            moved_s += TICK_S * (abs(extra) >= 1e-3 + SLACK)
            assert abs(extra) <= LARGEST + SLACK
            assert abs(way_s) <= PATH_S + LARGEST * late_s + SLACK
            assert moved_s <= TIME_S + late_s + 1e-9
            if command > 0.02:
                assert one.sent >= min(plain.sent, 0.0) - SLACK
            elif command < -0.02:
                assert one.sent <= max(plain.sent, 0.0) + SLACK


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_way_ends_by_the_fall_and_goes_on_backwards(sign: float) -> None:
    axis, _ = pair(OutputLimits(fall_per_s=1.0, rise_per_s=20.0), Off)
    sent = []
    for _ in range(40):
        axis.tick(StickInput(), sign * 1.0)
        sent.append(sign * axis.sent)
    assert max(sent) == pytest.approx(LARGEST, abs=SLACK)
    assert sum(sent) * TICK_S == pytest.approx(PATH_S, abs=0.01)
    falls = [a - b for a, b in pairwise(sent)]
    assert max(falls) <= 1.0 * TICK_S + SLACK
    axis.tick(StickInput(), -sign * 0.2)
    assert axis.sent == pytest.approx(-sign * 0.2, abs=SLACK)


def test_time_counts_while_the_axis_is_moved() -> None:
    one = bounds(path_s=math.inf)
    for _ in range(30):  # 1.5 s
        assert one.wanted(0.2, 5.0) == 0.2
        assert one.kept(0.2) == 0.2
        one.applied(0.0009)
    for i in range(30):
        assert one.wanted(0.2, 5.0) == 0.2
        one.applied(0.001 if i % 2 else -0.001)
    assert (one.wanted(0.2, 5.0), one.kept(0.2), one.kept(-0.2)) == (0.0, 0.0, 0.0)
    one.begin()
    assert (one.wanted(0.2, 5.0), one.kept(0.2)) == (0.2, 0.2)


def test_the_next_act_begins_where_the_axis_is() -> None:
    one = bounds()
    one.applied(0.2)
    one.held(19)
    assert one.wanted(0.1, 5.0) == pytest.approx(0.0, abs=1e-12)
    assert one.kept(0.1) == pytest.approx(0.0, abs=1e-12)
    assert one.wanted(-0.1, 5.0) == -0.1
    assert one.kept(-0.1) == -0.1
    one.begin()
    assert one.wanted(0.1, 5.0) == 0.1
    one.held(3)  # nothing of the last act goes on
    assert one.wanted(0.1, 5.0) == 0.1


def test_the_bounds_are_what_they_are_set_to() -> None:
    one = bounds(largest=0.1, path_s=0.005)
    # v dt + v^2 / (2 fall) = 0.005: a step of 0.05 / 2 would be too much
    most = one.wanted(1.0, 2.0)
    assert most * TICK_S + most * most / 4.0 == pytest.approx(0.005)
    assert one.wanted(-1.0, 2.0) == -most
    assert one.kept(1.0) == pytest.approx(0.1)
    one.applied(0.05)
    assert one.kept(1.0) == pytest.approx(0.05)
    assert one.kept(-1.0) == pytest.approx(-0.1)
    one.limit_path(0.0)
    assert one.kept(1.0) == 0.0  # beyond a way that was made shorter: nothing more
    assert one.kept(-1.0) == pytest.approx(-0.05 - 0.0, abs=0.051)
    assert one.wanted(1.0, 2.0) == 0.0
    assert bounds().wanted(1.0, 100.0) == LARGEST


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("fall_per_s", [5.0, 0.2])
def test_a_joystick_that_is_pushed_the_other_way_ends_it_in_that_tick(
    fall_per_s: float, sign: float
) -> None:
    limits = OutputLimits(fall_per_s=fall_per_s)
    axis = Axis(TICK_S, limits, sway=None, shaper=Off(), grid_steps=125)
    axis.tick(StickInput())
    for _ in range(10):
        axis.tick(StickInput(), -sign * 0.2)
    assert sign * axis.sent < -0.19
    for _ in range(20):
        axis.tick(StickInput(sign * 0.1), -sign * 0.2)
        assert axis.sent == 0.0
    # As far as it leaves something, the rest is sent; the model hears of the operator's part.
    for _ in range(5):
        axis.tick(StickInput(sign * 0.5), -sign * 0.2)
    assert sign * axis.sent == pytest.approx(0.3, abs=0.02)
    assert sign * axis.applied == pytest.approx(0.5, abs=0.02)


def test_what_is_left_out_is_no_motion_to_the_model() -> None:
    axis = Axis(TICK_S, OutputLimits(), sway=None, shaper=Off(), grid_steps=125)
    axis.tick(StickInput())
    for _ in range(10):
        axis.tick(StickInput(0.1), -0.2)
    assert axis.applied == pytest.approx(0.1)
    assert axis.sent == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_operators_own_part_may_still_be_on_its_way_back(sign: float) -> None:
    """A reversal falls by the rate as ever; only what was added is gone at once."""
    limits = OutputLimits(fall_per_s=1.0)
    axis, plain = pair(limits, Off)
    for _ in range(5):
        axis.tick(StickInput(sign * 0.5), sign * 0.2)
        plain.tick(StickInput(sign * 0.5))
    assert sign * axis.sent == pytest.approx(0.7, abs=SLACK)
    for _ in range(8):
        axis.tick(StickInput(-sign * 0.5), sign * 0.2)
        plain.tick(StickInput(-sign * 0.5))
        assert axis.sent == pytest.approx(plain.sent, abs=SLACK)
        assert sign * axis.sent > 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1.1, -1.1])
def test_no_velocity_trips_with_bounds_too(bad: float) -> None:
    """It is an error of the axis that adds: bounds do not turn it into something to carry out."""
    axis, _ = pair(OutputLimits(), Off)
    axis.tick(StickInput(), 0.1)
    axis.tick(StickInput(), bad)
    assert (axis.state, axis.reason, axis.raw) == (State.TRIPPED, Reason.OUTPUT_INVALID, 0)


def test_rounding_of_the_operators_own_part_uses_up_no_bound() -> None:
    axis = Axis(TICK_S, OutputLimits(), sway=None, shaper=Off(), grid_steps=10)
    limited = bounds()
    axis.bound_added(limited)
    axis.tick(StickInput())
    for _ in range(100):
        axis.tick(StickInput(0.149))
        assert axis.sent == pytest.approx(0.1)
    assert (limited.kept(1.0), limited.kept(-1.0)) == (LARGEST, -LARGEST)


def test_missed_ticks_use_up_way_and_time() -> None:
    way, time = (Axis(TICK_S, OutputLimits(), sway=None, shaper=Off()) for _ in range(2))
    way.bound_added(bounds())
    time.bound_added(bounds(path_s=math.inf))
    for axis in (way, time):
        axis.tick(StickInput())
        axis.tick(StickInput(), 0.2)
    way.hold(19)  # 20 ticks with 0.2: all of the way
    time.hold(29)
    for axis in (way, time):
        axis.tick(StickInput(), 0.2)
        assert axis.raw == 0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("command", [0.0, 0.3])
def test_when_the_time_is_over_nothing_is_added_whatever_the_rates(
    command: float, sign: float
) -> None:
    limits = OutputLimits(rise_per_s=20.0, fall_per_s=0.2)
    axis, plain = pair(limits, Off)
    axis.bound_added(bounds(path_s=math.inf))
    for _ in range(30):  # 1.5 s
        axis.tick(StickInput(sign * command), sign * 0.2)
        plain.tick(StickInput(sign * command))
        assert sign * axis.sent == pytest.approx(command + 0.2, abs=SLACK)
    axis.tick(StickInput(sign * command), sign * 0.2)
    plain.tick(StickInput(sign * command))
    assert axis.sent == pytest.approx(plain.sent, abs=SLACK)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_carry_makes_it_no_faster_than_its_bound(sign: float) -> None:
    """A rise that lags carries a step over; the filter's run-on goes the other way meanwhile."""
    run_on = Fir([0.0, 0.0, 0.0, 0.0, 1.0])
    axis = Axis(TICK_S, OutputLimits(rise_per_s=2.5), sway=None, shaper=run_on, grid_steps=16)
    largest = 0.25 + 1 / 64
    axis.bound_added(bounds(largest=largest, path_s=math.inf))
    axis.tick(StickInput())
    axis.tick(StickInput(sign / 32))
    sent = []
    for own in (0.0, 0.0, 0.0, 1 / 32, 0.0):
        axis.tick(StickInput(), -sign * largest)
        sent.append(sign * axis.sent)
        assert abs(sent[-1] - own) <= largest + 0.5 / 16  # half a step of the grid
    assert sent == [-2 / 16, -4 / 16, -4 / 16, -4 / 16, -4 / 16]


def test_who_adds_and_loses_the_right_to_leaves_no_carry() -> None:
    axis, fresh = (Axis(TICK_S, OutputLimits(), sway=None, shaper=Off()) for _ in range(2))
    for one in (axis, fresh):
        one.tick(StickInput())
    axis.tick(StickInput(), 0.5)  # more than the rise: some is carried over
    axis.drop_added()
    for _ in range(3):
        axis.tick(StickInput(), 0.1)
        fresh.tick(StickInput(), 0.1)
        assert axis.state is fresh.state is State.ACTIVE
        assert axis.raw == fresh.raw


def test_who_adds_and_loses_the_right_to_leaves_nothing() -> None:
    axis, plain = pair(OutputLimits(), Off)
    for _ in range(6):
        axis.tick(StickInput(0.3), 0.2)
        plain.tick(StickInput(0.3))
    assert axis.sent == pytest.approx(0.5, abs=SLACK)
    axis.drop_added()
    axis.tick(StickInput(0.3))
    plain.tick(StickInput(0.3))
    assert (axis.raw, axis.sent) == (plain.raw, plain.sent)


@pytest.mark.parametrize("fault", [Reason.STICK_TIMEOUT, Reason.STICK_ERROR])
def test_what_was_added_falls_by_the_rate_when_the_joystick_is_lost(fault: Reason) -> None:
    axis, _ = pair(OutputLimits(fall_per_s=2.0), Off)
    for _ in range(10):
        axis.tick(StickInput(), 0.2)
    for left in (0.1, 0.0):
        axis.tick(StickInput(fault=fault), 0.2)
        assert axis.sent == pytest.approx(left, abs=SLACK)
    axis.tick(StickInput(fault=fault), 0.2)
    assert axis.state is State.NEUTRAL_WAIT
