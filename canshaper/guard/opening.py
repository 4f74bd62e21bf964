"""The velocity that a valve gives for a command: the guard's own inverse of dead band and curve."""

from bisect import bisect_right
from itertools import pairwise

from canshaper.config.limits import Limits


class Opening:
    """Velocity that a valve gives for a command, in one direction."""

    __slots__ = ("_steps", "_velocities", "slopes")

    def __init__(self, steps: list[float], velocities: list[float]) -> None:
        self._steps, self._velocities = steps, velocities
        self.slopes = [
            (v1 - v0) / (s1 - s0)
            for (s0, s1), (v0, v1) in zip(pairwise(steps), pairwise(velocities), strict=True)
        ]

    def velocity(self, steps: int) -> float:
        """Part of full speed; beyond full command more than 1."""
        at = self._steps
        if steps <= at[0]:
            return 0.0
        i = min(bisect_right(at, steps), len(self.slopes)) - 1
        return self._velocities[i] + (steps - at[i]) * self.slopes[i]


def openings(limits: Limits, full: int) -> tuple[Opening, Opening]:
    """Of the positive and of the negative direction, by dead band or measured curve."""
    commands, speeds = limits.curve_command_pct, limits.curve_speed_pct
    if commands is None or speeds is None:
        one = Opening([limits.deadband_pct / 100.0 * full, float(full)], [0.0, 1.0])
        return one, one
    points = [(c / 100.0 * full, v / 100.0) for c, v in zip(commands, speeds, strict=True)]
    edge = next(i for i, (_, speed) in enumerate(points) if speed == 0.0)
    forth, back = points[edge + 1 :], [(-c, -v) for c, v in points[edge::-1]]
    return (
        Opening([c for c, _ in forth], [v for _, v in forth]),
        Opening([c for c, _ in back], [v for _, v in back]),
    )
