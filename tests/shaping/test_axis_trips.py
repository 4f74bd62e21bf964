"""The state machine: what trips an axis, and the only way out of a trip."""

import math
from collections.abc import Callable
from typing import Any, cast

import pytest

from canshaper.shaping.states import MOVING, CommandInput, Reason, State, Transition
from canshaper.shaping.sway import SwayModel
from canshaper.shaping.transfer import Off

Drive = Any  # the class of conftest.py
DriveWith = Callable[..., Any]
TRIPS = (Reason.OUTPUT_INVALID, Reason.SEND_FAILED, Reason.LOOP_STALLED)
PUSHED = CommandInput(0.8)
CENTRED = CommandInput()


@pytest.mark.parametrize("bypass", [False, True])
def test_a_released_enable_switch_is_neutral_in_the_same_tick_and_latched(
    drive: Drive, bypass: bool
) -> None:
    drive.moving(bypass=bypass)
    moving = drive.state
    lost = drive.tick(CommandInput(0.8, enabled=False, bypass=bypass))
    assert lost == Transition(moving, State.TRIPPED, Reason.ENABLE_LOST)
    assert (drive.axis.output.steps, drive.axis.output.setpoint, drive.axis.demand) == (0, 0.0, 0.0)
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
    assert (drive.state, drive.axis.output.steps, drive.axis.output.setpoint) == (
        State.TRIPPED,
        0,
        0.0,
    )


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
        # off in a frame that reports it, though its joystick is not available
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
    assert (drive.axis.output.steps, drive.axis.output.setpoint, drive.axis.demand) == (0, 0.0, 0.0)
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
        tripped = drive.tick(CommandInput(bad))
        assert tripped == Transition(State.ACTIVE, State.TRIPPED, Reason.OUTPUT_INVALID)
        assert tripped.error.startswith(f"ValueError: command is {bad} (")
        assert (drive.axis.output.steps, drive.axis.demand) == (0, 0.0)
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
