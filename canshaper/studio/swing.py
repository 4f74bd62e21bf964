"""How far a grapple swings: the largest sway of the last full swing. No clock."""

import math
from collections import deque
from collections.abc import Iterable

from canshaper.config.limits import Sway

LEAST_SWING_S = 1.0
"""Shortest time over which the largest sway counts as the swing."""


class Swing:
    """Sway in any direction over one full swing.

    Args:
        models: sway models of the deployment, the longest period counts.
    """

    def __init__(self, models: Iterable[Sway]) -> None:
        periods = [2.0 * math.pi / model.mode().omega_rad_s for model in models]
        self._lasts_s = max([LEAST_SWING_S, *periods])
        self._sways: deque[tuple[float, float]] = deque()

    def add(self, sway_deg: tuple[float, float], now_s: float) -> None:
        """Take a sway, across and along the boom."""
        self._sways.append((now_s, math.hypot(*sway_deg)))

    def invalidate(self) -> None:
        """Begin again."""
        self._sways.clear()

    def largest_deg(self, now_s: float) -> float | None:
        """The largest one of the last full swing; None before there is any."""
        while self._sways and self._sways[0][0] < now_s - self._lasts_s:
            self._sways.popleft()
        return max((sway for _, sway in self._sways), default=None)
