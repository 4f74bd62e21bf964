"""One axis: its state machine, its filter and its output stage, tick by tick.

How it works
------------
The axis does no I/O and reads no clock. In each tick its caller gives it the checked input, and
reads from ``output`` what the valve frame shall carry:

1. ``command`` finds the output. The state machine takes the input (``state_machine.py``), the
   filter takes the operator's demand (``transfer.py``), and the output stage bounds what the filter
   asks for (``output.py``). The valve frame can leave now.
2. ``propagate`` lets the sway model swing with that output. It can wait until the frame has left.
"""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from canshaper.errors import raised
from canshaper.shaping.limits import OutputLimits, within
from canshaper.shaping.moving_axis import AddedTime
from canshaper.shaping.output import OutputStage
from canshaper.shaping.shapers.kind import Shaper, spreads
from canshaper.shaping.state_machine import ACTIVE, BYPASS_ON, STOPPING, TRIPPED, StateMachine
from canshaper.shaping.states import MOVING, CommandInput, Reason, State, Transition
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import BumplessTransfer

if TYPE_CHECKING:
    from canshaper.shaping.sensed import SensedSway

# Most missed ticks that filter and model catch up: after more of them nothing moves any more, and
# the first neutral frame must not wait.
MOST_HELD = 2000


class ShapedAxis:
    """State machine, filter and output stage of one axis.

    Args:
        tick_s: time between two calls of ``tick``, seconds.
        limits, shaper: output limits and filter of the axis.
        sway: sway model of the axis, or None.
        neutral_band: largest |joystick| that counts as neutral.
        stop_s: longest duration of STOPPING, seconds.
        grid_steps: steps of the valve frame from zero to full command.

    Attributes:
        demand: the operator's demand in the last tick, [-1, 1]: in ACTIVE within ``bounds`` and
            times ``scale``, in BYPASS_ON as it is, in other states 0.
        output: output of the axis with its parts: one object, which every tick overwrites.
        sway: the sway model.
        sensed: the sway sensor's observer and trust, or None without a sensor.
        scale: factor of the operator's demand in front of the filter, 0 to 1.
        bounds: smallest and largest demand before ``scale`` and filter; they also bound the
            velocity that is added to damp a swing.
        added_time: how long a motion may still move the axis.
        bends: whether the axis takes an added velocity only within the range of its own demands,
            so that it never moves without a demand.
        error: error of the filter in TRIPPED, see ``Transition``; empty without one.
    """

    def __init__(
        self,
        tick_s: float,
        limits: OutputLimits,
        *,
        sway: SwayModel | None,
        shaper: Shaper,
        neutral_band: float = 0.02,
        stop_s: float = 2.0,
        grid_steps: int = 125,
    ) -> None:
        self.demand = 0.0
        self.sway = sway
        self.sensed: SensedSway | None = None
        self.bends = False
        self.scale = 1.0
        self.bounds = -math.inf, math.inf
        self.error = ""
        self.tick_s = tick_s
        self.neutral_band = neutral_band
        self.states = StateMachine(neutral_band, max(1, round(stop_s / tick_s)))
        self.transfer = BumplessTransfer(shaper, tick_s)
        self.stage = OutputStage(limits, grid_steps, tick_s, spreads=spreads(shaper))
        self.output = self.stage.output
        self.added_time = AddedTime(0, self.stage.tail)

    @property
    def state(self) -> State:
        """State of the axis."""
        return self.states.state

    @property
    def reason(self) -> Reason:
        """Reason for which the axis is in its state."""
        return self.states.reason

    @property
    def neutral(self) -> bool:
        """Whether the valve gets neutral in this state, whatever the filter asks for."""
        return self.states.state not in MOVING

    def tick(self, joystick: CommandInput, added: float = 0.0) -> Transition | None:
        """Run a whole tick, ``command`` and ``propagate``; return as ``command`` does."""
        transition = self.command(joystick, added)
        self.propagate()
        return transition

    def command(
        self, joystick: CommandInput, added: float, *, damps: bool = False
    ) -> Transition | None:
        """Take the input of this tick, and find the output.

        Args:
            joystick: the checked input.
            added: velocity that the motion of two axes asks this axis to add, [-1, 1] of full
                speed. The axis adds it while it is ACTIVE and anti-sway is on, and where no one
                commands it, for a limited time. A value that is no velocity trips the axis.
            damps: whether the axis shall damp the swing that the other axis of the motion causes.
                It does so while a trusted sensor shows the swing and no one commands the axis.

        Returns:
            The change of state of this tick, or in TRIPPED the first error of the filter; or None.
        """
        states, stage = self.states, self.stage
        old, size = states.state, abs(joystick.command)
        sensor_damps = self.sensed is not None and self.sensed.weight > 0.0
        damps_now = may_add = False
        if stage.largest_added:
            asked, commanded, moved = False, self.output.commanded, self.output.steps != 0
            if not joystick.bypass:
                damps_now = damps and sensor_damps and not commanded
                asked = added != 0.0 or damps_now
            may_add = self.added_time.allows(asked, commanded, moved, size > self.neutral_band)

        at_rest = self.output.steps == 0 and not self.output.commanded
        state = states.step(joystick, at_rest, may_add)
        if state is not old:
            self._entered(state, old)
        try:
            held = demand = damping = 0.0
            if state is ACTIVE or state is BYPASS_ON:
                if not size < math.inf:  # the value would stay in the memory of the filter
                    raise ValueError(f"command is {joystick.command}")
                if size > self.neutral_band:
                    held, (low, high) = joystick.command, self.bounds
                    # In bypass the crane is as it is.
                    demand = self.scale * min(max(held, low), high) if state is ACTIVE else held
            elif state is STOPPING and size > self.neutral_band:
                stage.stop_against(joystick.command)
            self.demand = demand

            adds = may_add and state is ACTIVE
            path = added if adds or (self.bends and state is ACTIVE) else 0.0
            reference = self.transfer.unlimited(demand, stage.limits.maximum, stage.ramp, path)
            if adds and damps_now and not held:
                largest, (low, high) = stage.largest_added, self.bounds
                low, high = max(low, -largest), min(high, largest)
                damping = within(reference, low, high, 0.0, "filter output")

            if state in MOVING:
                stage.drive(held, demand, reference, path, damping, sensor_damps=sensor_damps)
            else:
                stage.rest()
                self.transfer.offset = 0.0
        except Exception as error:  # a filter of another package may raise anything
            return self.invalidate(old, error)
        return None if state is old else Transition(old, state, states.reason)

    def propagate(self) -> None:
        """Let the sway model, and the sensor's observer, swing with the output of ``command``."""
        output = self.output
        if self.sway is not None:
            self.sway.step(output.applied)
        if self.sensed is not None:
            self.sensed.step(output.applied, self.demand, output.path)

    def hold(self, ticks: int) -> Transition | None:
        """Count missed ticks, in which the valve kept the last output; return a trip, or None.

        Missed ticks lengthen neither the run-on nor a stop, and the filter takes the last demand in
        each of them, up to ``MOST_HELD``. Only the ramp does not catch up.
        """
        demand, output, time = self._clamped_demand(), self.output, self.added_time
        self.states.hold(ticks)
        self.stage.hold(demand, ticks)
        time.allows(time.asked, output.commanded, output.steps != 0, ticks=ticks)
        try:
            for _ in range(min(ticks, MOST_HELD)):
                self.transfer.hold(demand)
                self.propagate()
        except Exception as error:  # as in ``command``
            return self.invalidate(self.states.state, error)
        return None

    def retune(
        self, mode: SwayMode, shaper_for: Callable[[SwayModel], Shaper], past: Sequence[float] = ()
    ) -> None:
        """Change sway mode and filter, which ``shaper_for`` makes, in motion too, without a jump.

        The model keeps the physical swing. The difference between both filters at this moment fades
        with ``transfer.BLEND_S``. With ``past`` (``applied`` in each tick since the axis was at
        rest) the model swings through it by the new mode, and the filter damps the swing left.

        Raises:
            ValueError: mode or filter does not suit the tick; model and filter stay as they were.
        """
        before = self.sway
        applied = self.output.applied
        sway = before.retuned(mode, applied) if before else SwayModel(mode, self.tick_s)
        if past:
            sway.angle = sway.rate = 0.0
            for velocity in past:
                sway.step(velocity)
        shaper = shaper_for(sway)
        self.transfer.replace(shaper, self._clamped_demand(), again=bool(past))
        self.stage.change_filter(spreads=spreads(shaper))
        self.sway = sway
        if self.sensed is not None:
            self.sensed.retune(sway)

    def prepare(self, least: float, most: float) -> None:
        """Prepare the filter, which has not run, for factors of ``follow`` from least to most."""
        self.transfer.prepare(least, most)

    def follow(self, mode: SwayMode, factor: float) -> None:
        """Continue with another rope length; ``factor``: its period over that of the filter."""
        assert self.sway is not None  # checked with the deployment
        self.sway.follow(mode)
        self.transfer.follow(factor)

    def allow_added(self, largest: float, time_s: float) -> None:
        """Let a motion move this axis uncommanded, at most by ``largest`` and for ``time_s``."""
        self.stage.largest_added = largest
        self.added_time = AddedTime(round(time_s / self.tick_s), self.stage.tail)

    def drop_added(self) -> None:
        """End the added velocity at once: the motion has lost the right to move this axis."""
        self.stage.drop_added()

    def restore(self, state: State, reason: Reason) -> None:
        """Continue in a state with neutral output (``StateMachine.restore``)."""
        self.states.restore(state, reason)

    def limit(self, limits: OutputLimits) -> None:
        """Use other limits from now on; the tail stays as it was.

        Raises:
            ValueError: the axis moves, and could become faster without its operator.
        """
        if not self.neutral:
            raise ValueError("limits change in neutral only")
        self.stage.change_limits(limits)

    def _entered(self, state: State, old: State) -> None:
        self.transfer.entered(state, old)
        if state is not ACTIVE:
            self.stage.interrupt_stroke()
        elif old is BYPASS_ON:
            self.stage.hold_run_on()
        if old in MOVING and state not in MOVING and self.output.commanded:
            self.stage.hold_run_on()
        if old is TRIPPED:
            self.error = ""

    def _clamped_demand(self) -> float:
        """Return the last demand as the filter got it, clamped to the maximum."""
        return within(self.demand, -self.stage.limits.maximum, self.stage.limits.maximum, 0.0)

    def invalidate(self, old: State, error: Exception) -> Transition | None:
        """Trip for an error of the filter, or of the output; return the change from ``old``.

        The model starts again: its state may be spoilt too. In TRIPPED the first reason stays; the
        first error is returned, then None in each tick.
        """
        if self.states.state is not TRIPPED:
            self.states.trip(Reason.OUTPUT_INVALID)
        self.transfer.offset = 0.0
        if self.output.commanded:
            self.stage.hold_run_on()
        self.stage.rest()
        self.demand = 0.0
        if self.sway is not None:
            self.sway.angle = self.sway.rate = 0.0
        if self.sensed is not None:
            self.sensed.restart()
        if self.error:
            return None
        self.error = raised(error)
        return Transition(old, TRIPPED, self.states.reason, self.error)
