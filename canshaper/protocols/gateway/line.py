"""The frames of one joystick on their way through a gateway, and what is sent when none come."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from canshaper.codec.frame import Frame
from canshaper.codec.rewrite import RewrittenMessage
from canshaper.codec.valve import ValveMessage
from canshaper.inputs.joystick import JoystickInput
from canshaper.shaping.states import MOVING, State

if TYPE_CHECKING:
    from canshaper.controller.runner import AxisRunner

# Cycles without a frame of the joystick after which a trip does not wait for the next one.
LATE_CYCLES = 2


class Line:
    """One joystick message between two buses.

    A frame of the joystick that counts leaves at once with the velocities of the last tick. Without
    one there is no frame, but for the end of a motion: the shaped stop after the joystick was lost,
    and neutral after a trip.

    Args:
        message: what leaves.
        joystick: the joystick.
        runners: the axes with their velocities in it.

    Attributes:
        moved: whether the last frame may move a valve.
    """

    def __init__(
        self, message: ValveMessage, joystick: JoystickInput, runners: "Sequence[AxisRunner]"
    ) -> None:
        assert isinstance(message, RewrittenMessage)  # only such axes have one
        self._message = message
        self._joystick = joystick
        self._runners = runners
        self._seen = joystick.raw
        self.moved = False
        self._passed_ns = 0
        cycle_ms = message.sender.fields.message.cycle_time or 0
        self._late_ns = LATE_CYCLES * cycle_ms * 1_000_000

    def news(self) -> bool:
        """Whether a frame of the joystick has counted since this was asked last."""
        before, self._seen = self._seen, self._joystick.raw
        return self._seen is not before

    def pass_on(self, data: bytes, arrived_ns: int, *, stopped: bool) -> Frame:
        """A frame of the joystick as it leaves; nothing else in it is changed.

        Args:
            data: the frame.
            arrived_ns: when it arrived.
            stopped: the emergency stop is pressed, or not heard.
        """
        self._passed_ns = arrived_ns
        stopped = stopped or self._joystick.released  # the axes trip with the next tick only
        for runner in self._runners:
            if stopped or runner.tripping:  # the loop stood still, or the like: this is old
                runner.bound.valve.put(0)
        self.moved = self._moves() and not stopped
        return self._message.onto(data)

    def own(self, now_ns: int) -> Frame | None:
        """A frame of our own, where the axes have just moved and the joystick has none."""
        stopping = any(runner.axis.state in MOVING for runner in self._runners)
        tripped = any(runner.axis.state is State.TRIPPED for runner in self._runners)
        lost = self._joystick.lost(now_ns) is not None
        late = tripped and now_ns - self._passed_ns > self._late_ns
        if not (lost or late) or not (stopping or self.moved):
            return None
        self.moved = self._moves()
        return self._message.own(enabled=stopping)

    def last(self) -> list[Frame]:
        """What is sent before we go: neutral, where the last frame was not."""
        return [self._message.own(enabled=False)] if self.moved else []

    def _moves(self) -> bool:
        return any(runner.axis.raw and not runner.tripping for runner in self._runners)
