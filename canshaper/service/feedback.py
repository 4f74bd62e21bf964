"""Does the valve do what it is told? Its own feedback, compared with the commands."""

import math
from collections import deque
from enum import Enum
from typing import Any

from cantools.database.can import Signal

from canshaper.can.frame import FrameFault
from canshaper.can.inputs import BoundFeedback
from canshaper.can.signals import find_signal, special_codes
from canshaper.service.input import GOOD, Input
from canshaper.shaping.states import Reason


class Following(Enum):
    """What the feedback of a valve says."""

    UNKNOWN = "unknown"
    """Nothing was heard of it yet, and it is not late."""
    YES = "following"
    NO = "not-following"
    """The spool is elsewhere than any command of the last moments asked for."""
    LOST = "lost"


class Feedback(Input):
    """Feedback of one valve: estimated flow, or position of the spool.

    Args:
        bound: its message.
        period_s: time between two commands.

    Attributes:
        following: what it says.
        value: the last one, as a part of full.
    """

    def __init__(self, bound: BoundFeedback, period_s: float) -> None:
        super().__init__(bound)
        config = bound.config
        signal = find_signal(bound.message, config.signal)
        assert signal is not None  # checked with the deployment
        self._signal = signal
        self._full = config.full if config.full is not None else float(signal.maximum or 0.0)
        self._special = special_codes(signal)
        self._tolerance = config.tolerance_pct / 100.0
        self._commands = deque([0.0], maxlen=1 + math.ceil(config.settle_ms / 1000.0 / period_s))
        self._timeout = config.timeout_ms * 1_000_000
        self._range = _range(signal)
        self._measured_ns: int | None = None  # or since when it is waited for
        self._heard = False
        self.following = Following.UNKNOWN
        self.value = 0.0

    def heard(
        self, raw: dict[str, Any], commands: dict[str, float | Reason], now_ns: int, counts: bool
    ) -> FrameFault:
        """An error code is no measurement, nor is what lies beyond the range."""
        code = raw[self._signal.name]
        value = code * self._signal.scale + self._signal.offset
        low, high = self._range
        if code in self._special or not low <= value <= high:
            return FrameFault.INVALID_SIGNAL
        if counts:
            self._measured_ns, self._heard = now_ns, True
            self.value = value / self._full
        return GOOD

    def check(self, sent: float, now_ns: int) -> bool:
        """Compare with the commands so far and this one; whether ``following`` has changed.

        Args:
            sent: the command as a part of full, without the deadband of the valve.
            now_ns: monotonic time.
        """
        # What the valve shows now may answer any of the commands of its settling time.
        self._commands.append(sent)
        before = self.following
        if self._measured_ns is None:
            self._measured_ns = now_ns
        if now_ns - self._measured_ns > self._timeout:
            self.following = Following.LOST
        elif self._heard:
            low = min(self._commands) - self._tolerance
            high = max(self._commands) + self._tolerance
            self.following = Following.YES if low <= self.value <= high else Following.NO
        return self.following is not before

    def forget(self) -> None:
        """Nothing received so far counts any more."""
        super().forget()
        self._measured_ns, self._heard = None, False


def _range(signal: Signal) -> tuple[float, float]:
    """What of a signal can be a measurement; a millionth more, for the rounding of decimals."""
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or high <= low:
        return -math.inf, math.inf
    return low - 1e-6 * (high - low), high + 1e-6 * (high - low)
