"""Why an axis has to stop or may not begin, besides what its joystick says."""

from collections.abc import Callable, Sequence
from typing import Self

from canshaper.codec.frame import FrameFault
from canshaper.inputs.input import GOOD, Input, Raw, Switch
from canshaper.machine.inputs import BoundInput
from canshaper.shaping.states import REACTION_OF, Reaction, Reason

# Time for which another sender must be silent before a trip for it can be reset: ten periods of a
# slow valve message.
FOREIGN_NS = 1_000_000_000
Interlock = Callable[[bool, int], Reason | None]
"""Takes whether the axis is neutral, and the time; returns why it may not move, or None."""


class EnableGate:
    """Interlock by the switches that enable a joystick, except the one to press.

    That they agree again is no press: it resets nothing.

    Args:
        switches: switches that all have to agree.
    """

    def __init__(self, switches: Sequence[Switch]) -> None:
        self._switches = tuple(switches)
        self._releases = self._count()

    def __call__(self, neutral: bool, now_ns: int) -> Reason | None:
        """Return ENABLE_OFF (neutral) or ENABLE_LOST; None if all agreed since the last call."""
        releases, self._releases = self._releases, self._count()
        agree = releases == self._releases
        if agree and not any(one.released or one.lost(now_ns) for one in self._switches):
            return None
        return Reason.ENABLE_OFF if neutral else Reason.ENABLE_LOST

    def _count(self) -> int:
        return sum(switch.releases for switch in self._switches)


class EmergencyStopInput(Input):
    """Receives the message of the emergency stop.

    Attributes:
        presses: number of frames that showed it pressed.
    """

    def __init__(self, bound: BoundInput, signal: str) -> None:
        super().__init__(bound)
        self._signal = signal
        self.presses = 0
        self._pressed = False

    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Take a frame: any frame can show a press, only an accepted one ends it."""
        if raw[self._signal] != 0:
            self.presses += 1
            self._pressed = True
        elif accepted:
            self._pressed = False
        return GOOD

    def copy_state(self, before: Self) -> None:
        """Keep the stop pressed until an accepted frame says otherwise."""
        super().copy_state(before)
        self._pressed = before._pressed

    def stops(self, now_ns: int) -> bool:
        """Return whether the stop is pressed or its message lost, so that nothing may move."""
        return self._pressed or self.lost(now_ns) is not None

    def stop(self, now_ns: int, presses: int) -> Reason | None:
        """Return why nothing may move now, or None.

        Args:
            now_ns: monotonic time.
            presses: ``self.presses`` at the last call.
        """
        if self._pressed or self.presses > presses:
            return Reason.EMERGENCY_STOP
        return Reason.EMERGENCY_STOP_LOST if self.lost(now_ns) else None


class StopCauses:
    """Causes for which one axis stops or may not begin.

    Attributes:
        interlocks: they have to agree before the axis may move; the first objection counts.
        trip: cause for which the next tick trips the axis, neutral at once and latched; None
            without one. A later cause may replace it.
        invalid: whether its input was lost since the last tick, even if it is back by now.
        foreign_ns: arrival of another sender's last frame with the id of its valve; None after 1 s.
    """

    def __init__(self) -> None:
        self.interlocks: list[Interlock] = []
        self.trip: Reason | None = None
        self.invalid = False
        self.foreign_ns: int | None = None
        self._presses = 0  # of the emergency stop, as this axis knows them

    def foreign_sender(self, now_ns: int) -> None:
        """Trip, because another sender has sent a frame with the id of this valve."""
        self.trip = self.trip or Reason.SECOND_SENDER
        self.foreign_ns = now_ns

    def see(self, emergency: EmergencyStopInput) -> None:
        """Trip for a press since the last tick of the axis, even if it is over by now."""
        if emergency.presses != self._presses:
            self.trip = self.trip or Reason.EMERGENCY_STOP

    def copy_state(self, before: Self) -> None:
        """Take over the causes on which the axis had not acted before a reload."""
        self.trip = before.trip or self.trip
        self.foreign_ns = before.foreign_ns or self.foreign_ns

    def fault(
        self, now_ns: int, emergency: EmergencyStopInput | None, *, neutral: bool
    ) -> Reason | None:
        """Return why the axis stops shaped or may not begin; put what acts at once into ``trip``.

        Args:
            now_ns: monotonic time.
            emergency: the emergency stop, or None.
            neutral: whether the axis is neutral.
        """
        trip, fault = self.trip, None
        if self.foreign_ns is not None:
            if now_ns - self.foreign_ns <= FOREIGN_NS:
                trip = trip or Reason.SECOND_SENDER
            else:
                self.foreign_ns = None
        for interlock in self.interlocks:
            objection = interlock(neutral, now_ns)
            if objection is not None and REACTION_OF[objection] is Reaction.NEUTRAL:
                trip = trip or objection
            else:
                fault = fault or objection
        if emergency is not None:
            stop = emergency.stop(now_ns, self._presses)
            self._presses = emergency.presses
            if stop is Reason.EMERGENCY_STOP or (stop and not neutral):
                trip = trip or stop
            else:  # nothing received yet: nothing to trip, but nothing may begin
                fault = fault or stop
        if self.invalid:
            self.invalid = False
            fault = fault or Reason.JOYSTICK_TIMEOUT
        self.trip = trip
        return fault
