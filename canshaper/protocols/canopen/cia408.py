"""A valve of CiA 408: brought step by step into the state in which it follows its set point.

Control and status word as a maker's own driver uses them: init, disabled, hold, active, at least
50 ms apart, each when the status word shows the state before. The set point stays 0 until then,
because the axis is neutral until then. A fault is reset by an edge of the ready bit; the axis stays
tripped until the operator resets it.
"""

from canshaper.codec.frame import READY_BIT, RESET_FAULT, STATE_BITS, FrameFault, ValveState
from canshaper.codec.message import Sender
from canshaper.config.schema import StatusWord
from canshaper.inputs.input import GOOD, Input, Raw
from canshaper.machine.inputs import Bound
from canshaper.shaping.states import Reason

STEPS = (ValveState.INIT, ValveState.DISABLED, ValveState.HOLD, ValveState.ACTIVE)
HOLD = STEPS.index(ValveState.HOLD)
STEP_NS = 50_000_000
# Time for a state to be reached; then the sequence starts again. A valve that boots is not ready
# for more than a second, and no fault is reset before this time.
GIVE_UP_NS = 2_000_000_000
RESET_AGAIN_NS = 500_000_000
STATE_MASK = (1 << STATE_BITS) - 1


class ValveControl(Input):
    """Control word of one valve, by its status word.

    Args:
        bound: message with the status word.
        control: name of the signal with the control word.
        message: sends the message of the valve, which the control word is put into.
    """

    # Set by _go and _put.
    _step: int
    _reached: bool
    _word: int
    _since_ns: int | None  # when this word was first put; None: at the next tick

    def __init__(self, bound: Bound[StatusWord], control: str, message: Sender) -> None:
        super().__init__(bound)
        self._signal = bound.config.signal
        self._status_timeout_ns = bound.config.timeout_ms * 1_000_000
        self._control = control
        self._message = message
        self._state: int | None = None
        self._state_ns = 0
        self._left = False  # it was in another state than ACTIVE since it was looked at
        self._reset_ns = 0
        self._go(0, None)

    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Take the state in the low four bits; leaving ACTIVE counts in any frame."""
        state = int(raw[self._signal]) & STATE_MASK
        self._left |= state != ValveState.ACTIVE
        if accepted:
            self._state, self._state_ns = state, arrived_ns
        return GOOD

    def gate(self, neutral: bool, now_ns: int) -> Reason | None:
        """Return why the axis may not move; move the control word on when it is time."""
        if self._state is None or now_ns - self._state_ns > self._status_timeout_ns:
            self.resync()
        self._next(now_ns)
        works = self._state == self._word == ValveState.ACTIVE and not self._left
        self._left = False
        if works:
            return None
        return Reason.VALVE_NOT_READY if neutral else Reason.VALVE_FAULT

    def _next(self, now_ns: int) -> None:
        """Take the next step, start again, or reset the valve's fault."""
        if self._since_ns is None:
            self._since_ns = now_ns
        passed_ns = now_ns - self._since_ns
        if self._state is None or passed_ns < STEP_NS:
            return
        boots = self._step == 0 and passed_ns <= GIVE_UP_NS
        if self._word == RESET_FAULT:  # what follows it is an edge of the ready bit
            self._go(HOLD, now_ns)
        elif not self._state & READY_BIT and not boots:
            if now_ns >= self._reset_ns:
                self._reset_ns = now_ns + RESET_AGAIN_NS
                self._put(RESET_FAULT, now_ns)
        elif self._state == self._word:
            self._reached = True
            if self._step + 1 < len(STEPS):
                self._go(self._step + 1, now_ns)
        elif self._reached or passed_ns > GIVE_UP_NS:
            self._go(0, now_ns)

    def resync(self) -> None:
        """Forget all that is known of the valve, and start from INIT."""
        self._state = None
        self._go(0, None)

    def _go(self, step: int, now_ns: int | None) -> None:
        self._step, self._reached = step, False
        self._put(int(STEPS[step]), now_ns)

    def _put(self, word: int, now_ns: int | None) -> None:
        self._word, self._since_ns = word, now_ns
        self._message.raw[self._control] = word

    def hold(self) -> None:
        """Let a valve that is active hold: its last command."""
        if self._word == ValveState.ACTIVE:
            self._message.raw[self._control] = int(ValveState.HOLD)

    def invalidate(self) -> None:
        """Invalidate everything received so far."""
        super().invalidate()
        self.resync()
