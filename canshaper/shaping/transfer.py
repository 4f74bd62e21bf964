"""Bumpless transfer between filter and bypass, and from one filter to another."""

import math

from canshaper.shaping.shapers.kind import Shaper, carry_over
from canshaper.shaping.state_machine import BYPASS_ON, STOPPING
from canshaper.shaping.states import MOVING, State

# Time constant with which the difference at a change of filter fades: quick against a swing of
# one to three seconds, slow against a valve of a tenth of a second.
BLEND_S = 0.3


class BumplessTransfer:
    """Reference of filter or bypass, with bumpless transfer from one to the other.

    Args:
        shaper: the filter.
        tick_s: time between two ticks.
    """

    __slots__ = ("_bypassed", "_fade", "_joins", "_offset", "_shaper")

    def __init__(self, shaper: Shaper, tick_s: float) -> None:
        self._shaper = shaper
        self._fade = math.exp(-tick_s / BLEND_S)
        self._offset = 0.0  # the transfer offset, which fades
        self._joins = False  # it is to be taken at the next command
        self._bypassed = False

    def entered(self, state: State, old: State) -> None:
        """Take a change of state; a stop goes on with what drove the axis before."""
        if state is not STOPPING:
            bypassed = state is BYPASS_ON
            # From rest there is nothing to join to: the joystick counts in full at once.
            self._joins = old in MOVING and bypassed is not self._bypassed
            self._bypassed = bypassed

    def unlimited(self, command: float, maximum: float, applied: float, added: float) -> float:
        """Return the reference before limits, without a step from the output before a change.

        Args:
            command: the operator's demand.
            maximum: largest |velocity| of the axis: a filter that is cut off damps nothing.
            applied: what was sent in the last tick.
            added: what another axis adds in this one.
        """
        if abs(command) > maximum:
            command = math.copysign(maximum, command)
        output = self._shaper.step(command)
        if self._bypassed:
            output = command
        if self._joins:
            self._joins = False
            self._offset = applied - output - added
        elif self._offset:
            self._offset *= self._fade
            if abs(self._offset) < 1e-6:  # far below any frame's resolution
                self._offset = 0.0
        return output + self._offset

    def hold(self, command: float) -> None:
        """Count a missed tick with this command."""
        self._shaper.step(command)

    def replace(self, shaper: Shaper, command: float) -> None:
        """Go on with another filter; ``command`` is the one that is in force."""
        carry_over(self._shaper, shaper, command)
        self._shaper = shaper
        self._joins = True

    def rest(self) -> None:
        """Forget the transfer offset: an axis at rest has nothing to join to."""
        self._offset = 0.0
