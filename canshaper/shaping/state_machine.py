"""The state machine of one axis: what an input makes of its state.

Nothing but MOVING states may give anything but neutral, and a MOVING state is entered only from
READY, which takes a fresh, valid, enabled joystick seen in neutral.
"""

from canshaper.shaping.states import MOVING, TRANSITIONS, CommandInput, Reason, State

# A member by way of its class takes ten times as long as a name, and a tick looks at many.
NEUTRAL_WAIT, READY, ACTIVE, BYPASS_ON, STOPPING, TRIPPED = State
# Faults with which the switches are not known either: enable counts as held.
NOTHING_KNOWN = (Reason.JOYSTICK_TIMEOUT, Reason.JOYSTICK_UNTRUSTED)


class StateMachine:
    """State of one axis.

    Args:
        neutral_band: |joystick| up to which it counts as neutral.
        stop_ticks: longest duration of STOPPING.

    Attributes:
        state: the state now.
        reason: why; in NEUTRAL_WAIT, what it still waits for.
    """

    __slots__ = (
        "_neutral_band",
        "_stop_ticks",
        "_stopping",
        "_was_enabled",
        "_was_reset",
        "reason",
        "state",
    )

    def __init__(self, neutral_band: float, stop_ticks: int) -> None:
        self.state = NEUTRAL_WAIT
        self.reason = Reason.START
        self._neutral_band = neutral_band
        self._stop_ticks = stop_ticks
        self._stopping = 0
        self._was_enabled = True
        self._was_reset = True

    def restore(self, state: State, reason: Reason) -> None:
        """Continue in a state in which the output is neutral.

        Raises:
            ValueError: in that state the output need not be neutral.
        """
        if state in MOVING:
            raise ValueError(f"state: expected one with neutral output, got {state.name}")
        self.state, self.reason = state, reason

    def trip(self, reason: Reason) -> None:
        """Neutral and latched, for a reason that is not in the input."""
        self.state, self.reason = TRIPPED, reason

    def hold(self, ticks: int) -> None:
        """So many ticks were missed: they lengthen no stop."""
        self._stopping += ticks

    def step(self, joystick: CommandInput, added: float, at_rest: bool) -> State:
        """Move to the state that this tick's input asks for.

        Args:
            joystick: the checked input.
            added: velocity that another axis asks of this one.
            at_rest: neutral is sent, and the filter can ask for nothing any more.

        Returns:
            The state.
        """
        state = self.state
        command, fault, enabled, bypass, reset, trip = joystick
        centred = pressed = False
        if fault is None:
            centred = abs(command) <= self._neutral_band
            pressed = (reset and not self._was_reset) or (enabled and not self._was_enabled)
            self._was_reset, self._was_enabled = reset, enabled
        else:  # a switch that is held while its frames fail is no rising edge
            self._was_reset = self._was_reset or reset
            self._was_enabled = enabled or fault in NOTHING_KNOWN

        if trip is not None:
            self._latch(trip)
        elif state is ACTIVE or state is BYPASS_ON:
            if not enabled:
                self._go(TRIPPED, Reason.ENABLE_LOST)
            elif fault is not None:
                self._stopping = 0
                self._go(STOPPING, fault)
            elif at_rest and centred and not added:
                self._go(READY, Reason.AT_REST)
            elif bypass is not (state is BYPASS_ON):
                self._switch(bypass)
        elif state is READY:
            self._ready(joystick, centred, added)
        elif state is NEUTRAL_WAIT:
            self._wait(joystick, centred)
        elif state is STOPPING:
            self._stop(joystick, at_rest)
        elif pressed and centred:
            self._go(NEUTRAL_WAIT, Reason.RESET)
        return self.state

    def _latch(self, reason: Reason) -> None:
        if self.state is not TRIPPED:  # of a latched axis the first reason stays
            self._go(TRIPPED, reason)

    def _wait(self, joystick: CommandInput, centred: bool) -> None:
        if joystick.fault is not None:
            self.reason = joystick.fault if joystick.enabled else Reason.ENABLE_OFF
        elif not centred:
            self.reason = Reason.JOYSTICK_NOT_NEUTRAL
        elif not joystick.enabled:
            self.reason = Reason.ENABLE_OFF
        else:
            self._go(READY, Reason.JOYSTICK_NEUTRAL)

    def _ready(self, joystick: CommandInput, centred: bool, added: float) -> None:
        if not joystick.enabled:
            self._go(NEUTRAL_WAIT, Reason.ENABLE_OFF)
        elif joystick.fault is not None:
            self._go(NEUTRAL_WAIT, joystick.fault)
        elif not centred:
            if joystick.bypass:
                self._go(BYPASS_ON, Reason.BYPASS_REQUESTED)
            else:
                self._go(ACTIVE, Reason.JOYSTICK_MOVED)
        elif added:
            self._go(ACTIVE, Reason.COMPENSATING)

    def _switch(self, bypass: bool) -> None:
        if bypass:
            self._go(BYPASS_ON, Reason.BYPASS_REQUESTED)
        else:
            self._go(ACTIVE, Reason.BYPASS_RELEASED)

    def _stop(self, joystick: CommandInput, at_rest: bool) -> None:
        if not joystick.enabled:
            self._go(TRIPPED, Reason.ENABLE_LOST)
            return
        self._stopping += 1
        if self._stopping >= self._stop_ticks or at_rest:
            self._go(NEUTRAL_WAIT, Reason.STOP_DONE)

    def _go(self, state: State, reason: Reason) -> None:
        """The one place where an input changes the state.

        A change that is not declared is a fault of the program: neutral and latched.
        """
        if reason not in TRANSITIONS.get((self.state, state), ()):
            state = TRIPPED
        self.state, self.reason = state, reason
