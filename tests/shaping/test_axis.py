"""The state machine: what leads from state to state, and why it says it did."""

import math
from collections.abc import Callable
from typing import Any, cast

import pytest

from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.off import Off
from canshaper.shaping.states import MOVING, CommandInput, Reason, State, Transition
from canshaper.shaping.sway import SwayModel

Drive = Any  # the class of conftest.py
DriveWith = Callable[..., Any]

LOST = (
    Reason.JOYSTICK_TIMEOUT,
    Reason.JOYSTICK_ERROR,
    Reason.JOYSTICK_NOT_AVAILABLE,
    Reason.JOYSTICK_OUT_OF_RANGE,
    Reason.JOYSTICK_NOT_A_NUMBER,
    Reason.SWITCH_INVALID,
)
TRIPS = (Reason.OUTPUT_INVALID, Reason.SEND_FAILED, Reason.LOOP_STALLED)
PUSHED = CommandInput(0.8)
CENTRED = CommandInput()


def refused_start(drive: Drive, joystick: CommandInput, waits_for: Reason) -> None:
    assert drive.run(joystick, 0.2) == []
    assert (drive.state, drive.axis.reason) == (State.NEUTRAL_WAIT, waits_for)
    assert not any(drive.raw)


# -- from rest to motion ---------------------------------------------------------------------------


def test_the_first_move_takes_two_ticks_of_a_centred_joystick(drive: Drive) -> None:
    assert (drive.state, drive.axis.reason) == (State.NEUTRAL_WAIT, Reason.START)
    assert drive.tick(CENTRED) == Transition(
        State.NEUTRAL_WAIT, State.READY, Reason.JOYSTICK_NEUTRAL
    )
    assert drive.tick(PUSHED) == Transition(State.READY, State.ACTIVE, Reason.JOYSTICK_MOVED)
    assert drive.axis.raw > 0
    assert drive.axis.command == 0.8


@pytest.mark.parametrize("command", [0.021, -0.021, 1.0])
def test_a_joystick_that_was_never_neutral_moves_nothing(drive: Drive, command: float) -> None:
    refused_start(drive, CommandInput(command), Reason.JOYSTICK_NOT_NEUTRAL)


def test_a_joystick_that_is_not_enabled_moves_nothing(drive: Drive) -> None:
    refused_start(drive, CommandInput(enabled=False), Reason.ENABLE_OFF)


@pytest.mark.parametrize("fault", LOST)
def test_a_joystick_that_is_not_valid_moves_nothing(drive: Drive, fault: Reason) -> None:
    refused_start(drive, CommandInput(fault=fault), fault)


def test_enabling_a_joystick_that_was_moved_before_moves_nothing(drive: Drive) -> None:
    drive.to_ready()
    assert drive.run(CommandInput(0.8, enabled=False), 0.2) == [
        Transition(State.READY, State.NEUTRAL_WAIT, Reason.ENABLE_OFF)
    ]
    refused_start(drive, PUSHED, Reason.JOYSTICK_NOT_NEUTRAL)
    drive.to_ready().tick(PUSHED)
    assert drive.state is State.ACTIVE


@pytest.mark.parametrize("fault", LOST)
def test_a_joystick_lost_while_ready_has_to_be_seen_neutral_again(
    drive: Drive, fault: Reason
) -> None:
    drive.to_ready()
    lost = drive.tick(CommandInput(fault=fault))
    assert lost == Transition(State.READY, State.NEUTRAL_WAIT, fault)
    refused_start(drive, PUSHED, Reason.JOYSTICK_NOT_NEUTRAL)


@pytest.mark.parametrize("command", [0.0, 0.02, -0.02])
def test_within_the_neutral_band_nothing_moves(drive: Drive, command: float) -> None:
    drive.to_ready()
    assert drive.run(CommandInput(command), 1.0) == []
    assert not any(drive.raw)


# -- release ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("bypass", [False, True])
@pytest.mark.parametrize("tail_s", [0.0, 0.5, 2.0])
def test_after_release_the_run_on_is_bounded(
    drive_with: DriveWith, tail_s: float, bypass: bool
) -> None:
    limits = OutputLimits(fall_per_s=2.0, tail_s=tail_s)
    drive = drive_with(limits=limits).moving(1.0, bypass=bypass)
    before = len(drive.sent)
    (ready,) = drive.run(CommandInput(bypass=bypass), 5.0)
    assert ready.new is State.READY
    assert ready.reason is Reason.AT_REST
    moved_s = 0.02 * sum(map(bool, drive.raw[before:]))
    assert moved_s <= tail_s + 1.0 / limits.fall_per_s + 0.02
    assert not any(drive.raw[before + round((tail_s + 0.5) / 0.02) + 1 :])


def test_a_reversal_within_the_run_on_goes_on_at_once(drive: Drive) -> None:
    drive.moving(0.8).run(CENTRED, 0.1)
    assert drive.run(CommandInput(-0.8), 1.5) == []
    assert drive.axis.sent == pytest.approx(-0.8, abs=0.1)


# -- stopping --------------------------------------------------------------------------------------


