"""Feedback of a valve, compared with its commands."""

import math
from collections import deque
from enum import Enum
from typing import Self

from canshaper.config.schema import FeedbackSection as FeedbackConfig
from canshaper.inputs.value import ValueInput, measurable
from canshaper.machine.inputs import BoundValue


class Following(Enum):
    """State of a valve by its feedback."""

    UNKNOWN = "unknown"
    """Nothing was received yet, and it is not late."""
    YES = "following"
    NO = "not-following"
    """The spool is elsewhere than any command of the last moments asked for."""
    LOST = "lost"


class Feedback(ValueInput):
    """Feedback of one valve: estimated flow, or position of the spool.

    Args:
        bound: its message.
        period_s: time between two commands.

    Attributes:
        following: what it says.
    """

    def __init__(self, bound: BoundValue[FeedbackConfig], period_s: float) -> None:
        config, signal = bound.config, bound.signal
        super().__init__(bound, signal, *measurable(signal))
        self._full = config.full if config.full is not None else float(signal.maximum or 0.0)
        self._tolerance = config.tolerance_pct / 100.0
        self._commands = deque([0.0], maxlen=1 + math.ceil(config.settle_ms / 1000.0 / period_s))
        self._waited_for_ns: int | None = None  # the first one, since then
        self.following = Following.UNKNOWN

    @property
    def part(self) -> float:
        """The last value as a part of full."""
        return self.value / self._full

    def check(self, sent: float, now_ns: int) -> bool:
        """Compare with recent commands and this one; return whether ``following`` has changed.

        Args:
            sent: the command as a part of full, without the deadband of the valve.
            now_ns: monotonic time.
        """
        # What the valve shows now may answer any of the commands of its settling time.
        self._commands.append(sent)
        before = self.following
        if self._waited_for_ns is None:
            self._waited_for_ns = now_ns
        last_ns = self._waited_for_ns if self.measured_ns is None else self.measured_ns
        if now_ns - last_ns > self._timeout_ns:
            self.following = Following.LOST
        elif self.measured_ns is not None:
            low = min(self._commands) - self._tolerance
            high = max(self._commands) + self._tolerance
            self.following = Following.YES if low <= self.part <= high else Following.NO
        return self.following is not before

    def copy_state(self, before: Self) -> None:
        """A valve that does not follow is still reported until its feedback says otherwise."""
        super().copy_state(before)
        self.following = before.following

    def invalidate(self) -> None:
        """Invalidate everything received so far."""
        super().invalidate()
        self._waited_for_ns = None
