"""What happened, with the time of day, for every page."""

import threading
import time
from collections import deque
from typing import NamedTuple

MOST = 500
"""Events kept for a page that opens later."""


class Event(NamedTuple):
    """One line of the list.

    Attributes:
        number: counted from 1.
        time_s: time of day, seconds of the epoch.
        source: a crane, or "page".
        text: what happened.
        level: "info", "warn" or "bad".
        clock_s: the studio's clock then, that of its pictures.
    """

    number: int
    time_s: float
    source: str
    text: str
    level: str
    clock_s: float


class Events:
    """The last events; any thread may add and read."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._events: deque[Event] = deque(maxlen=MOST)
        self._count = 0

    def add(self, source: str, text: str, level: str = "info") -> None:
        """Add one."""
        with self._lock:
            self._count += 1
            self._events.append(
                Event(self._count, time.time(), source, text, level, time.monotonic())
            )

    def since(self, number: int) -> list[Event]:
        """Those after this one, in order."""
        with self._lock:
            return [event for event in self._events if event.number > number]