@pytest.mark.parametrize("bypass", [False, True])
@pytest.mark.parametrize("fault", LOST)
def test_a_lost_joystick_gives_a_shaped_stop(drive: Drive, fault: Reason, bypass: bool) -> None:
    drive.moving(bypass=bypass)
    moving, sent = drive.state, drive.axis.sent
    assert drive.tick(CommandInput(fault=fault)) == Transition(moving, State.STOPPING, fault)
    assert sent - 0.12 < drive.axis.sent < sent  # no faster than the valve's fall
    (done,) = drive.run(CommandInput(fault=fault), 3.0)
    assert done == Transition(State.STOPPING, State.NEUTRAL_WAIT, Reason.STOP_DONE)
    assert drive.axis.raw == 0
    assert drive.axis.reason is fault


@pytest.mark.parametrize("stop_s", [0.02, 0.1, 0.6])
def test_a_stop_is_bounded_in_time_whatever_the_filter_wants(
    drive_with: DriveWith, stop_s: float
) -> None:
    class Stubborn:
        def step(self, command: float) -> float:
            return 1.0

    drive = drive_with(Stubborn(), OutputLimits(tail_s=2.0), stop_s=stop_s).moving()
    before = len(drive.raw)
    drive.run(CommandInput(fault=Reason.JOYSTICK_TIMEOUT), 3.0)
    assert sum(map(bool, drive.raw[before:])) == round(stop_s / 0.02)
    assert not any(drive.raw[before + round(stop_s / 0.02) :])


def test_a_joystick_that_comes_back_in_a_stop_has_to_be_seen_neutral(drive: Drive) -> None:
    drive.moving().tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT))
    (done,) = drive.run(PUSHED, 3.0)
    assert done.new is State.NEUTRAL_WAIT
    assert drive.axis.reason is Reason.JOYSTICK_NOT_NEUTRAL
    drive.to_ready()


def test_a_released_enable_is_more_than_a_lost_frame(drive: Drive) -> None:
    drive.moving()
    drive.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT))
    assert drive.state is State.STOPPING
    drive.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT, enabled=False))
    assert (drive.state, drive.axis.reason) == (State.TRIPPED, Reason.ENABLE_LOST)
    assert drive.axis.raw == 0


def test_enable_released_as_a_stop_ends_is_latched_all_the_same(drive_with: DriveWith) -> None:
    drive = drive_with(stop_s=0.1).moving()
    assert drive.run(CommandInput(fault=Reason.JOYSTICK_TIMEOUT), 0.1) == [
        Transition(State.ACTIVE, State.STOPPING, Reason.JOYSTICK_TIMEOUT)
    ]
    released = drive.tick(CommandInput(enabled=False))
    assert released == Transition(State.STOPPING, State.TRIPPED, Reason.ENABLE_LOST)
    assert drive.axis.raw == 0


# -- trips -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("bypass", [False, True])
def test_a_released_enable_switch_is_neutral_in_the_same_tick_and_latched(
    drive: Drive, bypass: bool
) -> None:
    drive.moving(bypass=bypass)
    moving = drive.state
    lost = drive.tick(CommandInput(0.8, enabled=False, bypass=bypass))
    assert lost == Transition(moving, State.TRIPPED, Reason.ENABLE_LOST)
    assert (drive.axis.raw, drive.axis.sent, drive.axis.command) == (0, 0.0, 0.0)
    before = len(drive.raw)
    drive.run(CommandInput(0.8, enabled=False), 1.0)
    drive.run(PUSHED, 1.0)  # the edge came with a moved joystick: it does not count
    drive.run(CENTRED, 1.0)
    assert (drive.state, drive.axis.reason) == (State.TRIPPED, Reason.ENABLE_LOST)
    assert not any(drive.raw[before:])
    drive.tick(CommandInput(enabled=False))
    assert drive.tick(CENTRED) == Transition(State.TRIPPED, State.NEUTRAL_WAIT, Reason.RESET)


@pytest.mark.parametrize("cause", TRIPS)
@pytest.mark.parametrize("state", list(State))
def test_a_trip_is_neutral_in_the_same_tick_from_every_state(
    drive: Drive, state: State, cause: Reason
) -> None:
    if state is State.READY:
        drive.to_ready()
    elif state in MOVING:
        drive.moving(bypass=state is State.BYPASS_ON)
    if state is State.STOPPING:
        drive.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT))
    elif state is State.TRIPPED:
        drive.tick(CommandInput(trip=Reason.SEND_FAILED))
    assert drive.state is state
    expected = None if state is State.TRIPPED else Transition(state, State.TRIPPED, cause)
    assert drive.tick(CommandInput(0.8, trip=cause)) == expected
    assert (drive.state, drive.axis.raw, drive.axis.sent) == (State.TRIPPED, 0, 0.0)


TRIP = CommandInput(trip=Reason.SEND_FAILED)
RESET = CommandInput(reset=True)


