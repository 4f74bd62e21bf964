"""The state machine: what leads from state to state, and why it says it did."""

from collections.abc import Callable
from typing import Any

import pytest

from canshaper.shaping.states import CommandInput, Reason, State, Transition

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
PUSHED = CommandInput(0.8)
CENTRED = CommandInput()


def refused_start(drive: Drive, joystick: CommandInput, waits_for: Reason) -> None:
    assert drive.run(joystick, 0.2) == []
    assert (drive.state, drive.axis.reason) == (State.NEUTRAL_WAIT, waits_for)
    assert not any(drive.raw)


def test_the_first_move_takes_two_ticks_of_a_centred_joystick(drive: Drive) -> None:
    assert (drive.state, drive.axis.reason) == (State.NEUTRAL_WAIT, Reason.START)
    assert drive.tick(CENTRED) == Transition(
        State.NEUTRAL_WAIT, State.READY, Reason.JOYSTICK_NEUTRAL
    )
    assert drive.tick(PUSHED) == Transition(State.READY, State.ACTIVE, Reason.JOYSTICK_MOVED)
    assert drive.axis.output.steps > 0
    assert drive.axis.demand == 0.8


@pytest.mark.parametrize("fault", LOST)
def test_a_joystick_that_is_not_valid_moves_nothing(drive: Drive, fault: Reason) -> None:
    refused_start(drive, CommandInput(fault=fault), fault)


# -- release ---------------------------------------------------------------------------------------


def test_a_reversal_within_the_run_on_goes_on_at_once(drive: Drive) -> None:
    drive.moving(0.8).run(CENTRED, 0.1)
    assert drive.run(CommandInput(-0.8), 1.5) == []
    assert drive.axis.output.setpoint == pytest.approx(-0.8, abs=0.1)


# -- stopping --------------------------------------------------------------------------------------


@pytest.mark.parametrize("bypass", [False, True])
@pytest.mark.parametrize("fault", LOST)
def test_a_lost_joystick_gives_a_shaped_stop(drive: Drive, fault: Reason, bypass: bool) -> None:
    drive.moving(bypass=bypass)
    moving, sent = drive.state, drive.axis.output.setpoint
    assert drive.tick(CommandInput(fault=fault)) == Transition(moving, State.STOPPING, fault)
    assert sent - 0.12 < drive.axis.output.setpoint < sent  # no faster than the valve's fall
    (done,) = drive.run(CommandInput(fault=fault), 3.0)
    assert done == Transition(State.STOPPING, State.NEUTRAL_WAIT, Reason.STOP_DONE)
    assert drive.axis.output.steps == 0
    assert drive.axis.reason is fault


def test_a_released_enable_is_more_than_a_lost_frame(drive: Drive) -> None:
    drive.moving()
    drive.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT))
    assert drive.state is State.STOPPING
    drive.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT, enabled=False))
    assert (drive.state, drive.axis.reason) == (State.TRIPPED, Reason.ENABLE_LOST)
    assert drive.axis.output.steps == 0


def test_a_demand_is_scaled_but_not_in_bypass(drive: Drive) -> None:
    drive.to_ready()
    drive.tick(CommandInput(0.8))
    assert drive.axis.demand == 0.8
    drive.axis.scale = 0.5
    drive.tick(CommandInput(0.8))
    assert drive.axis.demand == 0.4
    drive.tick(CommandInput(0.8, bypass=True))
    assert drive.axis.demand == 0.8


@pytest.mark.parametrize("command", [0.02, -0.02])
def test_the_end_of_the_neutral_band_is_neutral(drive: Drive, command: float) -> None:
    """At rest, and in motion, which it does not prolong."""
    drive.to_ready()
    assert drive.run(CommandInput(command), 1.0) == []
    drive.moving(1.0)
    drive.tick(CommandInput(command))
    assert drive.axis.demand == 0.0


def test_enable_released_as_a_stop_ends_is_latched_all_the_same(drive_with: DriveWith) -> None:
    drive = drive_with(stop_s=0.1).moving()
    assert drive.run(CommandInput(fault=Reason.JOYSTICK_TIMEOUT), 0.1) == [
        Transition(State.ACTIVE, State.STOPPING, Reason.JOYSTICK_TIMEOUT)
    ]
    released = drive.tick(CommandInput(enabled=False))
    assert released == Transition(State.STOPPING, State.TRIPPED, Reason.ENABLE_LOST)
    assert drive.axis.output.steps == 0
