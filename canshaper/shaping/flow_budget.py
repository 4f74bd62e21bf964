"""Flow budget: together the axes ask for no more oil than the pump delivers.

A filter cancels the swing of the speeds that it asks for. Where the pump delivers less, the valves
give other speeds, and swing is left. So the demands are scaled in front of the filters, all by one
factor: the tip goes where the operator points, only slower.
"""

from collections.abc import Sequence

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
