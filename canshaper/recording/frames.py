"""A frame of a log, and what can be wrong with a log."""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from canshaper.errors import CutOffError, LogError

# No clock is there, whether it counts from 1970 or from the start of the log: the year 2286.
LATEST_S = 10_000_000_000
MOST_BYTES = 64  # of a frame, which is one of CAN FD where it has more than 8


class TimedFrame(NamedTuple):
    """A data frame with the time of its reception.

    Attributes:
        time_ns: on the clock of the log, whatever that counts from.
        channel: as the log names it; empty where the format has no channels.
        can_id: 11 or 29 bits.
        extended: whether it has 29.
        data: up to 8 bytes, of CAN FD up to 64.
    """

    time_ns: int
    channel: str
    can_id: int
    extended: bool
    data: bytes


def fits(can_id: int, *, extended: bool) -> bool:
    """Whether an id has room in its 11 or 29 bits."""
    return can_id < 1 << (29 if extended else 11)


@dataclass
class Place:
    """Where in a log the reader is, for people, and what it has left out so far.

    Attributes:
        path: the log.
        unit: what is counted: lines or frames.
        number: the one that is being read, from 1.
        left_out: frames that are no data frames, by kind.
    """

    path: Path
    unit: str = "line"
    number: int = 0
    left_out: Counter[str] = field(default_factory=Counter)

    def error(self, got: str, expected: str) -> LogError:
        """What is wrong here."""
        return LogError(f"{self}: expected {expected}, got {got}")

    def cut_off(self, reason: str) -> CutOffError:
        """The log ends here, in the middle of something."""
        return CutOffError(f"{self}: the log is cut off: {reason}")

    def __str__(self) -> str:
        if not self.number:  # nothing is read yet: it is about the whole file
            return str(self.path)
        if self.unit == "line":
            return f"{self.path}:{self.number}"
        return f"{self.path}: {self.unit} {self.number}"
