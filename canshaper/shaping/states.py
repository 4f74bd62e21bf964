"""States of an axis, the reasons for which it enters them, and what it decides on.

The numbers are those of the status frames; ``make generate`` writes the tables of the DBC files and
of docs/states.md from here. A new reason is a member here and a row in ``reasons.py``. State names
follow OPC 40020-1 where it has one (BYPASS_ON).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import NamedTuple


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
    """What a reason does to an axis."""

    NONE = "none"
    """It is no fault: what the driver does, or what is waited for."""
    SHAPED_STOP = "shaped stop"
    """At rest the axis stays there; in motion it stops through the filter, bounded in time."""
    NEUTRAL = "neutral at once"
    """Neutral in the same tick, and latched."""


REACTION_OF: Mapping[Reason, Reaction] = {
    reason: Reaction.NEUTRAL
    if reason >= Reason.ENABLE_LOST
    else (Reaction.SHAPED_STOP if reason >= Reason.JOYSTICK_TIMEOUT else Reaction.NONE)
    for reason in Reason
}
"""By the number, so that who reads a log knows it without this table."""

_STOPS, _TRIPS = (
    frozenset(reason for reason, reaction in REACTION_OF.items() if reaction is kind)
    for kind in (Reaction.SHAPED_STOP, Reaction.NEUTRAL)
)

TRANSITIONS: Mapping[tuple[State, State], frozenset[Reason]] = {
    (State.NEUTRAL_WAIT, State.READY): frozenset({Reason.JOYSTICK_NEUTRAL}),
    (State.READY, State.NEUTRAL_WAIT): _STOPS | {Reason.ENABLE_OFF, Reason.EMERGENCY_STOP_LOST},
    (State.READY, State.ACTIVE): frozenset({Reason.JOYSTICK_MOVED, Reason.COMPENSATING}),
    (State.READY, State.BYPASS_ON): frozenset({Reason.BYPASS_REQUESTED}),
    (State.ACTIVE, State.READY): frozenset({Reason.AT_REST}),
    (State.ACTIVE, State.BYPASS_ON): frozenset({Reason.BYPASS_REQUESTED}),
    (State.ACTIVE, State.STOPPING): _STOPS,
    (State.BYPASS_ON, State.READY): frozenset({Reason.AT_REST}),
    (State.BYPASS_ON, State.ACTIVE): frozenset({Reason.BYPASS_RELEASED}),
    (State.BYPASS_ON, State.STOPPING): _STOPS - {Reason.LOOP_OVERRUN},
    (State.STOPPING, State.NEUTRAL_WAIT): frozenset({Reason.STOP_DONE}),
    (State.NEUTRAL_WAIT, State.TRIPPED): _TRIPS - {Reason.ENABLE_LOST},
    (State.READY, State.TRIPPED): _TRIPS - {Reason.ENABLE_LOST},
    (State.ACTIVE, State.TRIPPED): _TRIPS,
    (State.BYPASS_ON, State.TRIPPED): _TRIPS,
    (State.STOPPING, State.TRIPPED): _TRIPS,
    (State.TRIPPED, State.NEUTRAL_WAIT): frozenset({Reason.RESET}),
}
"""Every change of state with the reasons for which it may happen; there is no other."""


class CommandInput(NamedTuple):
    """Input of one axis at one tick, already checked.

    Attributes:
        command: joystick in [-1, 1]; not looked at while ``fault`` is set.
        fault: why the joystick (or a switch it needs) cannot be used; None when fresh and valid.
        enabled: False where the enable switch was seen released, be the joystick as it may: a lost
            frame gives a shaped stop, and a released switch an immediate one.
        bypass: the operator asks for the unshaped joystick.
        reset: reset switch (its rising edge counts); True while it is not known.
        trip: a cause for neutral at once that is there now.
    """

    command: float = 0.0
    fault: Reason | None = None
    enabled: bool = True
    bypass: bool = False
    reset: bool = False
    trip: Reason | None = None


@dataclass(frozen=True, slots=True)
class Transition:
    """A change of state, with its reason."""

    old: State
    new: State
    reason: Reason
