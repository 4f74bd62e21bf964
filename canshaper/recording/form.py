"""The form of an exported drive: frames, values with units, events, pose of the crane.

Each format has a ``Writer``; ``export`` decides for all formats what is written.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Protocol

from canshaper.recording.listen import ReceivedFrame
from canshaper.shaping.states import Reason, State

EXTRAS = {".mcap": "mcap", ".mf4": "mf4"}
"""Suffixes that are exported, and the extra that each needs."""


class Channel(NamedTuple):
    """One value over time: name, unit, and the texts of its values if it is a code."""

    name: str
    unit: str = ""
    texts: Mapping[int, str] | None = None


class Group(NamedTuple):
    """Channels with common times; the name is a path, such as axes/slew."""

    name: str
    channels: tuple[Channel, ...]


Row = Callable[[int, Sequence[float]], None]
"""Writes the values of a group at a time in ns, in the order of its channels."""
Point = tuple[float, float, float]
"""x along the boom that has not slewed, y, z upwards, in m from the foot of the pillar."""


class Writer(Protocol):
    """A file of one format; times are ns since 1970, or since the start of a log."""

    def frame(self, frame: ReceivedFrame, *, sent: bool = False) -> None:
        """Write a frame as it was on its bus; ``sent``: the replayed program sent it."""

    def group(self, group: Group) -> Row:
        """Return a function that writes the values of a new group."""

    def event(self, time_ns: int, text: str) -> None:
        """Write an event as a line for people."""

    def pose(self, time_ns: int, boom: Sequence[Point], grapple: Point) -> None:
        """Write the pose of the crane: the points of its boom up to the tip, and the grapple."""

    def close(self) -> None:
        """Write all data still in memory, and end the file."""


AXIS = (
    Channel("command"),
    Channel("applied"),
    Channel("sway", "deg"),
    Channel("state", "", {one.value: one.name for one in State}),
    Channel("reason", "", {one.value: one.name for one in Reason}),
)
POSE = (
    Channel("slew", "deg"),
    Channel("radius", "m"),
    Channel("height", "m"),
    Channel("sway_across", "deg"),
    Channel("sway_along", "deg"),
)


def install(extra: str) -> str:
    """Return the end of a message: that something is missing, and the command that installs it."""
    return f"which is missing: pip install 'canshaper[{extra}]'"
