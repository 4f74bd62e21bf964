"""Missed deadlines: a few are tolerated, many stop what moves through the filter."""

from typing import Any

import pytest

from canshaper.shaping.states import Reason, State
from tests.rigs.forwarder import SLOW_VALVE, Make, Rig

STOP_TICKS = 100  # stop_s of the shipped slew axis
# Late ticks in a row that are an overrun, and punctual ones that end it.
MANY, RECOVERY = 10, 50


def late(rig: Rig, missed: int = 1, **raw: int) -> dict[str, dict[str, Any]]:
    """Both joysticks, and a tick that comes after some that were missed."""
    left = {k: v for k, v in raw.items() if k != "Lift"}
    right = {k: v for k, v in raw.items() if k != "Slew"}
    rig.receive(rig.joystick("JoystickLeft", **left), rig.joystick("JoystickRight", **right))
    return rig.tick(missed)


def overrun(rig: Rig, **raw: int) -> dict[str, dict[str, Any]]:
    """As many late ticks as are an overrun; what the last of them sent."""
    sent: dict[str, dict[str, Any]] = {}
    for _ in range(MANY):
        sent = late(rig, **raw)
    return sent


@pytest.mark.parametrize("missed", [1, 2, 4])
def test_ten_late_ticks_in_a_row_are_an_overrun_and_nine_are_not(rig: Rig, missed: int) -> None:
    """However late each of them is: what is longer than a timeout is a stall."""
    rig.moving()
    for _ in range(MANY - 1):
        late(rig, missed, Slew=1000)
        assert rig.state() is State.ACTIVE
    late(rig, missed, Slew=1000)
    assert (rig.state(), rig.reason()) == (State.STOPPING, "LOOP_OVERRUN")
    assert rig.count("MissedDeadlines") == MANY * missed


def test_the_whole_allowance_is_there_at_the_start(rig: Rig) -> None:
    for missed in [1] * 9 + [0, 1]:
        late(rig, missed)
        assert rig.reason() != "LOOP_OVERRUN"
    late(rig)
    assert rig.reason() == "LOOP_OVERRUN"


def test_a_late_tick_now_and_then_stops_nothing(rig: Rig) -> None:
    """One in six, the whole day."""
    rig.moving()
    for n in range(3000):
        late(rig, 1 if n % 6 == 0 else 0, Slew=900 + n % 2)  # the joystick is not frozen
        assert rig.state() is State.ACTIVE


def test_one_late_tick_in_five_does_in_time(rig: Rig) -> None:
    rig.moving()
    for n in range(500):
        late(rig, 1 if n % 5 == 0 else 0, Slew=1000)
        if rig.state() is not State.ACTIVE:
            break
    assert (rig.state(), rig.reason()) == (State.STOPPING, "LOOP_OVERRUN")
    assert n > 5 * MANY


def test_every_axis_that_moves_stops_and_no_other_begins(rig: Rig) -> None:
    rig.run(3)
    rig.run(50, Slew=1000, Lift=1000)
    overrun(rig, Slew=1000, Lift=1000)
    assert {axis: (rig.state(axis), rig.reason(axis)) for axis in ("slew", "near_far", "lift")} == {
        "slew": (State.STOPPING, "LOOP_OVERRUN"),
        "lift": (State.STOPPING, "LOOP_OVERRUN"),
        "near_far": (State.NEUTRAL_WAIT, "LOOP_OVERRUN"),
    }
    for _ in range(20):
        assert late(rig, NearFar=1000)["NearFarCommand"]["Velocity"] == 0


def test_it_ends_after_fifty_punctual_ticks_and_then_neutral_is_needed(rig: Rig) -> None:
    rig.moving()
    overrun(rig, Slew=1000)
    for _ in range(RECOVERY - 1):
        rig.run(1)
    assert rig.state("near_far") is State.NEUTRAL_WAIT
    assert rig.reason("near_far") == "LOOP_OVERRUN"
    rig.run(1)
    assert rig.state("near_far") is State.READY
    rig.run(STOP_TICKS, Slew=1000)  # out before the stop was over
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "JOYSTICK_NOT_NEUTRAL")
    rig.run(1)
    assert rig.state() is State.READY
    assert rig.run(50, Slew=1000)["SlewCommand"]["Velocity"] > 50


