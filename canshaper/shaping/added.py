"""Bounds of a velocity that one axis adds to another, whose joystick may be in neutral.

An act lasts from ``begin`` to ``begin``. In each act the added part is bounded in speed, in the way
that it takes the axis from where it was, and in the time for which it moves it. The axis reports
what it really added, so the bounds hold for what the valve gets, not for what was asked.
"""

import math

# How far the axis may be from where it is asked to be, in seconds of full speed: what rates and
# rounding leave out. Beyond it a part was refused, and its way back is refused too.
MOST_AHEAD_S = 0.01


class AddedBounds:
    """How much may be added now.

    Velocities are fractions of the axis' full speed, ways are in seconds of full speed.

    Args:
        tick_s: time between two ticks of the axis.
        largest: largest |velocity| added, 0 to 1.
        path_s: farthest from where the act began, to either side.
        time_s: longest time in motion.
        least: |velocity| from which on the axis counts as moved, half a step of its valve.
    """

    __slots__ = (
        "_asked_s",
        "_largest",
        "_least",
        "_left",
        "_now",
        "_path_s",
        "_tick_s",
        "_ticks",
        "_way_s",
    )

    def __init__(
        self, tick_s: float, *, largest: float, path_s: float, time_s: float, least: float
    ) -> None:
        self._path_s = path_s
        self._tick_s = tick_s
        self._largest = largest
        self._least = least
        self._ticks = round(time_s / tick_s)
        self.begin()

    def begin(self) -> None:
        """The act is over: the next one begins where the axis is."""
        self._left = self._ticks
        self._asked_s = self._way_s = 0.0
        self._now = 0.0

    def limit_path(self, path_s: float) -> None:
        """Change the farthest from where the act began; what is left of an act counts on."""
        self._path_s = path_s

    def wanted(self, wish: float, fall_per_s: float) -> float:
        """What may be asked for in this tick, so that the way is long enough to fall to rest.

        Args:
            wish: what the other axis asks.
            fall_per_s: rate by which it falls at the end of the way, full speeds per second.
        """
        path_s, largest = self._path_s, self._largest
        wish = min(max(wish, -largest), largest)
        self._asked_s += wish * self._tick_s
        ahead_s = self._way_s - min(max(self._asked_s, -path_s), path_s)
        if (wish > 0.0 and ahead_s > MOST_AHEAD_S) or (wish < 0.0 and ahead_s < -MOST_AHEAD_S):
            return 0.0
        room_s = path_s - (self._way_s if wish > 0.0 else -self._way_s)
        if self._left <= 0 or room_s <= 0.0:
            return 0.0
        # v dt + v^2 / (2 fall) = room
        step = fall_per_s * self._tick_s
        most = math.sqrt(step * step + 2.0 * fall_per_s * room_s) - step
        return min(max(wish, -most), most)

    def kept(self, added: float) -> float:
        """What may be added in this tick after the rates of the axis, which may hold it up."""
        if self._left <= 0:
            return 0.0
        lowest = max(-self._largest, min(0.0, -self._path_s - self._way_s) / self._tick_s)
        highest = min(self._largest, max(0.0, self._path_s - self._way_s) / self._tick_s)
        return min(max(added, lowest), highest)

    def applied(self, velocity: float) -> None:
        """Take note of what was added in this tick."""
        self._now = velocity
        self.held(1)

    def held(self, ticks: int) -> None:
        """The last output was held for so many ticks."""
        self._way_s += self._now * ticks * self._tick_s
        if abs(self._now) >= self._least:
            self._left -= ticks


def without_opposing(added: float, command: float, target: float) -> float:
    """What is left of an added velocity without what goes against a joystick that is held.

    Args:
        added: the velocity that another axis adds.
        command: the operator's command.
        target: what is asked for on its account.

    Raises:
        ValueError: the added one is no velocity.
    """
    if not abs(added) <= 1.0:
        raise ValueError(f"added velocity is {added}")
    if command > 0.0:
        return max(added, min(0.0, target) - target)
    if command < 0.0:
        return min(added, max(0.0, target) - target)
    return added
