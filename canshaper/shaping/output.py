"""The output stage of one axis: from the reference of its filter to the steps of its valve frame.

How it works
------------
In every tick in which the axis moves, ``OutputStage.drive`` takes five steps:

1. Range. The operator bounds the output: it is never faster than he demands now or demanded within
   the tail, and never against his joystick, unless the limits allow that. The reference is clamped
   to this range. The run-on ends sooner where it has gone as far as the limits allow, or against
   the joystick for as long as they allow. For a tail after anti-sway was switched on in motion, or
   a motion was cut off by a trip or the end of a stop, there is no run-on: the output is never
   faster than he demands now, and rests in neutral. Memory and sway model of the filter still hold
   a motion that the axis made without the filter, or did not complete: the filter would make it
   once more, also after a rest.
2. Small strokes. A filter may spread a tap of the joystick over time, in pieces smaller than a step
   of the frame. The axis joins them into one short movement.
3. Added velocity. The motion of two axes may add to that, in a range of its own. It counts every
   demand within the tail, also one before a stop or a trip, after which nothing of it runs on.
4. Ramp. The output changes by at most the rise or the fall of the axis.
5. Grid. The output is rounded to steps of the frame, never out of the range.

Two ramps run side by side. ``ramp`` is the output, with all that is added. ``_own_ramp`` is what
the output would be if nothing had been added: it is where the output goes at once when the motion
loses the right to add. Once nothing is added and both have met, one computation does for both.
"""

import math
from dataclasses import dataclass

from canshaper.shaping.limits import (
    OutputLimits,
    RecentDemand,
    allowed_range,
    on_grid,
    rate_limited,
    within,
)
from canshaper.shaping.small_strokes import SmallStrokes
from canshaper.shaping.two_axis_motion import range_with_added

# Largest quantisation error of an added velocity that is carried, full speed times ticks.
MOST_CARRY = 0.1
# A velocity that is none: more than the rounding of floats.
NOTHING = 1e-6


@dataclass(slots=True)
class Output:
    """Output of an axis in one tick, with the parts that are added for the sake of another axis.

    Velocities are fractions of full speed, [-1, 1].

    Attributes:
        steps: command in the valve frame, in steps of its grid, deadband included.
        setpoint: the velocity that these steps give.
        path: velocity that the motion of two axes adds to keep the grapple on its path. It causes
            no swing, so it does not drive the sway model.
        damping: velocity that is added to damp the swing which the other axis has caused. It is
            meant to move the grapple, so it drives the sway model.
        applied: the part of the setpoint that drives the sway model: all but ``path``.
        commanded: whether the operator demanded motion within the tail, so that it may run on.
    """

    steps: int = 0
    setpoint: float = 0.0
    path: float = 0.0
    damping: float = 0.0
    applied: float = 0.0
    commanded: bool = False


