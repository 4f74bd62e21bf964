"""Valve curve: dead band, gain and asymmetry of both directions, as a table."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import pairwise


class ValveCurve:
    """Speed over command of one valve, in straight lines between measured points.

    Args:
        commands: rising from -1 to 1.
        speeds: speed at each command as a part of full, rising; zero at two neighbouring points,
            the ends of the dead band, of which the first is at a command up to 0 and the second
            from 0 on.

    Raises:
        ValueError: the points are no such curve.
    """

    __slots__ = ("_commands", "speeds")

    def __init__(self, commands: Sequence[float], speeds: Sequence[float]) -> None:
        if fault := next(_faults(commands, speeds), None):
            raise ValueError(fault)
        self._commands = tuple(commands)
        self.speeds = tuple(speeds)

    def command(self, velocity: float) -> float:
        """Command for a velocity; beyond what the valve gives, full command."""
        if velocity == 0.0:
            return 0.0
        speeds, commands = self.speeds, self._commands
        if velocity >= speeds[-1]:
            return commands[-1]
        if velocity <= speeds[0]:
            return commands[0]
        # Of the two points with speed zero the right one is found for each direction.
        return _between(velocity, speeds, commands, bisect_right(speeds, velocity))

    def velocity(self, command: float) -> float:
        """Velocity that a command gives; zero within the dead band."""
        speeds, commands = self.speeds, self._commands
        if command >= commands[-1]:
            return speeds[-1]
        if command <= commands[0]:
            return speeds[0]
        return _between(command, commands, speeds, bisect_right(commands, command))


def _faults(commands: Sequence[float], speeds: Sequence[float]) -> Iterator[str]:
    """Yield the faults of the points of a curve; each check relies on those before it."""
    if len(commands) != len(speeds):
        yield f"expected a speed for each command, got {len(commands)} and {len(speeds)}"
    if len(commands) < 4 or commands[0] != -1.0 or commands[-1] != 1.0:
        yield "expected commands from -100 to 100 %, with the ends of the dead band between"
    if any(b <= a for a, b in pairwise(commands)):
        yield "commands do not rise"
    zeros = [i for i, speed in enumerate(speeds) if speed == 0.0]
    if len(zeros) != 2 or zeros[1] != zeros[0] + 1 or not 0 < zeros[0] < len(speeds) - 2:
        yield "expected two neighbouring commands with speed 0, the ends of the dead band"
    if not commands[zeros[0]] <= 0.0 <= commands[zeros[1]]:
        yield "the dead band does not lie around command 0"
    if any(b <= a for a, b in pairwise([*speeds[: zeros[1]], *speeds[zeros[1] + 1 :]])):
        yield "speeds do not rise with the command"
    if not 0.999 <= max(-speeds[0], speeds[-1]) <= 1.0:
        yield "the faster direction has speed 100 % at full command, and none has more"


def _between(value: float, xs: Sequence[float], ys: Sequence[float], high: int) -> float:
    """On the line through the points ``high - 1`` and ``high``."""
    x0, x1, y0, y1 = xs[high - 1], xs[high], ys[high - 1], ys[high]
    return y0 + (value - x0) * (y1 - y0) / (x1 - x0)
