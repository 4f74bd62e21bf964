"""What is known of one lever now: its last good frame, and whether it still counts."""

from typing import Any

from canshaper.can.binding import BoundLever
from canshaper.can.codecs import WrongLengthError
from canshaper.can.frame import FrameFault
from canshaper.shaping.states import Reason, StickInput


class LeverInput:
    """Takes the frames of one lever; answers what an axis may use of them at a moment."""

    def __init__(self, lever: BoundLever) -> None:
        config = lever.config
        self._codec = lever.codec
        self._timeout_ns = config.timeout_ms * 1_000_000
        self._enable = config.enable
        self._reset = config.reset
        self._off = config.anti_sway_off
        self._alive = config.alive_counter
        self._received_ns: int | None = None
        self._raw: dict[str, Any] = {}
        self._commands: dict[str, float | Reason] = {}

    def receive(self, data: bytes, now_ns: int) -> FrameFault:
        """Take a frame. One with the alive counter of the last is no news and refreshes nothing."""
        try:
            raw, commands = self._codec.decode(data)
        except WrongLengthError:
            return FrameFault.WRONG_LENGTH
        if self._alive and self._raw and raw[self._alive] == self._raw[self._alive]:
            return FrameFault.NONE
        self._raw, self._commands, self._received_ns = raw, commands, now_ns
        invalid = any(isinstance(c, Reason) for c in commands.values())
        if invalid or raw[self._enable] not in (0, 1):
            return FrameFault.INVALID_SIGNAL
        return FrameFault.NONE

    def forget(self) -> None:
        """Nothing received so far counts any more."""
        self._received_ns = None

    def stick(self, signal: str, now_ns: int, trip: Reason | None) -> StickInput:
        """Input of the axis that this signal drives."""
        if self._received_ns is None or now_ns - self._received_ns > self._timeout_ns:
            return StickInput(fault=Reason.STICK_TIMEOUT, trip=trip)
        raw = self._raw
        command = self._commands[signal]
        bypass = self._off is not None and raw[self._off] == 1
        reset = self._reset is not None and raw[self._reset] == 1
        enable = raw[self._enable]
        if isinstance(command, Reason):
            if enable == 0:  # seen released: an immediate stop, not the shaped one of a lost stick
                return StickInput(enabled=False, bypass=bypass, trip=trip)
            return StickInput(fault=command, bypass=bypass, trip=trip)
        if enable not in (0, 1):
            return StickInput(fault=Reason.SWITCH_INVALID, bypass=bypass, trip=trip)
        return StickInput(command, None, enable == 1, bypass, reset, trip)
