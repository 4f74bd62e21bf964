"""One axis: filter and output limits, as its state machine allows.

Sans-I/O: every tick takes the checked input of that moment and returns what the valve frame shall
carry.
"""

import math
from collections.abc import Callable

from canshaper.shaping.added import AddedTime, range_with_added
from canshaper.shaping.limits import (
    OutputLimits,
    RecentCommand,
    allowed_range,
    on_grid,
    rate_limited,
    within,
)
from canshaper.shaping.sensed import SensedSway
from canshaper.shaping.shapers.kind import Shaper, spreads
from canshaper.shaping.small_strokes import SmallStrokes
from canshaper.shaping.state_machine import ACTIVE, BYPASS_ON, TRIPPED, StateMachine
from canshaper.shaping.states import MOVING, CommandInput, Reason, State, Transition
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import BumplessTransfer

# Missed ticks that are gone through one by one: after more of them nothing moves any more, and the
# first neutral frame waits.
MOST_HELD = 2000
# Largest quantisation error of an added velocity that is carried, full speed times ticks.
MOST_CARRY = 0.1


class Axis:
    """State machine, filter and limits of one axis.

    Args:
        tick_s: time between two calls of ``tick``.
        limits: output limits.
        sway: sway model, or None where the axis has none.
        shaper: the filter.
        neutral_band: |joystick| up to which it counts as neutral.
        stop_s: longest duration of STOPPING.
        grid_steps: raw steps of the valve frame from zero to full command.

    Attributes:
        raw: what the valve frame carries now, in grid steps (deadband included).
        sent: the velocity that gives, [-1, 1].
        applied: what the sway model was driven by: ``sent`` without the added part.
        command: the operator's command that was in force at the last tick, [-1, 1].
        sensed: what a sway sensor makes of the swing, where there is one.
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
        self.raw = 0
        self.sent = 0.0
        self.applied = 0.0
        self.command = 0.0
        self.sway = sway
        self.sensed: SensedSway | None = None
        self._largest_added = 0.0
        self._added_time = AddedTime(0)
        self._transfer = BumplessTransfer(shaper, tick_s)
        self._small = SmallStrokes(limits, grid_steps, tick_s)
        self._spreads = spreads(shaper)
        self._tick_s = tick_s
        self._limits = limits
        self._neutral_band = neutral_band
        self._grid_steps = grid_steps
        self._rise = limits.rise_per_s * tick_s
        self._fall = limits.fall_per_s * tick_s
        self._states = StateMachine(neutral_band, max(1, round(stop_s / tick_s)))
        self._recent = RecentCommand(round(limits.tail_s / tick_s))
        self._limited = 0.0  # what was sent, before rounding: the rate limit must not stick
        self._own = 0.0  # the same without what is added
        self._added = 0.0
        self._path = 0.0  # of what is added, the part that makes no swing
        self._carry = 0.0  # quantisation error of an added velocity
        self._dropped = 0.0  # the output as it was when the right to add was lost

    @property
    def state(self) -> State:
        """State of the axis."""
        return self._states.state

    @property
    def reason(self) -> Reason:
        """Why it is in that state."""
        return self._states.reason

    @property
    def commanded(self) -> bool:
        """Whether the operator asked for motion within the tail."""
        return self._recent.low != 0.0 or self._recent.high != 0.0

    @property
    def neutral(self) -> bool:
        """Whether the axis is at rest in a state that cannot move without the operator."""
        return self._states.state not in MOVING

    def tick(self, joystick: CommandInput, added: float = 0.0) -> Transition | None:
        """A whole tick: ``act`` and ``advance``."""
        transition = self.act(joystick, added)
        self.advance()
        return transition

    def act(
        self, joystick: CommandInput, added: float, *, damps: bool = False
    ) -> Transition | None:
        """Take the input of this tick; afterwards ``raw`` and ``sent`` are what to send.

        Args:
            joystick: the checked input.
            added: velocity that the motion of two axes adds to this one, [-1, 1] of full speed.
                It is carried out while this axis is enabled, its joystick valid, anti-sway on, as
                ``range_with_added`` says. The sway model is not driven by it: it is there to cause
                no swing, so the model swings with what is left for the axis itself. One that is no
                velocity trips the axis.
            damps: the motion of two axes makes this one swing: what its filter makes of a swing
                that a trusted sensor shows is carried out too, within the same bounds.

        Returns:
            The change of state of this tick, or None.
        """
        states = self._states
        if damps:
            damps = self.sensed is not None and self.sensed.weight > 0.0 and not self.commanded
        if not self._largest_added or joystick.bypass or not self._may_add(added or damps):
            added, damps = 0.0, False
        old = states.state
        state = states.step(joystick, added or damps, self.raw == 0 and not self.commanded)
        if state is not old:
            self._transfer.entered(state, old)
            if state is not ACTIVE:
                self._small.lose()
        if state is not ACTIVE:
            added, damps = 0.0, False
        command = 0.0
        try:
            if state is ACTIVE or state is BYPASS_ON:
                command = joystick.command
                size = abs(command)
                if size <= self._neutral_band:
                    command = 0.0
                elif not size < math.inf:  # it would stay in the memory of a filter
                    raise ValueError(f"command is {command}")
            self.command = command
            unlimited = self._transfer.unlimited(
                command, self._limits.maximum, self._limited, added
            )
            self._path = added
            if damps and not command:
                added += within(unlimited, -self._largest_added, self._largest_added, 0.0)
            if state in MOVING:
                self._drive(command, unlimited, added)
            else:
                self._rest()
        except Exception:  # a filter of another package may raise anything
            state = self.invalidate()
        self.applied = self.sent - self._path
        return None if state is old else Transition(old, state, states.reason)

    def advance(self) -> None:
        """Let the model swing with what ``act`` found: work that can wait until that is sent."""
        if self.sway is not None:
            self.sway.step(self.applied)
        if self.sensed is not None:
            self.sensed.step(self.applied, self.command, self._path)

    def hold(self, ticks: int) -> None:
        """Count that the last output was held for ``ticks`` missed ticks.

        They count as time: late ticks lengthen neither the run-on nor a stop, and the filter saw
        the last command in each of them. Only the rates do not catch up.
        """
        self._recent.age(ticks)
        self._states.hold(ticks)
        self._may_add(self._added, ticks)
        maximum = self._limits.maximum
        command = within(self.command, -maximum, maximum, 0.0)
        self._small.hold(command, self.applied, ticks)
        try:
            for _ in range(min(ticks, MOST_HELD)):
                self._transfer.hold(command)
                self.advance()
        except Exception:  # the same
            self.invalidate()

    def retune(self, mode: SwayMode, shaper_for: Callable[[SwayModel], Shaper]) -> None:
        """Change sway data and filter, also in motion, without a jump of the output.

        The model keeps the physical swing; the difference that the new filter makes at this
        moment fades with ``transfer.BLEND_S``.

        Raises:
            ValueError: mode or filter does not suit the tick; model and filter stay as they were.
        """
        if self.sway is None:
            sway = SwayModel(mode, self._tick_s)
        else:
            sway = self.sway.retuned(mode, self.applied)
        shaper = shaper_for(sway)
        maximum = self._limits.maximum
        self._transfer.replace(shaper, within(self.command, -maximum, maximum, 0.0))
        self._spreads = spreads(shaper)
        self._small.lose()
        self.sway = sway
        if self.sensed is not None:
            self.sensed.retune(sway)

    def allow_added(self, largest: float, time_s: float) -> None:
        """Let a motion add velocity where no one commands this axis.

        Args:
            largest: largest |velocity|, 0 to 1.
            time_s: longest time in motion.
        """
        self._largest_added = largest
        self._added_time = AddedTime(round(time_s / self._tick_s))

    def restore(self, state: State, reason: Reason) -> None:
        """Continue in a state in which the output is neutral, see ``StateMachine``."""
        self._states.restore(state, reason)

    def drop_added(self) -> None:
        """Who adds has lost the right to: nothing of it makes the next output faster."""
        self._dropped = limited = self._limited
        self._limited = within(self._own, min(0.0, limited), max(0.0, limited), 0.0)
        self._carry = 0.0

    def limit(self, limits: OutputLimits) -> None:
        """Change maximum and rates; of what the run-on remembers nothing changes.

        Raises:
            ValueError: the axis is in motion, where more speed would come without the operator.
        """
        if not self.neutral:
            raise ValueError("limits change in neutral only")
        self._limits = limits
        self._small = SmallStrokes(limits, self._grid_steps, self._tick_s)
        self._rise = limits.rise_per_s * self._tick_s
        self._fall = limits.fall_per_s * self._tick_s

    def _may_add(self, added: float, ticks: int = 1) -> bool:
        return self._added_time.allowed(
            added, commanded=self.commanded, moved=self.raw != 0, ticks=ticks
        )

    def _drive(self, command: float, unlimited: float, added: float) -> None:
        limits, recent = self._limits, self._recent
        recent.add(command)
        low, high = allowed_range(command, recent.low, recent.high, limits)
        target = within(unlimited, low, high, limits.minimum)
        if self._spreads:
            one_movement = self._small.output(command, self.applied, target, low, high)
            if self.sensed is None or not self.sensed.weight:  # else there is swing to damp
                target = one_movement
        self._added = added
        if added or self._own != self._limited or self._dropped:
            low, high, unrounded = self._drive_both(command, target)
        else:
            unrounded = 0.0
            self._limited = self._own = rate_limited(target, self._limited, self._rise, self._fall)
        limited = self._limited
        if limited < low:  # on its way back in
            low = limited
        elif limited > high:
            high = limited
        self.raw, self.sent = on_grid(
            limited, low, high, limits.deadband, self._grid_steps, curve=limits.curve
        )
        if added:
            self._carry = within(self._carry + unrounded - self.sent, -MOST_CARRY, MOST_CARRY, 0.0)

    def _drive_both(self, command: float, target: float) -> tuple[float, float, float]:
        """Limit the axis' own part and the added one together.

        The added part is a path to be run, slow and with few steps of the grid: the quantisation
        error is carried and made up for while the axis moves anyway, never by a twitch: by one step
        of the grid in a tick.

        Returns:
            The range that both have (low, high), and what they are together before the rates.
        """
        if not abs(self._path) <= 1.0:
            raise ValueError(f"added velocity is {self._path}")
        limits, recent, maximum = self._limits, self._recent, self._limits.maximum
        self._own = rate_limited(target, self._own, self._rise, self._fall)
        largest = self._largest_added if self._added else 0.0
        low, high = range_with_added(command, recent.low, recent.high, target, largest)
        low, high = max(low, -maximum), min(high, maximum)
        reference = unrounded = target
        if self._added:
            step = 1.0 / self._grid_steps
            unrounded = within(target + self._added, low, high, 0.0)
            reference = within(unrounded, low, high, max(limits.minimum, 0.5 * step))
            if reference:
                reference = within(
                    reference + within(self._carry, -step, step, 0.0), low, high, 0.0
                )
        self._limited = rate_limited(reference, self._limited, self._rise, self._fall)
        if self._dropped * self._limited < 0.0:  # the way to the other side begins at rest
            self._limited = 0.0
        self._dropped = 0.0
        return low, high, unrounded

    def _rest(self) -> None:
        self._recent.clear()
        self._small.clear()
        self._transfer.rest()
        self._limited = self._own = self.sent = 0.0
        self._added = self._path = self._carry = self._dropped = 0.0
        self.raw = 0

    def invalidate(self) -> State:
        """Neutral and latched, with a model that starts again: its state cannot be trusted."""
        old = self._states.state
        self._states.trip(Reason.OUTPUT_INVALID)
        self._transfer.entered(TRIPPED, old)
        self._rest()
        self.command = self.applied = 0.0
        if self.sway is not None:
            self.sway.angle = self.sway.rate = 0.0
        if self.sensed is not None:
            self.sensed.restart()
        return TRIPPED