class OutputStage:
    """Output stage of one axis: its limits, and their state from one tick to the next.

    Args:
        limits: limits of the axis.
        grid_steps: steps of the valve frame from zero to full command.
        tick_s: time between two ticks, seconds.
        spreads: whether the filter spreads the demand over time, see ``Shaper``.

    Attributes:
        output: the output of the last tick: one object, which every tick overwrites.
        ramp: the velocity of the last tick before it was rounded. If the ramp went on from the
            rounded one, it would stick on a coarse grid.
        largest_added: largest |velocity| that the motion of two axes may give to this axis while no
            one commands it; 0 where it may add nothing.
        tail: ticks for which the output may run on.
    """

    # fmt: off
    __slots__ = (
        "_carry", "_crossed", "_demanded", "_dropped_at", "_no_run_on", "_own_ramp", "_ran",
        "_recent", "_side", "_tick_s", "grid_steps", "largest_added", "limits", "output", "ramp",
        "rates", "reversal", "small", "spreads", "tail",
    )
    # fmt: on

    def __init__(
        self, limits: OutputLimits, grid_steps: int, tick_s: float, *, spreads: bool
    ) -> None:
        self.output = Output()
        self.ramp = self.largest_added = 0.0
        self.grid_steps, self._tick_s, self.spreads = grid_steps, tick_s, spreads
        self.tail = round(limits.tail_s / tick_s)  # ticks
        self._recent = RecentDemand(self.tail)
        self._demanded = RecentDemand(self.tail)  # the same, but no rest ends it
        self._no_run_on = 0  # ticks that are left without run-on
        self._ran = 0.0  # how far it has run beyond what was asked, full speed times seconds
        self._side = 1.0  # to which the joystick was deflected last, 1 or -1
        self._crossed = 0  # ticks since the joystick was deflected to this side
        self.change_limits(limits)
        self._own_ramp = 0.0  # what ``ramp`` would be if nothing had been added
        self._carry = 0.0  # what rounding has left out of an added velocity, summed up
        self._dropped_at = 0.0  # ``ramp`` when the right to add was lost, until the next tick

    def drive(
        self,
        held: float,
        demand: float,
        reference: float,
        path: float,
        damping: float,
        *,
        sensor_damps: bool,
    ) -> None:
        """Find the output of one tick of a moving axis, and put it into ``output``.

        Args:
            held: velocity at which the operator holds the joystick.
            demand: demand that the filter got.
            reference: velocity that the filter asks for; any value.
            path, damping: velocities that are added, see ``Output``.
            sensor_damps: whether the filter damps a swing that a trusted sensor shows, which takes
                more than the one movement of a small stroke.

        Raises:
            ValueError: the reference is not finite, or the added velocity is no velocity.
        """
        limits, recent, output = self.limits, self._recent, self.output
        added = path + damping
        if not self.largest_added:  # it bends: in the range of its own demands
            reference, added = reference + added, 0.0

        # 1. Range
        no_run_on = self._no_run_on > 0
        if no_run_on:
            self._no_run_on -= 1
            recent.clear()
        no_run_on = self._end_run_on(held) or no_run_on
        recent.add(demand)
        output.commanded = recent.low != 0.0 or recent.high != 0.0
        low, high = allowed_range(recent.low, recent.high, limits)
        own = within(reference, low, high, limits.minimum, "filter output")

        # 2. Small strokes
        if self.spreads:
            movement = self.small.output(demand, output.applied, own, low, high)
            if not sensor_damps:
                own = movement

        # 3. Added velocity, and 4. ramp
        total = own
        if self.largest_added:
            self._demanded.add(demand)
        if not added and self._own_ramp == self.ramp and not self._dropped_at:
            self.ramp = self._own_ramp = rate_limited(own, self.ramp, *self.rates)
        elif abs(path) <= 1.0:
            total, low, high = self._ramp_with_added(held, own, added, no_run_on=no_run_on)
        else:
            raise ValueError(f"added velocity is {path}")

        # 5. Grid
        ramp = self.ramp
        if ramp < low:  # the range has become smaller, and the ramp is on its way back into it
            low = ramp
        elif ramp > high:
            high = ramp
        output.path, output.damping = path, damping
        output.steps, output.setpoint = on_grid(
            ramp, low, high, limits.deadband, self.grid_steps, curve=limits.curve
        )
        output.applied = output.setpoint - path
        if added:
            carry = self._carry + total - output.setpoint
            self._carry = within(carry, -MOST_CARRY, MOST_CARRY, 0.0)
        beyond = self._beyond(held)
        self._ran = self._ran + beyond * self._tick_s if beyond or not held else 0.0

    def _ramp_with_added(
        self, held: float, own: float, added: float, *, no_run_on: bool
    ) -> tuple[float, float, float]:
        """Advance both ramps; return (sum of own and added velocity, low end, high end of range).

        An added velocity is slow: a few steps of the grid, or less than one. What rounding leaves
        out of it is carried, and corrected in the next ticks by at most one step in each. The carry
        starts no movement: the operator would see a twitch.
        """
        limits, asked = self.limits, self._demanded
        largest = self.largest_added if added else 0.0
        low, high = range_with_added(
            held, asked.low, asked.high, own, largest, maximum=limits.maximum, no_run_on=no_run_on
        )
        target = total = own
        if added:
            total = within(own + added, low, high, 0.0)
            step = 1.0 / self.grid_steps
            target = within(total, low, high, max(limits.minimum, 0.5 * step))
            if target:
                target = within(target + within(self._carry, -step, step, 0.0), low, high, 0.0)
        self._own_ramp = rate_limited(own, self._own_ramp, *self.rates)
        self.ramp = rate_limited(target, self.ramp, *self.rates)
        if self._dropped_at * self.ramp < 0.0:  # the way to the other side begins at rest
            self.ramp = 0.0
        self._dropped_at = 0.0
        return total, low, high

    def _end_run_on(self, held: float) -> bool:
        """End the run-on beyond the joystick, by the fall, where it reaches a limit.

        Limits are a time after a reversal, and always a way, which includes the way of the fall. A
        joystick that demands as much velocity lets the way begin again. Returns whether the way is
        at its end.
        """
        recent = self._recent
        if held * self._side < 0.0:
            self._side, self._crossed = -self._side, 0
        if self._crossed >= self.reversal and (recent.low if self._side > 0.0 else recent.high):
            recent.clear_against(self._side)
        self._crossed += 1
        beyond, limits = self._beyond(held), self.limits
        if over := self._ran + 0.5 * beyond * beyond / limits.fall_per_s > limits.run_on:
            recent.clear()
        return over

    def _beyond(self, held: float) -> float:
        """Return how far own ramp, or setpoint less ``largest_added``, exceeds ``held``; or 0."""
        own, sent = self._own_ramp, self.output.setpoint
        own_asked, asked = held if own > 0.0 else -held, held if sent > 0.0 else -held
        own_beyond = abs(own) - max(own_asked, 0.0)
        beyond = max(own_beyond, abs(sent) - max(asked, 0.0) - self.largest_added)
        return beyond if beyond > NOTHING else 0.0

    def drop_added(self) -> None:
        """Go back to the axis' own ramp at once, but never faster and not to the other side."""
        self._dropped_at = ramp = self.ramp
        self.ramp = within(self._own_ramp, min(0.0, ramp), max(0.0, ramp), 0.0)
        self._carry = 0.0

    def stop_against(self, held: float) -> None:
        """In a stop, end a run-on against the joystick ``held``: now, or after ``reversal``."""
        if held * self._side < 0.0:
            self._side, self._crossed = -self._side, 0
        if not self.reversal and held * self.ramp < 0.0:
            self._recent.clear()
            self.output.commanded = False

    def hold_run_on(self) -> None:
        """Allow no run-on for a tail: the filter remembers motion that it did not drive or end."""
        self._no_run_on = self.tail

    def rest(self) -> None:
        """Set the output to neutral at once, and forget all demands that may run on."""
        output = self.output
        if output.commanded:
            self._recent.clear()
            output.commanded = False
        if self.largest_added:
            self._demanded.add(0.0)
        self.small.clear()
        output.steps = 0
        output.setpoint = output.path = output.damping = output.applied = 0.0
        self.ramp = self._own_ramp = self._carry = self._dropped_at = 0.0
        self._no_run_on -= 1

    def hold(self, demand: float, ticks: int) -> None:
        """Count missed ticks, in which this demand stayed and the valve kept its output."""
        self._recent.age(ticks)
        self._demanded.age(ticks)
        self._no_run_on -= ticks
        self._crossed += ticks
        self._ran += self._beyond(0.0) * ticks * self._tick_s
        self.small.hold(demand, self.output.applied, ticks)

    def change_limits(self, limits: OutputLimits) -> None:
        """Use other limits, with the old tail, from now on, at rest. Demands in it still count."""
        self.limits = limits
        self.rates = limits.rise_per_s * self._tick_s, limits.fall_per_s * self._tick_s
        fall_s = limits.maximum / limits.fall_per_s
        reversal = int(max(limits.reversal_s - fall_s, 0.0) / self._tick_s + 1e-6)
        self.reversal = math.inf if limits.allow_reverse else reversal  # ticks
        self.small = SmallStrokes(limits, self.grid_steps, self._tick_s)

    def change_filter(self, *, spreads: bool) -> None:
        """Continue with another filter; a stroke under way, of the old one, counts as not small."""
        self.spreads = spreads
        self.small.lose()

    def interrupt_stroke(self) -> None:
        """Treat no stroke as small until the axis rests: the filter no longer shapes it."""
        self.small.lose()
