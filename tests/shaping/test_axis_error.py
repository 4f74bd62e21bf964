"""A filter raises: the transition says what, and where."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.output import Output
from canshaper.shaping.states import CommandInput, Reason, State, Transition

DriveWith = Callable[..., Any]
PUSHED = CommandInput(0.8)
INVALID = Transition(State.ACTIVE, State.TRIPPED, Reason.OUTPUT_INVALID)


class Faulty:
    """A filter of another package, with a mistake in it."""

    error: Exception | None = None

    def step(self, command: float) -> float:
        if self.error is not None:
            raise self.error
        return command


LINE = Faulty.step.__code__.co_firstlineno + 2


class Unprintable(Exception):
    def __str__(self) -> str:
        raise RuntimeError


NOTED = ValueError("a")
NOTED.add_note("of 3")


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (ZeroDivisionError("a mistake on line 7"), "ZeroDivisionError: a mistake on line 7"),
        (KeyError(), "KeyError"),
        (ValueError("a\n  b"), "ValueError: a b"),
        (NOTED, "ValueError: a of 3"),
        (ValueError("x" * 1000), "ValueError: " + "x" * 188),
        (Unprintable(), f"{__name__}.Unprintable: <exception str() failed>"),
    ],
)
@pytest.mark.parametrize("missed", [False, True])
def test_the_transition_has_type_text_and_place_of_the_error(
    drive_with: DriveWith, error: Exception, text: str, missed: bool
) -> None:
    faulty = Faulty()
    drive = drive_with(faulty).moving()
    faulty.error = error
    tripped = drive.axis.hold(3) if missed else drive.tick(PUSHED)
    assert tripped == INVALID
    assert tripped.error == f"{text} ({__file__}:{LINE})"
    assert drive.axis.output == Output()


def test_a_filter_that_gives_no_number_is_named_too(drive_with: DriveWith) -> None:
    class Wrong:
        says = 0.5

        def step(self, command: float) -> float:
            return self.says

    wrong = Wrong()
    drive = drive_with(wrong).moving()
    wrong.says = math.nan
    tripped = drive.tick(PUSHED)
    assert tripped == INVALID
    assert tripped.error.startswith("ValueError: filter output is nan (")


def test_an_added_velocity_that_is_none_is_named_too(drive_with: DriveWith) -> None:
    drive = drive_with(Faulty())
    drive.axis.allow_added(0.25, 5.0)
    tripped = drive.moving().axis.tick(PUSHED, math.nan)
    assert tripped == INVALID
    assert tripped.error.startswith("ValueError: added velocity is nan (")


def test_an_axis_without_a_sway_model_trips_too() -> None:
    faulty = Faulty()
    axis = ShapedAxis(0.02, OutputLimits(), sway=None, shaper=faulty)
    axis.tick(CommandInput())
    faulty.error = ZeroDivisionError("again")
    assert axis.tick(PUSHED) == Transition(State.READY, State.TRIPPED, Reason.OUTPUT_INVALID)
    assert axis.output.steps == 0


def test_a_filter_that_goes_on_raising_is_reported_once(drive_with: DriveWith) -> None:
    faulty = Faulty()
    drive = drive_with(faulty).moving()
    faulty.error = ZeroDivisionError("again")
    assert drive.tick(PUSHED) == INVALID
    assert drive.tick(PUSHED) is None
    assert drive.axis.hold(3) is None
    assert (drive.state, drive.axis.reason) == (State.TRIPPED, Reason.OUTPUT_INVALID)


STOPPED = Transition(State.TRIPPED, State.TRIPPED, Reason.EMERGENCY_STOP)


@pytest.mark.parametrize("missed", [False, True])
def test_a_failure_in_tripped_is_reported_and_leaves_the_first_reason(
    drive_with: DriveWith, missed: bool
) -> None:
    faulty = Faulty()
    drive = drive_with(faulty).moving()
    drive.tick(CommandInput(trip=Reason.EMERGENCY_STOP))
    faulty.error = ZeroDivisionError("late")
    reported = drive.axis.hold(3) if missed else drive.tick(PUSHED)
    assert reported == STOPPED
    assert reported.error == f"ZeroDivisionError: late ({__file__}:{LINE})"
    assert drive.axis.reason is Reason.EMERGENCY_STOP
    assert drive.tick(PUSHED) is None
    # The reset ends the first trip, and the filter that still fails makes the next one.
    drive.tick(CommandInput(enabled=False))
    again = drive.tick(CommandInput())
    assert again == Transition(State.TRIPPED, State.TRIPPED, Reason.OUTPUT_INVALID)
    assert again.error == reported.error
    faulty.error = None
    drive.tick(CommandInput(enabled=False))
    assert drive.tick(CommandInput()).error == ""
    assert drive.axis.error == ""


def test_a_failure_in_the_tick_of_a_trip_leaves_its_reason(drive_with: DriveWith) -> None:
    faulty = Faulty()
    drive = drive_with(faulty).moving()
    faulty.error = ZeroDivisionError("late")
    tripped = drive.tick(CommandInput(trip=Reason.EMERGENCY_STOP))
    assert tripped == Transition(State.ACTIVE, State.TRIPPED, Reason.EMERGENCY_STOP)
    assert tripped.error.startswith("ZeroDivisionError: late (")


def test_without_a_failure_missed_ticks_change_nothing(drive_with: DriveWith) -> None:
    assert drive_with().moving().axis.hold(3) is None
