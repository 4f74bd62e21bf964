"""The command of a measurement: slowly up, held, slowly down, once in each direction."""

from dataclasses import dataclass

from canshaper.config.limits import Limits

# Slow enough for a lag of 0.3 s, quick enough for a joint that has room for 2 s of full speed.
RATE_PER_S, TOP = 0.1, 0.4


@dataclass(frozen=True, slots=True)
class Ramp:
    """Positive first, then negative, with a rest before each and at the end.

    Attributes:
        rate_per_s: how fast the command rises and falls, parts of full command per second.
        top: largest command, part of full.
        rest_s: length of each rest; how much the feedback trembles is measured in it.
        hold_s: how long the largest command is held.
    """

    rate_per_s: float
    top: float
    rest_s: float = 2.0
    hold_s: float = 1.0

    @property
    def half_s(self) -> float:
        """Time of a rest and one direction."""
        return self.rest_s + 2.0 * self.up_s + self.hold_s

    @property
    def up_s(self) -> float:
        """Time of the way up, or down."""
        return self.top / self.rate_per_s

    @property
    def duration_s(self) -> float:
        """Time of all of it."""
        return 2.0 * self.half_s + self.rest_s

    @property
    def travel_s(self) -> float:
        """How far it goes in one direction, in seconds of full speed; with a dead band less."""
        return self.top * (self.up_s + self.hold_s)

    def command(self, time_s: float) -> float:
        """Command at a time; 0 before the beginning and after the end."""
        half, into_s = divmod(time_s, self.half_s)
        if half not in (0, 1):
            return 0.0
        rising = (into_s - self.rest_s) * self.rate_per_s
        falling = (self.half_s - into_s) * self.rate_per_s
        return min(self.top, max(0.0, min(rising, falling))) * (1.0 if half == 0 else -1.0)

    def part(self, time_s: float) -> str:
        """What the time belongs to: settling, rest, up, hold, held or down, and the direction.

        A rest, and the largest command, are measured in their second half, when all has settled.
        """
        half, into_s = divmod(time_s, self.half_s)
        if half > 1 or into_s < self.rest_s:
            return "rest" if into_s > 0.5 * self.rest_s else "settling"
        direction = "+-"[int(half)]
        into_s -= self.rest_s + self.up_s
        if into_s < 0.0:
            return f"up{direction}"
        if into_s < self.hold_s:
            return f"held{direction}" if into_s > 0.5 * self.hold_s else f"hold{direction}"
        return f"down{direction}"


def usual_top(limits: Limits) -> float:
    """Top of the ramp of an axis, part of full command: as fast as the file allows at most."""
    return min(TOP, limits.max_pct / 100.0)
