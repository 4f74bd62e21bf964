"""A motion that a trip or the end of a stop has cut off: the filter does not run it on later."""

from collections.abc import Callable
from typing import Any

import pytest

from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.fir import Fir
from canshaper.shaping.states import CommandInput, Reason, State

DriveWith = Callable[..., Any]
TICK_S = 0.02
TAIL = 50
LIMITS = OutputLimits(tail_s=TAIL * TICK_S, rise_per_s=20.0, fall_per_s=20.0)


def late() -> Fir:
    """Half of the demand at once, half of it 40 ticks later: less than the tail."""
    return Fir([0.5] + [0.0] * 39 + [0.5])


def tripped(drive: Any) -> None:
    drive.tick(CommandInput(enabled=False))
    assert drive.state is State.TRIPPED
    drive.tick(CommandInput())


def stopped(drive: Any) -> None:
    """The stop is over before the filter has run."""
    while drive.state is not State.NEUTRAL_WAIT:
        drive.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT))


def failed(drive: Any) -> None:
    drive.axis.invalidate(State.ACTIVE, ValueError("a filter"))
    drive.tick(CommandInput(enabled=False))
    drive.tick(CommandInput())


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("cut", [tripped, stopped, failed])
def test_a_tap_after_it_runs_nothing_of_it(
    drive_with: DriveWith, cut: Callable[[Any], None], sign: float
) -> None:
    drive = drive_with(late(), LIMITS, stop_s=0.2)
    drive.to_ready().run(CommandInput(sign), 1.0)
    cut(drive)
    drive.run(CommandInput(), 0.1)
    assert drive.state is State.READY
    drive.tick(CommandInput(sign))
    drive.tick(CommandInput())
    for _ in range(25):
        drive.tick(CommandInput())
        assert drive.axis.output.steps == 0


def test_a_motion_that_came_to_rest_costs_the_next_one_nothing(drive_with: DriveWith) -> None:
    drive = drive_with(late(), LIMITS)
    drive.to_ready().run(CommandInput(1.0), 0.1)
    while drive.state is not State.READY:
        drive.tick(CommandInput())
    drive.tick(CommandInput(1.0))
    sent = []
    for _ in range(42):
        drive.tick(CommandInput())
        sent.append(drive.axis.output.setpoint)
    assert max(sent[10:]) > 0.3
