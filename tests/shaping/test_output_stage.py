"""The output stage by itself: how it begins, and for how long nothing runs on."""

from dataclasses import replace

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.moving_axis import UNATTENDED_TICKS
from canshaper.shaping.output import OutputStage
from canshaper.shaping.states import CommandInput
from canshaper.shaping.transfer import Off

TICK_S, TAIL = 0.02, 5
LIMITS = OutputLimits(tail_s=TAIL * TICK_S, rise_per_s=20.0, fall_per_s=100.0)


def stage() -> OutputStage:
    return OutputStage(LIMITS, 125, TICK_S, spreads=False)


def driven(stage: OutputStage, demand: float, reference: float = 0.4, path: float = 0.0) -> float:
    stage.drive(demand, demand, reference, path, 0.0, sensor_damps=False)
    return stage.output.setpoint


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_new_stage_begins_as_one_that_rests(sign: float) -> None:
    rested = stage()
    driven(rested, 0.4)
    rested.rest()
    for one in (stage(), rested):
        assert not one.output.commanded
        assert driven(one, sign * 0.32, sign * 0.32) == sign * 0.32
        one.drop_added()  # nothing was: it goes on
        assert one.ramp == sign * 0.32


@pytest.mark.parametrize("path", [0.16, -0.16])
def test_a_new_stage_adds_nothing_until_it_may_and_then_no_more_than_is_asked(path: float) -> None:
    assert driven(stage(), 0.0, 0.0, path) == 0.0
    may = stage()
    may.largest_added = 0.25
    assert driven(may, 0.0, 0.0, path) == path


def test_a_demand_runs_on_for_the_tail() -> None:
    one = stage()
    assert driven(one, 0.4) == 0.4
    assert [driven(one, 0.0) for _ in range(TAIL)] == [0.4] * TAIL
    assert driven(one, 0.0) == 0.0


@pytest.mark.parametrize("rests", [0, 1, 2])
def test_for_a_tail_after_the_filter_has_started_nothing_runs_on(rests: int) -> None:
    """Time at rest counts."""
    for demanded in range(1, TAIL - rests + 1):
        one = stage()
        driven(one, 0.4)
        one.hold_run_on()
        for _ in range(rests):
            one.rest()
        for _ in range(demanded):
            assert driven(one, 0.4) == 0.4
        over = rests + demanded == TAIL
        assert driven(one, 0.0) == (0.4 if over else 0.0), demanded


@pytest.mark.parametrize(("held", "moves"), [(0.4, True), (0.0, False)])
def test_how_far_it_runs_on_counts_from_the_joystick_and_not_from_the_demand(
    held: float, moves: bool
) -> None:
    """An axis ahead of its end stop gets no demand, and its operator holds the joystick."""
    one = OutputStage(replace(LIMITS, tail_s=1.0, run_on=0.02), 125, TICK_S, spreads=False)
    for _ in range(5):
        driven(one, 0.4)
    for _ in range(10):
        one.drive(held, 0.0, 0.4, 0.0, 0.0, sensor_damps=False)
    assert bool(one.output.steps) is moves


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_nothing_is_added_against_a_joystick_that_is_held_without_a_demand(sign: float) -> None:
    one = stage()
    one.largest_added = 0.25
    for _ in range(5):
        one.drive(sign, 0.0, 0.0, -0.2 * sign, 0.0, sensor_damps=False)
    assert one.output.steps == 0
    for _ in range(5):
        one.drive(0.0, 0.0, 0.0, -0.2 * sign, 0.0, sensor_damps=False)
    assert one.output.steps * sign < 0


def test_how_much_faster_than_asked_it_is_counts_the_own_part_and_all_of_it() -> None:
    one = stage()
    one.largest_added = 0.5
    one._own_ramp, one.output.setpoint = 0.5, 0.3  # what is added goes the other way
    assert one._beyond(0.0) == 0.5
    assert one._beyond(0.2) == pytest.approx(0.3)


def test_a_joystick_that_is_held_against_a_stop_ends_what_was_commanded() -> None:
    one = OutputStage(replace(LIMITS, reversal_s=0.0), 125, TICK_S, spreads=False)
    for _ in range(20):
        one.drive(1.0, 1.0, 1.0, 0.0, 0.0, sensor_damps=False)
    one.stop_against(-1.0)
    assert not one.output.commanded
    assert (one._recent.low, one._recent.high) == (0.0, 0.0)


def test_a_rest_forgets_what_was_commanded() -> None:
    one = stage()
    one.drive(1.0, 1.0, 1.0, 0.0, 0.0, sensor_damps=False)
    one.rest()
    assert (one._recent.low, one._recent.high) == (0.0, 0.0)


def test_missed_ticks_make_an_axis_unattended_as_others_do() -> None:
    axis = ShapedAxis(TICK_S, LIMITS, sway=None, shaper=Off(), stop_s=5.0)
    axis.tick(CommandInput())
    axis.added_time._rested = axis.stage.tail + UNATTENDED_TICKS - 3
    axis.hold(3)
    assert not axis.added_time.unattended
    axis.hold(1)
    assert axis.added_time.unattended
