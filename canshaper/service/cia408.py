"""A valve of CiA 408: brought step by step into the state in which it follows its set point.

Control and status word as a maker's own driver uses them: init, disabled, hold, active, at least
50 ms apart, each when the status word tells the state before. The set point stays 0 until then,
because the axis is neutral until then.
"""

from typing import Any

from canshaper.can.canopen import READY_BIT, RESET_FAULT, ValveState
from canshaper.can.frame import FrameFault
from canshaper.can.inputs import BoundStatusWord
from canshaper.can.valve import ValveMessage
from canshaper.service.input import GOOD, Input
from canshaper.shaping.states import Reason

STEPS = (ValveState.INIT, ValveState.DISABLED, ValveState.HOLD, ValveState.ACTIVE)
STEP_NS = 50_000_000
# A state that is not reached within this time: once more from the beginning. A valve that boots
# takes more than a second for its self test.
GIVE_UP_NS = 2_000_000_000
RESET_AGAIN_NS = 500_000_000
HOLD = STEPS.index(ValveState.HOLD)


class ValveControl(Input):
    """Control word of one valve, by its status word.

    Args:
        bound: message with the status word.
        control: name of the signal with the control word.
        message: message of the valve, which the control word is put into.
    """

    def __init__(self, bound: BoundStatusWord, control: str, message: ValveMessage) -> None:
        super().__init__(bound)
        self._signal = bound.config.signal
        self._status_timeout_ns = bound.config.timeout_ms * 1_000_000
        self._control = control
        self._message = message
        self._state: int | None = None
        self._told_ns = 0
        self._step = 0
        self._since_ns = 0
        self._reset_ns = 0
        self._reached = False
        self._word = int(ValveState.INIT)
        self.hold()

    def heard(
        self, raw: dict[str, Any], commands: dict[str, float | Reason], now_ns: int, counts: bool
    ) -> FrameFault:
        """The low four bits tell the state."""
        if counts:
            self._state = int(raw[self._signal]) & 0xF
            self._told_ns = now_ns
        return GOOD

    def gate(self, neutral: bool, now_ns: int) -> Reason | None:
        """Why the axis may not move; the control word goes one step on where it is time."""
        if self._state is not None and now_ns - self._told_ns > self._status_timeout_ns:
            self._state = None
        self._next(now_ns)
        self._message.raw[self._control] = self._word
        if self._state == self._word == ValveState.ACTIVE:
            return None
        return Reason.VALVE_NOT_READY if neutral else Reason.VALVE_FAULT

    def _next(self, now_ns: int) -> None:
        """One step on, back to the beginning, or a reset of the valve's fault."""
        passed_ns = now_ns - self._since_ns
        if self._state is None or passed_ns < STEP_NS:
            return
        if self._word == RESET_FAULT:  # what follows it is an edge of the ready bit
            self._go(HOLD, now_ns)
        elif not self._state & READY_BIT and now_ns >= self._reset_ns:
            self._reset_ns = now_ns + RESET_AGAIN_NS
            self._word, self._since_ns = RESET_FAULT, now_ns
        elif self._state == self._word:
            self._reached = True
            if self._step + 1 < len(STEPS):
                self._go(self._step + 1, now_ns)
        elif self._reached or passed_ns > GIVE_UP_NS:
            self._go(0, now_ns)

    def _go(self, step: int, now_ns: int) -> None:
        self._step, self._word, self._since_ns = step, int(STEPS[step]), now_ns
        self._reached = False

    def hold(self) -> None:
        """Let the valve hold: the last thing it is told."""
        self._message.raw[self._control] = int(ValveState.HOLD)

    def forget(self) -> None:
        """Nothing received so far counts any more."""
        super().forget()
        self._state = None
