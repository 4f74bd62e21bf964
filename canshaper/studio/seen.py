"""State of each axis and source by the frames on the buses, for the page. No clock."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from canshaper.studio.words import reason_words, state_level, state_words

WINDOW_S = 1.0
"""Frames are counted over the last second."""
MOST_FRAMES = 2000
"""Frames of a source that are counted in it."""


@dataclass
class AxisView:
    """State of an axis; fractions of full, degrees.

    ``opening`` is what the valve frame says, ``valve`` the speed that it means.
    """

    joystick: float | None = None
    opening: float = 0.0
    valve: float | None = None
    state: int | None = None
    reason: int | None = None
    predicted_deg: float | None = None
    profile: str | None = None

    def values(self) -> dict[str, Any]:
        """Everything for the page."""
        return {
            "joystick": rounded(self.joystick),
            "valve": rounded(self.valve),
            "predicted": rounded(self.predicted_deg, 2),
            "state": None if self.state is None else state_words(self.state),
            "level": state_level(self.state),
            "reason": None if self.reason is None else reason_words(self.reason),
            "profile": self.profile,
        }


def rounded(value: float | None, digits: int = 4) -> float | None:
    """A number as short as the page needs it."""
    return None if value is None else round(value, digits)


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
