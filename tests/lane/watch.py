"""Time limit and signals of a running command: ask first, end by force after a grace."""

import signal
import time
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Self

from .outcome import TIME_LIMIT, say

FORWARDED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Watch:
    """Says when a command must be ended, and with which status.

    A first signal is delivered to the command, which then has ``grace_s`` to end by itself (pytest
    prints its summary); a second one ends the lane at once, and so does any before ``started``.
    At the time limit the command gets a TERM and the same grace. While the context is entered,
    signals only set marks here, so that cleaning up inside it is not interrupted.
    """

    def __init__(self, timeout_s: float, grace_s: float) -> None:
        self._timeout_s = timeout_s
        self._grace_s = grace_s
        self._deliver: Callable[[signal.Signals], None] | None = None
        self._deadline: float | None = None
        self._limited = False
        self._ending: int | None = None  # the status, once the command has been asked to end
        self._force_at = float("inf")
        self._before: list[tuple[signal.Signals, object]] = []

    def __enter__(self) -> Self:
        for number in FORWARDED:
            self._before.append((number, signal.signal(number, self._on_signal)))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._before:
            signal.signal(number, handler)  # type: ignore[arg-type]

    def started(self, deliver: Callable[[signal.Signals], None]) -> None:
        """Note that the command runs: signals go to ``deliver`` from here on, its time counts."""
        self._deliver = deliver
        if self._timeout_s:
            self._deadline = time.monotonic() + self._timeout_s

    def verdict(self) -> int | None:
        """Return the status to end with by force now, or None; to be called regularly."""
        now = time.monotonic()
        if self._deadline is not None and now >= self._deadline:
            self._deadline = None
            self._limited = True
            say(f"time limit of {self._timeout_s:g} s: ending the command")
            self._request_end(signal.SIGTERM, TIME_LIMIT)
        return self._ending if now >= self._force_at else None

    def status(self, command: int) -> int:
        """Return the lane's exit status for a command that ended with this one."""
        return TIME_LIMIT if self._limited else command

    def _request_end(self, number: signal.Signals, ending: int) -> None:
        self._ending = ending
        self._force_at = time.monotonic() + self._grace_s
        if self._deliver is not None:
            self._deliver(number)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if self._deliver is not None and self._ending is None:
            self._request_end(signal.Signals(number), 128 + number)
        else:
            self._ending = self._ending or 128 + number
            self._force_at = 0.0
