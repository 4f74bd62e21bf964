"""Demands in front of the filters: bounded ahead of end stops, and scaled by the oil there is.

An end stop halts the tip at once, and the grapple swings. So the demand is bounded by the distance
that is left after the run-on of all demands so far. Ahead of a stop the demand decays with
``TIME_S``; the filter shapes it as any other demand, and an operator can creep up to the stop.

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

# Time constant with which the demand decays ahead of a stop. Damping of a swing meanwhile moves the
# axis to and fro: with half of this time that motion met the stop.
TIME_S = 0.6
# Part of a demand that counts as nothing.
NOTHING_S = 1e-3
UNBOUNDED = -math.inf, math.inf


@dataclass(frozen=True, slots=True)
class EndStops:
    """Positions at which an axis has to stop.

    Attributes:
        lowest, highest: lowest and highest position of the axis, in the unit of its signal.
        full_speed: change of the position per second at full positive command, either sign, not 0.
        lag_s: seconds for which the axis goes on with the velocity that was sent last: lag of the
            valve, and age of the position.
    """

    lowest: float
    highest: float
    full_speed: float
    lag_s: float

    def room(
        self, position: float, velocity: float, run_on: tuple[float, float]
    ) -> tuple[float, float]:
        """Return how far the axis may still move each way, full speed times seconds.

        Run-on away from a stop gives no room ahead of it, because limits may cut it off.

        Args:
            position: position measured now.
            velocity: velocity sent last, [-1, 1].
            run_on: ``RunOn.travel`` of the filter.

        Returns:
            (to the negative side: negative or 0, to the positive side: positive or 0).
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

    It counts the filter alone, not what limits cut off or what damps the swing of such a cut.

    Args:
        shaper: a fresh filter, of which this object uses up the state.
        sway: sway model of the filter, also used up; None without one.
        tick_s: time between two demands, seconds.
        tail_s: longest run-on, seconds.
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
        self._left = after  # travel left of a full demand n ticks ago, full speed times seconds
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
        """Return the travel left of negative and of positive demands, full speed times seconds.

        They are not summed: where a reversal cuts off one of them, all of the other still comes.
        """
        left, negative, positive = self._left, self._negative, self._positive
        return (
            sum(map(mul, left, negative)) if any(negative) else 0.0,
            sum(map(mul, left, positive)) if any(positive) else 0.0,
        )


def bounds(room: tuple[float, float], displaced: float) -> tuple[float, float]:
    """Return the smallest and the largest demand, [-1, 1], ahead of the end stops.

    Args:
        room: result of ``EndStops.room``.
        displaced: how far a motion has moved the axis, full speed times seconds; the motion will
            move it back.
    """
    back, ahead = room
    low = (back + max(displaced, 0.0)) / TIME_S
    high = (ahead + min(displaced, 0.0)) / TIME_S
    return min(max(low, -1.0), 0.0), max(min(high, 1.0), 0.0)


# The factor falls at once, because missing oil flows through no valve. It rises so slowly that the
# operator sees no jump when another axis stops.
RISE_S = 0.5


class FlowBudget:
    """Finds the factor of all demands that the pump's flow allows, tick by tick.

    Args:
        shares: flow of each axis at full speed, in flows of one usual axis (full axis flows).
        tick_s: time between two calls of ``step``, seconds.

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
        """Return the factor of this tick.

        An axis whose demand has ended, or was reversed, still takes oil for its run-on.

        Args:
            flow: flow of the pump without what others take, full axis flows.
            demands: demands of the operator, by axis, [-1, 1].
            outputs: velocities sent in the last tick, by axis, [-1, 1] of full speed.
            ticks: ticks that have passed; more than 1 where deadlines were missed.
        """
        asked, free = 0.0, flow
        for share, demand, output in zip(self._shares, demands, outputs, strict=True):
            asked += share * abs(demand)
            if demand * output <= 0.0:
                free -= share * abs(output)
        wanted = max(free, 0.0) / asked if asked > max(free, 0.0) else 1.0
        self.scale = min(wanted, self.scale + self._rise * ticks)
        return self.scale
