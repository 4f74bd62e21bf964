"""An added velocity: its range and its time."""

import pytest

from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.moving_axis import UNATTENDED_TICKS, AddedTime
from canshaper.shaping.shapers.fir import Fir
from canshaper.shaping.states import CommandInput, Reason, State
from canshaper.shaping.two_axis_motion import range_with_added
from tests.shaping.added_pair import SLACK, TICK_S, pair, run


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
    bounds = range_with_added(command, low, high, sign * own, 0.25, maximum=1.0)
    assert bounds == (expected if sign > 0.0 else (-expected[1], -expected[0]))


def test_time_counts_while_the_axis_is_moved_and_no_one_commands_it() -> None:
    time = AddedTime(3, 20)
    for _ in range(5):  # below what the valve can: it does not move
        assert time.allows(asked=True, commanded=False, moved=False)
    assert time.allows(asked=True, commanded=False, moved=True)
    assert time.allows(asked=True, commanded=False, moved=True)
    assert not time.allows(asked=True, commanded=False, moved=True)
    assert not time.allows(asked=True, commanded=False, moved=False)
    assert time.allows(asked=True, commanded=True, moved=True)
    assert time.allows(asked=True, commanded=False, moved=True, ticks=2)
    assert not time.allows(asked=True, commanded=False, moved=True)


def test_a_pause_gives_no_time_back() -> None:
    """Only its operator does, or that no joystick of the motion was deflected for the tail."""
    time = AddedTime(2, 20)
    time.allows(asked=True, commanded=False, moved=True)
    time.allows(asked=False, commanded=False, moved=True)
    for _ in range(500):
        assert not time.allows(asked=False, commanded=False, moved=False)
    assert not time.allows(asked=True, commanded=False, moved=False)
    time.renew()
    assert time.allows(asked=True, commanded=False, moved=False)


@pytest.mark.parametrize("fault", [None, Reason.LOOP_OVERRUN])
def test_its_joystick_rests_for_longer_than_the_tail(fault: Reason | None) -> None:
    """In whatever state: a stick that is held through a stop is at work."""
    axis, _ = pair(OutputLimits(tail_s=1.0))
    axis.tick(CommandInput(0.5, fault=fault))
    axis.tick(CommandInput(0.02, fault=fault))
    axis.hold(3)
    for _ in range(20 + UNATTENDED_TICKS - 3):
        assert not axis.added_time.unattended
        axis.tick(CommandInput(0.02, fault=fault))
    assert axis.added_time.unattended
    axis.tick(CommandInput(-0.5, fault=fault))
    assert not axis.added_time.unattended


def test_at_the_start_it_is_attended_for_as_long() -> None:
    axis, _ = pair(OutputLimits(tail_s=1.0))
    for _ in range(20 + UNATTENDED_TICKS):
        assert not axis.added_time.unattended
        axis.tick(CommandInput())
    assert axis.added_time.unattended


def test_time_is_used_up_in_the_bypass_too() -> None:
    axis, _ = pair(OutputLimits(fall_per_s=1.0))
    run(axis, 27, 0.0, 0.2)
    for _ in range(3):
        axis.tick(CommandInput(bypass=True), 0.2)
        assert axis.output.setpoint
    before = axis.output.setpoint
    axis.tick(CommandInput(), 0.2)
    assert axis.output.setpoint < before


def test_when_the_time_is_over_it_falls_and_rests() -> None:
    axis, _ = pair(OutputLimits(fall_per_s=2.0))
    for _ in range(30):
        axis.tick(CommandInput(), 0.2)
        assert axis.state is State.ACTIVE
    sent = []
    for _ in range(4):
        axis.tick(CommandInput(), 0.2)
        sent.append(round(axis.output.setpoint, 3))
    assert sent == [0.1, 0.0, 0.0, 0.0]


def test_missed_ticks_use_up_time() -> None:
    axis, _ = pair(OutputLimits())
    axis.tick(CommandInput(), 0.2)
    axis.hold(29)
    axis.tick(CommandInput(), 0.2)
    axis.tick(CommandInput(), 0.2)
    assert axis.output.steps == 0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("fall_per_s", [5.0, 1.0])
def test_a_joystick_that_is_pushed_the_other_way_ends_it_by_the_rate(
    fall_per_s: float, sign: float
) -> None:
    axis, _ = pair(OutputLimits(fall_per_s=fall_per_s))
    run(axis, 10, 0.0, -sign * 0.2)
    assert sign * axis.output.setpoint < -0.19
    left = 0.2
    for _ in range(20):
        axis.tick(CommandInput(sign * 0.1), -sign * 0.2)
        left = max(0.0, left - fall_per_s * TICK_S)
        assert sign * axis.output.setpoint == pytest.approx(-left, abs=SLACK)
    run(axis, 5, sign * 0.5, -sign * 0.2)
    assert sign * axis.output.setpoint == pytest.approx(0.3, abs=0.02)
    assert sign * axis.output.applied == pytest.approx(0.5, abs=0.02)


def test_what_is_cut_of_the_sum_is_cut_from_the_own_part() -> None:
    """The added part counts as sent whole: the filter makes up for the rest, see the model."""
    axis, _ = pair(OutputLimits())
    run(axis, 10, 0.1, -0.2)
    assert axis.output.setpoint == 0.0
    assert axis.output.applied == pytest.approx(0.2)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_makes_no_axis_faster_than_its_operator_asks(sign: float) -> None:
    axis, plain = pair(OutputLimits(), lambda: Fir([0.5] + [0.0] * 20 + [0.5]))
    for _ in range(10):
        axis.tick(CommandInput(sign * 0.3), sign * 0.2)
        plain.tick(CommandInput(sign * 0.3))
    assert sign * plain.output.setpoint == pytest.approx(0.15, abs=SLACK)
    assert sign * axis.output.setpoint == pytest.approx(0.3, abs=SLACK)


def test_the_time_that_is_given_back_moves_it_again() -> None:
    axis, _ = pair(OutputLimits(fall_per_s=10.0))
    run(axis, 40, 0.0, 0.2)
    assert axis.output.steps == 0
    axis.added_time.renew()
    axis.tick(CommandInput(), 0.2)
    assert axis.output.steps
