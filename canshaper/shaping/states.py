"""The words of the state machine: states, reasons, reactions, its input and its transitions.

Status frames carry the numbers of states and reasons; ``make generate`` copies both enumerations
into the DBC files and into docs/states.md. To add a reason, add a member here and a row in
``reasons.py``. Its number decides the reaction, and with it the rows of the table in
``state_machine.py`` that accept it. State names follow OPC 40020-1 where that standard has one
(BYPASS_ON).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Literal, NamedTuple


class State(IntEnum):
    """State of one axis."""

    NEUTRAL_WAIT = 0
    """Output neutral; waiting for a valid, enabled joystick in neutral."""
    READY = 1
    """Output neutral; the next movement of the joystick moves the axis."""
    ACTIVE = 2
    """The joystick drives the axis through the filter; also the bounded run-on after release."""
    BYPASS_ON = 3
    """The joystick drives the axis through the output limits only."""
    STOPPING = 4
    """The input is lost or invalid: command to zero through the filter, bounded in time."""
    TRIPPED = 5
    """Output neutral at once; latched."""


MOVING = frozenset((State.ACTIVE, State.BYPASS_ON, State.STOPPING))
"""The only states in which a valve frame may carry anything but neutral."""


class Reason(IntEnum):
    """Why an axis is in its state; in NEUTRAL_WAIT, what it still waits for."""

    START = 0
    JOYSTICK_NEUTRAL = 1
    JOYSTICK_MOVED = 2
    AT_REST = 3
    BYPASS_REQUESTED = 4
    BYPASS_RELEASED = 5
    STOP_DONE = 6
    RESET = 7
    COMPENSATING = 8
    FLOW_LIMITED = 9
    END_STOP = 10
    JOYSTICK_NOT_NEUTRAL = 16
    ENABLE_OFF = 17
    # Input lost or invalid: bounded shaped stop.
    JOYSTICK_TIMEOUT = 32
    JOYSTICK_ERROR = 33
    JOYSTICK_NOT_AVAILABLE = 34
    JOYSTICK_OUT_OF_RANGE = 35
    JOYSTICK_NOT_A_NUMBER = 36
    SWITCH_INVALID = 37
    JOYSTICK_CONTRADICTORY = 38
    JOYSTICK_FROZEN = 39
    JOYSTICK_UNTRUSTED = 40
    LOOP_OVERRUN = 41
    ADDRESS_NOT_CLAIMED = 42
    NODE_FAULT = 43
    VALVE_NOT_READY = 44
    LENGTH_LOST = 45
    # Neutral at once, latched.
    ENABLE_LOST = 64
    OUTPUT_INVALID = 65
    SEND_FAILED = 66
    LOOP_STALLED = 67
    EMERGENCY_STOP = 68
    EMERGENCY_STOP_LOST = 69
    SECOND_SENDER = 70
    ADDRESS_LOST = 71
    VALVE_FAULT = 72
    OUTPUT_REFUSED = 73


class Reaction(Enum):
    """Reaction of an axis to a reason."""

    NONE = "none"
    """The reason is no fault: the driver did something, or the axis waits for something."""
    SHAPED_STOP = "shaped stop"
    """An axis at rest stays at rest; a moving one stops through its filter, in bounded time."""
    NEUTRAL = "neutral at once"
    """The output is neutral in the same tick, and latched."""


Lost = Literal["longest", "hold", "neutral"]
"""Reaction to an unknown rope length: filter of the longest rope, of the last length, or stop."""


def _reaction(reason: Reason) -> Reaction:
    if reason >= Reason.ENABLE_LOST:
        return Reaction.NEUTRAL
    if reason >= Reason.JOYSTICK_TIMEOUT:
        return Reaction.SHAPED_STOP
    return Reaction.NONE


REACTION_OF: Mapping[Reason, Reaction] = {reason: _reaction(reason) for reason in Reason}
"""Reaction by reason. The reason's number decides it: a reader of a log needs no table."""


class CommandInput(NamedTuple):
    """The checked input of one axis in one tick.

    Attributes:
        command: position of the joystick, [-1, 1]; 0 where it is not valid.
        fault: why the axis must not follow the joystick: it is not valid, or a switch, a node or
            the loop has a fault; None where it may follow.
        enabled: False when a message showed the enable switch released. A lost message leaves it
            True: lost is a fault, which stops the axis through its filter; released trips it.
        bypass: the operator has switched anti-sway off.
        reset: the reset switch is pressed; only its rising edge counts. True while it is unknown.
        trip: a cause for neutral at once that is present in this tick.
    """

    command: float = 0.0
    fault: Reason | None = None
    enabled: bool = True
    bypass: bool = False
    reset: bool = False
    trip: Reason | None = None


@dataclass(frozen=True, slots=True)
class Transition:
    """One change of state, or the first error of a filter in TRIPPED.

    Attributes:
        old: the state before.
        new: the state after.
        reason: why it changed.
        error: the exception of a filter in one line: its type, its text, and file and line that
            raised it; empty where none did. Two transitions that differ in it only are equal.
    """

    old: State
    new: State
    reason: Reason
    error: str = field(default="", compare=False)


class Trust(IntEnum):
    """Trust state of a sway sensor; codes of the status message.

    After a fault the state names the fault until the sensor is trusted again.
    """

    NO_DATA = 0
    """Nothing was received yet."""
    UNPROVED = 1
    """No driven motion has shown yet that it measures this axis with this sign."""
    TRUSTED = 2
    LOST = 3
    """Measurements do not come any more."""
    STUCK = 4
    """The value repeats while the model swings."""
    JUMP = 5
    """The value has jumped further than a grapple can; until the axis is at rest."""
    WRONG_SIGN = 6
    """The sensor shows the opposite of what motion makes."""
    OFFSET = 7
    """Its offset is larger than configured."""
    CONTACT = 8
    """The sensor shows nothing of what motion makes: the grapple leans on something."""
    RESTLESS = 9
    """The command moves far more than the operator asks for; until the axis is at rest."""
