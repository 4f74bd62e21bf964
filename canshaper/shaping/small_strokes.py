"""One movement from a tap of the joystick, as long as the tap asked for.

A filter that spreads a tap over a second or two wants less in a tick than the least step of the
valve's frame. Rounded to steps that is a row of twitches, and limit-aware feedback adds its own for
what rounding leaves out. So while the joystick is back in neutral after a small stroke, the travel
still due decides: the axis moves by the least step where less is wanted, never further than is due,
and then rests.
"""

import math

from canshaper.shaping.limits import OutputLimits, without_deadband

# A stroke is small when the least step would take no longer than this for what is due, seconds. In
# steps of 1/125 that is 0.4 s of full speed; of larger strokes single steps are no movement.
SMALL_S = 60.0
# Ticks at the least step that may be left: to travel them would be as much too far.
LEFT = 0.5


class SmallStrokes:
    """The travel that is still due to the operator, and what becomes of a small output.

    Args:
        limits: output limits of the axis.
        grid_steps: raw steps of the valve frame from zero to full command.
        tick_s: time between two ticks.
    """

    __slots__ = ("_due", "_least", "_maximum", "_most", "_small")

    def __init__(self, limits: OutputLimits, grid_steps: int, tick_s: float) -> None:
        self._least = least_velocity(limits, grid_steps)
        self._maximum = limits.maximum
        self._most = SMALL_S / tick_s * self._least
        self._due = 0.0  # full speed times ticks; without end where it is not known
        self._small = False

    def clear(self) -> None:
        """The axis rests: nothing is due."""
        self._due = 0.0

    def lose(self) -> None:
        """The filter goes on with what was commanded past it: until the axis rests, none counts."""
        self._due, self._small = math.inf, False

    def hold(self, command: float, applied: float, ticks: int) -> None:
        """Ticks were missed, with this command, and this velocity of the axis' own."""
        self._due += ticks * (command - applied)

    def output(
        self, command: float, applied: float, target: float, low: float, high: float
    ) -> float:
        """Find what the axis is to be sent.

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
            asked = min(max(command, -maximum), maximum)
            due = self._due = self._due + asked - applied
            self._small = -self._most <= due <= self._most
            return target
        if low == 0.0 == high:  # nothing was commanded within the tail
            self._due = 0.0
            return target
        due = self._due = self._due - applied
        if not self._small or low < 0.0 < high:  # after a reversal there is travel both ways
            return target
        if low < 0.0:
            return -self._forth(-target, -due, -low)
        return self._forth(target, due, high)

    def _forth(self, target: float, due: float, most: float) -> float:
        """The same for a stroke in positive direction."""
        least = self._least
        return max(min(least, most), min(target, due)) if due > LEFT * least else 0.0


def least_velocity(limits: OutputLimits, grid_steps: int) -> float:
    """Smallest velocity that a frame of so many steps can give, not below the minimum.

    A first step that gives less than half of the others does not count: to the valve it is neutral.
    """
    curve, deadband = limits.curve, limits.deadband
    least = max(limits.minimum, 0.5 / grid_steps)
    for raw in range(1, grid_steps + 1):
        command = raw / grid_steps
        velocity = curve.velocity(command) if curve else without_deadband(command, deadband)
        if velocity >= least:
            return velocity
    return 1.0