def test_a_long_storm_is_over_as_soon_as_a_short_one(rig: Rig) -> None:
    rig.run(3)
    for _ in range(10):
        overrun(rig)
    rig.run(RECOVERY)
    assert rig.state() is State.READY


def test_late_ticks_on_the_way_back_lengthen_it(rig: Rig) -> None:
    rig.run(3)
    overrun(rig)
    rig.run(RECOVERY - 1)
    late(rig)  # weighs as much as five punctual ones
    for _ in range(5):
        assert rig.reason() == "LOOP_OVERRUN"
        rig.run(1)
    assert rig.state() is State.NEUTRAL_WAIT
    rig.run(1)
    assert rig.state() is State.READY


def test_a_released_enable_in_the_tick_of_the_overrun_too(rig: Rig) -> None:
    rig.moving()
    for _ in range(MANY - 1):
        late(rig, Slew=1000)
    assert late(rig, Slew=1000, Enable=0)["SlewCommand"]["Velocity"] == 0
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "ENABLE_LOST")


def test_the_fault_of_a_joystick_is_reported_before_that_of_the_loop(rig: Rig) -> None:
    rig.moving()
    for _ in range(MANY - 1):
        late(rig, Slew=1000)
    late(rig, Slew=32766)
    assert (rig.state(), rig.reason()) == (State.STOPPING, "JOYSTICK_ERROR")


def test_a_reset_that_is_held_through_an_overrun_is_no_press(rig: Rig) -> None:
    rig.moving()
    rig.run(1, Slew=1000, Enable=0)
    rig.run(2, Reset=1, Slew=1000)
    assert rig.state() is State.TRIPPED
    overrun(rig, Reset=1)
    rig.run(RECOVERY + 5, Reset=1)
    assert rig.state() is State.TRIPPED
    rig.run(2)
    rig.run(2, Reset=1)
    assert rig.state() is State.READY


def test_bypass_goes_on_and_the_filter_does_not(rig: Rig) -> None:
    """Late ticks spoil a filter; where there is none, the axis stays in the driver's hand."""
    rig.run(3, AntiSwayOff=1)
    rig.run(50, Slew=1000, AntiSwayOff=1)
    assert rig.state() is State.BYPASS_ON
    for _ in range(3):
        assert overrun(rig, Slew=1000, AntiSwayOff=1)["SlewCommand"]["Velocity"] == 100
        assert rig.state() is State.BYPASS_ON
    late(rig, Slew=1000)  # anti-sway on again
    late(rig, Slew=1000)
    assert (rig.state(), rig.reason()) == (State.STOPPING, "LOOP_OVERRUN")


def test_bypass_does_not_begin_in_an_overrun(rig: Rig) -> None:
    rig.run(3, AntiSwayOff=1)
    overrun(rig, AntiSwayOff=1)
    assert late(rig, Slew=1000, AntiSwayOff=1)["SlewCommand"]["Velocity"] == 0
    assert rig.state() is State.NEUTRAL_WAIT


def test_a_slow_valve_stops_with_its_next_frame(changed_rig: Make) -> None:
    rig = changed_rig(dbc=SLOW_VALVE)
    rig.run(30)
    rig.run(60, Slew=1000)
    assert rig.state() is State.ACTIVE
    overrun(rig, Slew=1000)
    rig.run(10, Slew=1000)
    assert (rig.state(), rig.reason()) == (State.STOPPING, "LOOP_OVERRUN")


@pytest.mark.parametrize("interlock", [False, True])
def test_a_joystick_held_the_other_way_ends_the_run_on(rig: Rig, interlock: bool) -> None:
    """In a stop that the joystick is no cause of: it is valid all the time."""
    rig.moving()
    control = rig.controller.axes["slew"]
    if interlock:
        control.stops.interlocks.append(lambda neutral, now_ns: Reason.NODE_FAULT)
        late(rig, Slew=-1000)
    else:
        overrun(rig, Slew=1000)
    assert rig.state() is State.STOPPING
    limits = control.bound.config.limits
    for _ in range(round(1.0 / (limits.fall_per_s * control.period_s)) + 1):
        late(rig, Slew=-1000)
    assert control.axis.output.steps == 0
