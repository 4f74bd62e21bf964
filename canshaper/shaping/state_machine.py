"""The state machine of one axis: a table of rows, and the lines of code that follow it.

How it works
------------
An axis is always in one of six states. In NEUTRAL_WAIT, READY and TRIPPED its valve gets neutral;
only in ACTIVE, BYPASS_ON and STOPPING (``MOVING``) may it get anything else.

Once a tick, ``StateMachine.step`` does two things:

1. It finds the conditions that hold in this tick: the enable switch is released (``RELEASED``), the
   joystick is valid and in neutral (``CENTRED``), and so on. They are the bits defined below.
2. It reads the rows of the present state in ``TABLE`` from top to bottom, and takes the first row
   whose conditions all hold. The row names the next state and the reason. If no row fits, the state
   stays as it is.

So the order of the rows of a state is their priority, and an input makes no change that is not in
the table. Only ``trip`` goes past it, for a filter that fails, and ``restore``, into a state with
neutral output. These promises can be read off the table:

- No axis moves by surprise. Motion begins in READY only. READY is entered from NEUTRAL_WAIT with a
  joystick that is valid, enabled and in neutral, or from motion that has come to rest. A joystick
  that is held through power-up, a fault or a trip moves nothing until it was in neutral.
- A cause for neutral at once wins: ``TRIP`` is the first row of every state that is not latched.
- A trip stays. The one way out of TRIPPED is a press of reset or enable with the joystick in
  neutral, and it leads to NEUTRAL_WAIT. The reason stays too: TRIPPED has no row for another one.
- Motion without an input ends in bounded time: a fault leads to STOPPING, and STOPPING is left at
  the latest when its time is over.

Most rows name their reason. The rows for ``TRIP`` and ``FAULT`` take the cause that the input
names, and list the causes that they accept. Any other cause is a mistake in the program: the axis
trips. Rows of NEUTRAL_WAIT that lead back to it change the reason only: it says what is missing.

What the machine remembers besides state and reason: whether reset and enable were on, since only
the edge of a press counts; and how long STOPPING has lasted.
"""

from collections.abc import Mapping
from typing import NamedTuple

from canshaper.shaping.states import MOVING, REACTION_OF, CommandInput, Reaction, Reason, State

# Python finds a name of the module ten times as fast as a member of an enumeration.
NEUTRAL_WAIT, READY, ACTIVE, BYPASS_ON, STOPPING, TRIPPED = State

# Conditions that may hold in a tick, one bit each.
TRIP = 1 << 0  # a cause for neutral at once is present
RELEASED = 1 << 1  # the enable switch is released
FAULT = 1 << 2  # the joystick cannot be used
CENTRED = 1 << 3  # the joystick is valid, and within its neutral band
DEFLECTED = 1 << 4  # the joystick is valid, and outside of it
PRESSED = 1 << 5  # reset or enable was just pressed, and no cause for neutral is present
SHAPED = 1 << 6  # anti-sway is on
UNSHAPED = 1 << 7  # anti-sway is off
ADDED = 1 << 8  # the motion of two axes moves this axis
NOT_ADDED = 1 << 9  # no motion of two axes moves this axis
AT_REST = 1 << 10  # the valve gets neutral, and nothing was commanded within the tail
STOP_OVER = 1 << 11  # STOPPING has lasted as long as it may

STOPS, TRIPS = (
    frozenset(reason for reason in Reason if REACTION_OF[reason] is reaction)
    for reaction in (Reaction.SHAPED_STOP, Reaction.NEUTRAL)
)
# Enable is lost in motion only: for an axis at rest it is off.
TRIPS_AT_REST = TRIPS - {Reason.ENABLE_LOST}
# After these faults the switches are unknown too. Enable counts as held: its return is no press.
SWITCHES_UNKNOWN = (Reason.JOYSTICK_TIMEOUT, Reason.JOYSTICK_UNTRUSTED)


class Row(NamedTuple):
    """One row of the table.

    Attributes:
        when: the conditions that all have to hold.
        new: the next state.
        why: the reason; or the causes that are accepted, one of which the input has to name.
    """

    when: int
    new: State
    why: Reason | frozenset[Reason]