@pytest.mark.parametrize(
    "inputs",
    [
        [CENTRED] * 5,  # nothing but the cause gone
        [CommandInput(0.8, reset=True)],  # not neutral
        [CommandInput(fault=Reason.JOYSTICK_TIMEOUT, reset=True)],  # not known to be neutral
        [CommandInput(reset=True, trip=Reason.SEND_FAILED)],  # the cause is there
        [CommandInput(reset=True, trip=Reason.SEND_FAILED), RESET, RESET],  # held since then
        [CommandInput(0.8, reset=True), RESET, RESET],
        # held while its frames fail: no new press
        [CommandInput(0.8, reset=True), CommandInput(fault=Reason.JOYSTICK_TIMEOUT), RESET],
        [CommandInput(fault=Reason.JOYSTICK_TIMEOUT, reset=True), RESET, RESET],  # pressed then
        [CommandInput(0.8, enabled=False), CommandInput(0.8), CENTRED],
        [CommandInput(fault=Reason.JOYSTICK_TIMEOUT, enabled=False), CENTRED],  # enable unknown
        [CommandInput(fault=Reason.JOYSTICK_UNTRUSTED, enabled=False), CENTRED],
        [CommandInput(enabled=False), CommandInput(fault=Reason.JOYSTICK_TIMEOUT), CENTRED],
        [
            CommandInput(enabled=False),
            CommandInput(fault=Reason.JOYSTICK_ERROR),
            CENTRED,
        ],  # held since
        [CommandInput(fault=Reason.SWITCH_INVALID, reset=True), RESET],
    ],
)
def test_no_way_out_of_a_trip(drive: Drive, inputs: list[CommandInput]) -> None:
    drive.moving().tick(TRIP)
    for joystick in inputs:
        assert drive.tick(joystick) is None
    assert drive.state is State.TRIPPED


@pytest.mark.parametrize(
    "inputs",
    [
        [RESET],
        [CommandInput(reset=True, enabled=False)],
        [CommandInput(enabled=False), CENTRED],
        # off in a frame that tells it, though its joystick is not available
        [CommandInput(fault=Reason.JOYSTICK_NOT_AVAILABLE, enabled=False), CENTRED],
        [CommandInput(0.8, reset=True), CENTRED, RESET],  # a second edge
        [CommandInput(fault=Reason.JOYSTICK_TIMEOUT), CENTRED, RESET],  # off before, seen off after
        [CENTRED, CommandInput(fault=Reason.JOYSTICK_TIMEOUT), RESET],
        [CommandInput(reset=True, trip=Reason.SEND_FAILED), CENTRED, RESET],
    ],
)
def test_the_way_out_of_a_trip_is_an_edge_with_a_centred_joystick(
    drive: Drive, inputs: list[CommandInput]
) -> None:
    drive.moving().tick(TRIP)
    *before, last = [drive.tick(joystick) for joystick in inputs]
    assert not any(before)
    assert last == Transition(State.TRIPPED, State.NEUTRAL_WAIT, Reason.RESET)
    drive.to_ready().tick(PUSHED)
    assert drive.state is State.ACTIVE


def test_switches_that_are_on_at_the_start_make_no_edge(drive: Drive) -> None:
    drive.tick(CommandInput(reset=True, trip=Reason.SEND_FAILED))
    drive.run(RESET, 0.2)
    assert drive.state is State.TRIPPED


# -- a filter gone wrong ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "bad",
    [math.nan, math.inf, -math.inf, ZeroDivisionError, OverflowError, KeyError, "0.1", None],
)
def test_a_filter_without_a_number_trips_and_can_recover(drive_with: DriveWith, bad: Any) -> None:
    class Broken:
        broken = False

        def step(self, command: float) -> float:
            if self.broken:
                if isinstance(bad, type):
                    raise bad
                return cast(float, bad)
            return command

    shaper = Broken()
    drive = drive_with(shaper).moving()
    assert abs(drive.model.angle) > 0.0
    shaper.broken = True
    assert drive.tick(PUSHED) == Transition(State.ACTIVE, State.TRIPPED, Reason.OUTPUT_INVALID)
    assert (drive.axis.raw, drive.axis.sent, drive.axis.command) == (0, 0.0, 0.0)
    assert (drive.model.angle, drive.model.rate) == (0.0, 0.0)
    assert drive.run(CENTRED, 0.5) == []
    shaper.broken = False
    drive.tick(RESET)
    drive.moving()


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_no_number_never_reaches_the_valve(
    drive_with: DriveWith, bad: float
) -> None:
    for shaper in (None, Off()):
        drive = drive_with(shaper).moving()
        drive.tick(CommandInput(bad))
        assert (drive.state, drive.axis.reason) == (State.TRIPPED, Reason.OUTPUT_INVALID)
        assert (drive.axis.raw, drive.axis.command) == (0, 0.0)
        drive.tick(RESET)
        drive.moving()


def test_a_broken_model_starts_again(drive: Drive) -> None:
    drive.moving()
    drive.model.angle = math.nan
    drive.tick(PUSHED)
    assert (drive.state, drive.axis.reason) == (State.TRIPPED, Reason.OUTPUT_INVALID)
    drive.tick(RESET)
    drive.moving()
    assert isinstance(drive.axis.sway, SwayModel)
    assert math.isfinite(drive.axis.sway.angle)
