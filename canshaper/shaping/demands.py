"""Demands in front of the filters: bounded ahead of end stops, and scaled by the oil there is.

A stop takes its speed from the tip at once, and the grapple swings. So the demand is bounded by the
distance that is left once everything has come that the axis still asks for without any demand. It
dies away with ``TIME_S``, the filter shapes that as any other demand, and an operator can creep up
to the stop.

A filter cancels the swing of the speeds that it asks for. Where the pump delivers less, the valves
give other speeds, and swing is left. So the demands of all axes are scaled by one factor: the tip
goes where the operator points, only slower.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from operator import mul

from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.sway import SwayModel

# Time constant with which the demand dies away ahead of a stop. A swing that is damped meanwhile
# may take the axis to and fro: with half of it that met the stop.
TIME_S = 0.6
# Part of a demand that counts as nothing.
NOTHING_S = 1e-3
UNBOUNDED = -math.inf, math.inf


@dataclass(frozen=True, slots=True)
class EndStops:
    """Where an axis has to stop.

    Attributes:
        lowest, highest: positions at which it stops.
        full_speed: change of the position per second at full positive command; not 0.
        lag_s: how long it moves on with the velocity that was sent last: lag of the valve, and age
            of the position.
    """

    lowest: float
    highest: float
    full_speed: float
    lag_s: float

    def room(
        self, position: float, velocity: float, run_on: tuple[float, float]
    ) -> tuple[float, float]:
        """How far the axis may still move in both directions, full speed times seconds.

        What still comes away from a stop gives no room: it may be cut off.

        Args:
            position: measured now.
            velocity: sent last, [-1, 1].
            run_on: see ``RunOn``.

        Returns:
            (negative or 0, positive or 0).
        """
        one = (self.lowest - position) / self.full_speed
        other = (self.highest - position) / self.full_speed
        back, ahead = (one, other) if one < other else (other, one)
        late = self.lag_s * velocity
        back -= min(run_on[0] + min(late, 0.0), 0.0)
        ahead -= max(run_on[1] + max(late, 0.0), 0.0)
        return min(back, 0.0), max(ahead, 0.0)


class RunOn:
    """Travel that a filter still asks for when its demand ends.

    It is that of the filter alone: what limits cut off, and what damps the swing of that, moves the
    axis to and fro.

    Args:
        shaper: a filter without a memory, which is used up.
        sway: its sway model.
        tick_s: time between two demands.
        tail_s: how long anything may run on.
    """

    __slots__ = ("_left", "_negative", "_positive")

    def __init__(
        self, shaper: Shaper, sway: SwayModel | None, tick_s: float, tail_s: float
    ) -> None:
        left, after = 1.0, []
        for tick in range(round(tail_s / tick_s) + 1):
            output = shaper.step(0.0 if tick else 1.0)
            if sway is not None:
                sway.step(output)
            left -= output
            after.append(left * tick_s)
        while after and abs(after[-1]) < NOTHING_S * tick_s:
            after.pop()
        self._left = after  # of a full demand so many ticks ago, full speed times seconds
        nothing = [0.0] * len(after)
        self._negative = deque(nothing, maxlen=len(after))
        self._positive = deque(nothing, maxlen=len(after))

    def add(self, demand: float, ticks: int) -> None:
        """Take the demand of the last ticks, [-1, 1]."""
        back, ahead = (demand, 0.0) if demand < 0.0 else (0.0, demand)
        for _ in range(min(ticks, len(self._left))):
            self._negative.appendleft(back)
            self._positive.appendleft(ahead)

    def travel(self) -> tuple[float, float]:
        """Return what negative and what positive demands still ask for, each by itself.

        Where a reversal cuts off what is left of the one, all of the other comes.
        """
        left, negative, positive = self._left, self._negative, self._positive
        return (
            sum(map(mul, left, negative)) if any(negative) else 0.0,
            sum(map(mul, left, positive)) if any(positive) else 0.0,
        )


def bounds(room: tuple[float, float], displaced: float) -> tuple[float, float]:
    """Smallest and largest demand, [-1, 1], with so much room.

    Args:
        room: see ``EndStops.room``.
        displaced: how far a motion has moved the axis, full speed times seconds; it moves it back.
    """
    back, ahead = room
    low = (back + max(displaced, 0.0)) / TIME_S
    high = (ahead + min(displaced, 0.0)) / TIME_S
    return min(max(low, -1.0), 0.0), max(min(high, 1.0), 0.0)


# The factor falls at once: oil that is not there comes from no valve. It rises so slowly that the
# operator sees no jump where another axis stops.
RISE_S = 0.5


class FlowBudget:
    """The factor of all demands, tick by tick.

    Args:
        shares: of each axis at full speed, full axis flows.
        tick_s: time between two calls of ``step``.

    Attributes:
        scale: the factor, 0 to 1.
    """

    __slots__ = ("_rise", "_shares", "scale")

    def __init__(self, shares: Sequence[float], tick_s: float) -> None:
        self._shares = shares
        self._rise = tick_s / RISE_S
        self.scale = 1.0

    def step(
        self, flow: float, demands: Sequence[float], outputs: Sequence[float], ticks: int = 1
    ) -> float:
        """Find the factor of this tick.

        An axis whose demand has ended, or was reversed, still asks for what its filter lets run on.

        Args:
            flow: what the pump delivers, full axis flows, less what others take.
            demands: of the operator, by axis, [-1, 1].
            outputs: velocities sent in the last tick, by axis, [-1, 1] of full speed.
            ticks: that have passed; more than 1 where deadlines were missed.
        """
        asked, free = 0.0, flow
        for share, demand, output in zip(self._shares, demands, outputs, strict=True):
            asked += share * abs(demand)
            if demand * output <= 0.0:
                free -= share * abs(output)
        wanted = max(free, 0.0) / asked if asked > max(free, 0.0) else 1.0
        self.scale = min(wanted, self.scale + self._rise * ticks)
        return self.scale
