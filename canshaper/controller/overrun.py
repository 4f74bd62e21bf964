"""Whether so many ticks come late that the filter no longer does what it was tuned for."""

from typing import Self

# A late tick weighs five, a punctual one takes one away. Ten late ones soon after another, or more
# than one in six for long, are an overrun; it ends with the count at 0, after 50 punctual ticks.
LATE_WEIGHT = 5
LATE_LIMIT = 50


class OverrunDetector:
    """Counts late ticks against punctual ones.

    Attributes:
        late: the count; with 0 a punctual tick changes nothing.
    """

    __slots__ = ("_overrun", "late")

    def __init__(self) -> None:
        self.late = 0
        self._overrun = False

    def copy_state(self, before: Self) -> None:
        """Continue where another one has ended."""
        self.late, self._overrun = before.late, before._overrun

    def tick(self, *, late: bool) -> bool:
        """Whether there is an overrun now; asked of every tick while ``late`` is not 0."""
        if late:
            self.late = min(self.late + LATE_WEIGHT, LATE_LIMIT)
            self._overrun |= self.late == LATE_LIMIT
        else:
            self.late -= 1
            self._overrun &= self.late > 0
        return self._overrun
