"""State of an axis by the frames on the buses, and its values for the page."""

from dataclasses import dataclass
from typing import Any

from canshaper.studio.words import reason_words, state_level, state_words


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
