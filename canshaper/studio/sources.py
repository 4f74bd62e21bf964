"""How often each source on the buses sends, and how old its last frame is. No clock."""

import contextlib
import os
from collections import deque
from collections.abc import Iterable
from typing import Any

from canshaper.commissioning.doctor.processes import JOYSTICKS_PRIORITY

WINDOW_S = 1.0
"""Frames are counted over the last second."""
MOST_FRAMES = 2000
"""Frames of a source that are counted in it."""


class Sources:
    """When the frames of each source came.

    Args:
        names: the sources, in the order of the page.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._times_s = {name: deque[float](maxlen=MOST_FRAMES) for name in names}

    def on_frame(self, name: str, now_s: float) -> None:
        """Count a frame of a source."""
        self._times_s[name].append(now_s)

    def age_s(self, name: str, now_s: float) -> float | None:
        """Age of the last frame; None before there is any."""
        times_s = self._times_s[name]
        return now_s - times_s[-1] if times_s else None

    def values(self, now_s: float) -> dict[str, Any]:
        """Frames of the last second, and the age of the last frame in seconds, for the page."""
        values = {}
        for name, times_s in self._times_s.items():
            age_s = self.age_s(name, now_s)
            while len(times_s) > 1 and times_s[0] <= now_s - WINDOW_S:
                times_s.popleft()
            fresh = age_s is not None and age_s < WINDOW_S
            values[name] = {
                "per_s": len(times_s) if fresh else 0,
                "age_s": None if age_s is None else round(age_s, 2),
            }
        return values


def before_the_rest() -> None:
    """Let this thread come after the daemon and before all else, where that is permitted.

    A browser that draws without a graphics card takes every processor, and joysticks that are late
    are a fault. What is started from here does not inherit it.
    """
    with contextlib.suppress(OSError, AttributeError):  # only Linux has it
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(JOYSTICKS_PRIORITY))
