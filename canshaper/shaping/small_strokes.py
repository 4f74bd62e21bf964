"""Small strokes: makes one movement of a tap of the joystick, as long as the tap demanded.

A filter that spreads a tap over a second or two asks for less in a tick than the least step of the
valve's frame. Rounded to steps that is a row of twitches, and limit-aware feedback adds its own for
the rounding. So while the joystick is back in neutral after a small stroke, the travel still due
decides: the axis moves by the least step where less is commanded, never further than is due, and
then rests. In a large stroke this would cut off the feedback that damps its swing: therefore all
commands since the axis was at rest have to be small together.
"""

import math

from canshaper.shaping.limits import OutputLimits

# Strokes are small if the least step makes all of them within this time, s. With steps of 1/125
# that is 0.4 to 0.9 s of full speed, by the deadband. Larger ones are not made of single steps.
SMALL_S = 90.0
# Ticks at the least step that may be left over: one more step would travel too far by as much.
LEFT = 0.5


class SmallStrokes:
    """Counts the travel still due to the operator, and finds the output that makes it.

    Args:
        limits: output limits of the axis.
        grid_steps: raw steps of the valve frame from zero to full command.
        tick_s: time between two ticks.
    """

    __slots__ = ("_due", "_left", "_maximum", "least", "most")

    def __init__(self, limits: OutputLimits, grid_steps: int, tick_s: float) -> None:
        self.least = least_velocity(limits, grid_steps)
        self._maximum = limits.maximum
        self.most = SMALL_S / tick_s * self.least
        self._due = 0.0  # full speed times ticks
        self._left = self.most  # until what was commanded is no longer small; the same

    def clear(self) -> None:
        """Forget the travel that is due: the axis rests."""
        self._due, self._left = 0.0, self.most

    def lose(self) -> None:
        """Treat no stroke as small until the axis rests: the filter did not see its commands."""
        self._left = -math.inf

    def hold(self, command: float, applied: float, ticks: int) -> None:
        """Count missed ticks with this command and this own velocity of the axis."""
        self._due += ticks * (command - applied)
        self._left -= ticks * abs(command)

    def output(
        self, command: float, applied: float, target: float, low: float, high: float
    ) -> float:
        """Return the velocity of the axis in this tick.

        Args:
            command: the operator's command now.
            applied: the axis' own velocity in the last tick.
            target: the filter's output within the range.
            low: least velocity that the operator allows, 0 or negative.
            high: largest velocity, 0 or positive.

        Returns:
            A velocity within the range, before the rates.
        """
        if command:
            maximum = self._maximum
            clipped = min(max(command, -maximum), maximum)
            self._due += clipped - applied
            self._left -= abs(clipped)
            return target
        if low == 0.0 == high:  # nothing was commanded within the tail
            self.clear()
            return target
        due = self._due = self._due - applied
        if self._left < 0.0 or low < 0.0 < high:  # after a reversal there is travel both ways
            return target
        if low < 0.0:
            return -self._forth(-target, -due, -low)
        return self._forth(target, due, high)

    def _forth(self, target: float, due: float, most: float) -> float:
        """Return the velocity of a small positive stroke with the travel ``due``; 0 at its end."""
        least = self.least
        return max(min(least, most), min(target, due)) if due > LEFT * least else 0.0


def least_velocity(limits: OutputLimits, grid_steps: int) -> float:
    """Return the least velocity that a frame of so many steps can give, not below the minimum.

    A first step that gives less than half of the others does not count: to the valve it is neutral.
    """
    least = max(limits.minimum, 0.5 / grid_steps)
    for raw in range(1, grid_steps):
        velocity = limits.velocity(raw / grid_steps)
        if velocity >= least:
            return velocity
    return 1.0