TABLE: Mapping[State, tuple[Row, ...]] = {
    NEUTRAL_WAIT: (
        Row(TRIP, TRIPPED, TRIPS_AT_REST),
        Row(DEFLECTED, NEUTRAL_WAIT, Reason.JOYSTICK_NOT_NEUTRAL),
        Row(RELEASED, NEUTRAL_WAIT, Reason.ENABLE_OFF),
        Row(FAULT, NEUTRAL_WAIT, frozenset(Reason)),
        Row(CENTRED, READY, Reason.JOYSTICK_NEUTRAL),
    ),
    READY: (
        Row(TRIP, TRIPPED, TRIPS_AT_REST),
        Row(RELEASED, NEUTRAL_WAIT, Reason.ENABLE_OFF),
        # The last two come from interlocks: an enable switch elsewhere, a silent emergency stop.
        Row(FAULT, NEUTRAL_WAIT, STOPS | {Reason.ENABLE_OFF, Reason.EMERGENCY_STOP_LOST}),
        Row(DEFLECTED | SHAPED, ACTIVE, Reason.JOYSTICK_MOVED),
        Row(DEFLECTED | UNSHAPED, BYPASS_ON, Reason.BYPASS_REQUESTED),
        Row(CENTRED | ADDED, ACTIVE, Reason.COMPENSATING),
    ),
    ACTIVE: (
        Row(TRIP, TRIPPED, TRIPS),
        Row(RELEASED, TRIPPED, Reason.ENABLE_LOST),
        Row(FAULT, STOPPING, STOPS),
        Row(CENTRED | AT_REST | NOT_ADDED, READY, Reason.AT_REST),
        Row(UNSHAPED, BYPASS_ON, Reason.BYPASS_REQUESTED),
    ),
    BYPASS_ON: (
        Row(TRIP, TRIPPED, TRIPS),
        Row(RELEASED, TRIPPED, Reason.ENABLE_LOST),
        # Late ticks spoil a filter. BYPASS_ON has none, so the controller does not report them.
        Row(FAULT, STOPPING, STOPS - {Reason.LOOP_OVERRUN}),
        Row(CENTRED | AT_REST | NOT_ADDED, READY, Reason.AT_REST),
        Row(SHAPED, ACTIVE, Reason.BYPASS_RELEASED),
    ),
    STOPPING: (
        Row(TRIP, TRIPPED, TRIPS),
        Row(RELEASED, TRIPPED, Reason.ENABLE_LOST),
        Row(AT_REST, NEUTRAL_WAIT, Reason.STOP_DONE),
        Row(STOP_OVER, NEUTRAL_WAIT, Reason.STOP_DONE),
    ),
    TRIPPED: (Row(PRESSED | CENTRED, NEUTRAL_WAIT, Reason.RESET),),
}
"""The rows of each state, in the order of their priority."""


def transitions() -> dict[tuple[State, State], frozenset[Reason]]:
    """Return all changes of state in the table with their reasons, trips last."""
    reasons: dict[tuple[State, State], frozenset[Reason]] = {}
    for old, rows in TABLE.items():
        for _, new, why in rows:
            if new is not old:
                more = why if isinstance(why, frozenset) else {why}
                reasons[old, new] = reasons.get((old, new), frozenset()) | more
    return {way: reasons[way] for way in sorted(reasons, key=lambda way: TRIPPED in way)}


class StateMachine:
    """State of one axis.

    Args:
        neutral_band: largest |joystick| that counts as neutral.
        stop_ticks: longest duration of STOPPING.

    Attributes:
        state: the present state.
        reason: why the axis is in it; in NEUTRAL_WAIT, what it still waits for.
    """

    __slots__ = (
        "_neutral_band",
        "_stopping",
        "_was_enabled",
        "_was_reset",
        "reason",
        "state",
        "stop_ticks",
    )

    def __init__(self, neutral_band: float, stop_ticks: int) -> None:
        self.state = NEUTRAL_WAIT
        self.reason = Reason.START
        self._neutral_band = neutral_band
        self.stop_ticks = stop_ticks
        self._stopping = 0  # ticks in STOPPING
        # A switch that is on at the start was not pressed.
        self._was_enabled = True
        self._was_reset = True

    def step(self, joystick: CommandInput, at_rest: bool, added: bool) -> State:
        """Find the conditions of this tick, and follow the table.

        Args:
            joystick: the checked input.
            at_rest: the valve gets neutral, and nothing was commanded within the tail.
            added: the motion of two axes moves this axis.

        Returns:
            The state after this tick.
        """
        state = self.state
        command, fault, enabled, bypass, reset, trip = joystick
        holding = UNSHAPED if bypass else SHAPED
        holding |= ADDED if added else NOT_ADDED
        if at_rest:
            holding |= AT_REST
        if trip is not None:
            holding |= TRIP
        if not enabled:
            holding |= RELEASED
        if fault is None:
            holding |= CENTRED if abs(command) <= self._neutral_band else DEFLECTED
            if trip is None and (
                (reset and not self._was_reset) or (enabled and not self._was_enabled)
            ):
                holding |= PRESSED
            self._was_reset, self._was_enabled = reset, enabled
        else:
            holding |= FAULT
            # A switch that is held while its messages fail is not pressed when they come back.
            self._was_reset = self._was_reset or reset
            self._was_enabled = enabled or fault in SWITCHES_UNKNOWN
        if state is STOPPING:
            self._stopping += 1
            if self._stopping >= self.stop_ticks:
                holding |= STOP_OVER

        for when, new, why in TABLE[state]:
            if when & holding == when:
                return self._take(new, why, fault if trip is None else trip)
        return state

    def _take(self, new: State, why: Reason | frozenset[Reason], cause: Reason | None) -> State:
        """Change state and reason; a cause that the row does not accept trips the axis."""
        if isinstance(why, Reason):
            self.state, self.reason = new, why
        else:
            assert cause is not None  # such a row asks for TRIP or FAULT
            self.state, self.reason = (new if cause in why else TRIPPED), cause
        if self.state is STOPPING:
            self._stopping = 0
        return self.state

    def trip(self, reason: Reason) -> None:
        """Trip for a reason that is not in the input, whatever the state."""
        self.state, self.reason = TRIPPED, reason

    def hold(self, ticks: int) -> None:
        """Count missed ticks: they do not lengthen a stop."""
        self._stopping += ticks

    def restore(self, state: State, reason: Reason) -> None:
        """Continue in a state in which the output is neutral.

        Raises:
            ValueError: in that state the output need not be neutral.
        """
        if state in MOVING:
            raise ValueError(f"state: expected one with neutral output, got {state.name}")
        self.state, self.reason = state, reason
