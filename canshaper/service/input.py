"""A message that is taken: is it whole, right, in sequence, and still fresh?"""

from typing import Any

from canshaper.can.codecs import WrongLengthError
from canshaper.can.frame import FrameFault
from canshaper.can.inputs import BoundInput
from canshaper.shaping.states import Reason


class Input:
    """What is known of one message now.

    Attributes:
        raw: raw values of the last frame that counted, by signal.
        commands: its velocities, or why there is none, by signal.
    """

    def __init__(self, bound: BoundInput) -> None:
        self._codec = bound.codec
        self._guard = bound.guard()
        self._counter = bound.config.alive_counter
        self._timeout_ns = bound.config.timeout_ms * 1_000_000
        self._heard_ns: int | None = None
        self._refused_ns: int | None = None
        self._received_ns: int | None = None
        self.raw: dict[str, Any] = {}
        self.commands: dict[str, float | Reason] = {}

    def receive(self, data: bytes, now_ns: int) -> FrameFault:
        """Take a frame, or say what is wrong with it; only a good one is news."""
        try:
            raw, commands = self._codec.decode(data)
        except WrongLengthError:
            return FrameFault.WRONG_LENGTH
        if self._heard_ns is None or now_ns - self._heard_ns > self._timeout_ns:
            self._guard.begin_anew()
        fault = self._guard.judge(data, raw[self._counter] if self._counter else 0)
        if fault is not FrameFault.CHECKSUM:
            self._heard_ns = now_ns
            self.heard(raw, now_ns)
        if fault or not self._guard.qualified:
            self._refused_ns = now_ns
            return fault
        self.accepted(raw, commands, now_ns)
        self.raw, self.commands, self._received_ns = raw, commands, now_ns
        return self.content_fault()

    def heard(self, raw: dict[str, Any], now_ns: int) -> None:
        """A frame with the right checksum came, be it in sequence or not."""

    def accepted(
        self, raw: dict[str, Any], commands: dict[str, float | Reason], now_ns: int
    ) -> None:
        """A frame counts; the last one still stands in ``raw`` and ``commands``."""

    def content_fault(self) -> FrameFault:
        """What is wrong with the content of the frame just taken."""
        return FrameFault.NONE

    def forget(self) -> None:
        """Nothing received so far counts any more."""
        self._received_ns = self._heard_ns = None

    def lost(self, now_ns: int) -> Reason | None:
        """Why nothing is known now; None while the last good frame is fresh."""
        if self._received_ns is not None and now_ns - self._received_ns <= self._timeout_ns:
            return None
        if self._refused_ns is not None and now_ns - self._refused_ns <= self._timeout_ns:
            return Reason.STICK_UNTRUSTED
        return Reason.STICK_TIMEOUT


class EmergencyStopInput(Input):
    """The emergency stop of a deployment."""

    def __init__(self, bound: BoundInput, signal: str) -> None:
        super().__init__(bound)
        self._signal = signal
        self._pressed_ns = -1
        self._pressed = False

    def heard(self, raw: dict[str, Any], now_ns: int) -> None:
        """A stop needs no trust, and counts however short it is pressed."""
        if raw[self._signal] != 0:
            self._pressed_ns = now_ns
            self._pressed = True

    def accepted(
        self, raw: dict[str, Any], commands: dict[str, float | Reason], now_ns: int
    ) -> None:
        """Only a frame that counts frees it."""
        self._pressed = raw[self._signal] != 0

    def stop(self, now_ns: int, since_ns: int) -> Reason | None:
        """Why nothing may move now, or None.

        Args:
            now_ns: monotonic time.
            since_ns: when this was asked last.
        """
        if self._pressed or self._pressed_ns > since_ns:
            return Reason.EMERGENCY_STOP
        return Reason.EMERGENCY_STOP_LOST if self.lost(now_ns) else None
