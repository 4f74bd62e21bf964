"""Reference of an axis with its filter or in bypass, and bumpless transfer between both."""

import math

from canshaper.shaping.shapers.kind import Following, Shaper, ShaperKind, carry_over
from canshaper.shaping.state_machine import BYPASS_ON, STOPPING
from canshaper.shaping.states import MOVING, State

# Time constant with which the difference at a change of filter fades: quick against a swing of
# one to three seconds, slow against a valve of a tenth of a second.
BLEND_S = 0.3


class Off:
    """No shaping: the output limits alone stand between joystick and valve."""

    __slots__ = ()

    def step(self, command: float) -> float:
        """Return the command itself."""
        return command


OFF = ShaperKind(
    "off",
    "No shaping: output limits only.",
    lambda _tick_s: Off(),
    lambda _mode, _tick_s: {"off": {}},
    runs_ahead=False,
)


class BumplessTransfer:
    """Reference of filter or bypass, with bumpless transfer from one to the other.

    Args:
        shaper: the filter.
        tick_s: time between two ticks.

    Attributes:
        offset: the transfer offset, which fades; an axis at rest sets it to 0, as there is no
            motion to join.
    """

    __slots__ = ("_bypassed", "_joins", "fade", "offset", "shaper")

    def __init__(self, shaper: Shaper, tick_s: float) -> None:
        self.shaper = shaper
        self.fade = math.exp(-tick_s / BLEND_S)
        self.offset = 0.0
        self._joins = False  # whether the next demand sets the offset
        self._bypassed = False

    def entered(self, state: State, old: State) -> None:
        """Take a change of state; a stop goes on with what drove the axis before."""
        if state is not STOPPING:
            bypassed = state is BYPASS_ON
            # From rest there is nothing to join to: the joystick counts in full at once.
            self._joins = old in MOVING and bypassed is not self._bypassed
            self._bypassed = bypassed

    def unlimited(self, demand: float, maximum: float, ramp: float, added: float) -> float:
        """Return the reference before limits, without a step from the output before a change.

        Args:
            demand: the operator's demand.
            maximum: largest |velocity| of the axis, which clamps the demand: a filter whose output
                is cut off would damp nothing.
            ramp: ``OutputStage.ramp``: velocity of the last tick, before it was rounded.
            added: velocity that another axis adds in this tick.
        """
        if abs(demand) > maximum:
            demand = math.copysign(maximum, demand)
        output = self.shaper.step(demand)
        if self._bypassed:
            output = demand
        if self._joins:
            self._joins = False
            self.offset = ramp - output - added
        elif self.offset:
            self.offset *= self.fade
            if abs(self.offset) < 1e-6:  # far below any frame's resolution
                self.offset = 0.0
        return output + self.offset

    def hold(self, demand: float) -> None:
        """Count a missed tick with this demand."""
        self.shaper.step(demand)

    def prepare(self, least: float, most: float) -> None:
        """Prepare the filter, which has not run, for factors of ``follow`` from least to most."""
        assert isinstance(self.shaper, Following)  # checked with the deployment
        self.shaper.prepare(least, most)

    def follow(self, factor: float) -> None:
        """Let the filter follow the sway model to ``factor`` times the period of the file."""
        assert isinstance(self.shaper, Following)
        self.shaper.follow(factor)

    def replace(self, shaper: Shaper, demand: float, *, again: bool) -> None:
        """Continue with another filter.

        Args:
            shaper: the new filter.
            demand: the present demand.
            again: whether the sway model has been run again from rest by the new mode.
        """
        carry_over(self.shaper, shaper, demand)
        if again and hasattr(shaper, "swing_again"):
            shaper.swing_again()
        self.shaper = shaper
        self._joins = True
