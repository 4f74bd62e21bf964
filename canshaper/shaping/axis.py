"""One axis: the state machine around filter and output limits.

Sans-I/O: every tick takes the checked input of that moment and returns what the valve frame shall
carry. Nothing but MOVING states may give anything but neutral, and a MOVING state is entered only
from READY, which takes a fresh, valid, enabled stick seen in neutral.
"""

import math
from collections.abc import Callable

from canshaper.shaping.added import AddedBounds
from canshaper.shaping.limits import (
    OutputLimits,
    RecentCommand,
    allowed_range,
    on_grid,
    rate_limited,
    within,
)
from canshaper.shaping.shapers.kind import Shaper, carry_over
from canshaper.shaping.states import MOVING, Reason, State, StickInput, Transition
from canshaper.shaping.sway import SwayMode, SwayModel

# Time constant with which the difference at a change of filter fades: quick against a swing of
# one to three seconds, slow against a valve of a tenth of a second.
BLEND_S = 0.3
# Missed ticks that are gone through one by one: after more of them nothing moves any more, and the
# first neutral frame waits.
MOST_HELD = 2000
# Most that may be owed of an added velocity, full speed times ticks: a few steps of a coarse grid.
MOST_OWED = 0.1

# A member by way of its class takes ten times as long as a name, and a tick looks at many.
NEUTRAL_WAIT, READY, ACTIVE, BYPASS_ON, STOPPING, TRIPPED = State
# Faults with which the switches are not known either: enable counts as held.
NOTHING_KNOWN = (Reason.STICK_TIMEOUT, Reason.STICK_UNTRUSTED)


class Axis:
    """State machine, filter and limits of one axis.

    Args:
        tick_s: time between two calls of ``tick``.
        limits: output limits.
        sway: sway model, or None where the axis has none.
        shaper: the filter.
        neutral_band: |stick| up to which it counts as neutral.
        stop_s: longest duration of STOPPING.
        grid_steps: raw steps of the valve frame from zero to full command.

    Attributes:
        raw: what the valve frame carries now, in grid steps (deadband included).
        sent: the velocity that gives, [-1, 1].
        told: what the sway model was told: ``sent`` without what another axis asked.
        command: the operator's command that was in force at the last tick, [-1, 1].
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
        self.state = NEUTRAL_WAIT
        self.reason = Reason.START
        self.raw = 0
        self.sent = 0.0
        self.told = 0.0
        self.command = 0.0
        self.sway = sway
        self._bounds: AddedBounds | None = None
        self._shaper = shaper
        self._tick_s = tick_s
        self._limits = limits
        self._neutral_band = neutral_band
        self._grid_steps = grid_steps
        self._rise = limits.rise_per_s * tick_s
        self._fall = limits.fall_per_s * tick_s
        self._stop_ticks = max(1, round(stop_s / tick_s))
        self._recent = RecentCommand(round(limits.tail_s / tick_s))
        self._fade = math.exp(-tick_s / BLEND_S)
        self._bump = 0.0
        self._rebump = False
        self._bypassed = False
        self._limited = 0.0  # what was sent, before rounding: the rate limit must not stick
        self._own = 0.0  # the same without what another axis adds
        self._added = 0.0  # what is added, as far as bounds and joystick allow
        self._owed = 0.0  # of a velocity added by another axis, not yet sent
        self._stopping = 0
        self._was_enabled = True
        self._was_reset = True

    @property
    def asked(self) -> bool:
        """Whether the operator asked for motion within the tail."""
        return self._recent.low != 0.0 or self._recent.high != 0.0

    @property
    def neutral(self) -> bool:
        """Whether the axis is at rest in a state that cannot move without the operator."""
        return self.state not in MOVING

    def tick(self, stick: StickInput, added: float = 0.0) -> Transition | None:
        """A whole tick: ``act`` and ``advance``."""
        transition = self.act(stick, added)
        self.advance()
        return transition

    def act(self, stick: StickInput, added: float) -> Transition | None:
        """Take the input of this tick; afterwards ``raw`` and ``sent`` are what to send.

        Args:
            stick: the checked input.
            added: velocity that another moving axis asks of this one, [-1, 1] of full speed. Its
                operator answers for it; it is carried out within its bounds, while this axis is
                enabled, its stick valid, and anti-sway on, and never against a joystick that is
                held: what would go against it is left out at once. The sway model is not told of
                it: it is there to cause no swing. One that is no velocity trips the axis.

        Returns:
            The change of state of this tick, or None.
        """
        old, bounds = self.state, self._bounds
        if stick.bypass:
            added = 0.0
        elif bounds is not None and abs(added) <= 1.0:
            added = bounds.wanted(added, self._limits.fall_per_s)
        self._decide(stick, added)
        state = self.state
        if state is not ACTIVE:
            added = 0.0
        command = 0.0
        try:
            if state is ACTIVE or state is BYPASS_ON:
                command = stick.command
                size = abs(command)
                if size <= self._neutral_band:
                    command = 0.0
                elif not size < math.inf:  # it would stay in the memory of a filter
                    raise ValueError(f"command is {command}")
            self.command = command
            wanted = self._wanted(command, added)
            if state in MOVING:
                self._drive(command, wanted, added)
            else:
                self._rest()
        except Exception:  # a filter of another package may raise anything
            self._output_invalid()
        self.told = self.sent - self._added
        if bounds is not None:
            bounds.applied(self.sent - self._own if self._own != self._limited else 0.0)
        return None if self.state is old else Transition(old, self.state, self.reason)

    def advance(self) -> None:
        """Let the model swing with what ``act`` found: work that can wait until that is sent."""
        if self.sway is not None:
            self.sway.step(self.told)

    def hold(self, ticks: int) -> None:
        """Tell the axis that the last output was held for ``ticks`` missed ticks.

        They count as time: late ticks lengthen neither the run-on nor a stop, and the filter saw
        the last command in each of them. Only the rates do not catch up.
        """
        self._recent.age(ticks)
        self._stopping += ticks
        if self._bounds is not None:
            self._bounds.held(ticks)
        maximum = self._limits.maximum
        command = within(self.command, -maximum, maximum, 0.0)
        try:
            for _ in range(min(ticks, MOST_HELD)):
                self._shaper.wanted(command)
                self.advance()
        except Exception:  # the same
            self._output_invalid()

    def retune(self, mode: SwayMode, shaper_for: Callable[[SwayModel], Shaper]) -> None:
        """Change sway data and filter, also in motion, without a jump of the output.

        The model keeps the physical swing; the difference that the new filter makes at this
        moment fades with ``BLEND_S``.

        Raises:
            ValueError: mode or filter does not suit the tick; model and filter stay as they were.
        """
        if self.sway is None:
            sway = SwayModel(mode, self._tick_s)
        else:
            sway = self.sway.retuned(mode, self.told)
        shaper = shaper_for(sway)
        maximum = self._limits.maximum
        carry_over(self._shaper, shaper, within(self.command, -maximum, maximum, 0.0))
        self._shaper = shaper
        self.sway = sway
        self._rebump = True

    def bound_added(self, bounds: AddedBounds) -> None:
        """Bound what another axis may add to this one; without bounds all of it is added."""
        self._bounds = bounds

    def restore(self, state: State, reason: Reason) -> None:
        """Continue in a state in which the output is neutral, as another axis was in it.

        Raises:
            ValueError: in that state the output need not be neutral.
        """
        if state in MOVING:
            raise ValueError(f"state: expected one with neutral output, got {state.name}")
        self.state, self.reason = state, reason

    def drop_added(self) -> None:
        """Who added has lost the right to: nothing of it is in the next output."""
        self._limited = self._own
        self._owed = 0.0

    def limit(self, limits: OutputLimits) -> None:
        """Change maximum and rates; of what the run-on remembers nothing changes.

        Raises:
            ValueError: the axis is in motion, where more speed would come without the operator.
        """
        if not self.neutral:
            raise ValueError("limits change in neutral only")
        self._limits = limits
        self._rise = limits.rise_per_s * self._tick_s
        self._fall = limits.fall_per_s * self._tick_s

    # -- the state machine ---------------------------------------------------------------------

    def _decide(self, stick: StickInput, added: float) -> None:
        """Move to the state that this tick's input asks for."""
        state = self.state
        command, fault, enabled, _bypass, reset, trip = stick
        centred = pressed = False
        if fault is None:
            centred = abs(command) <= self._neutral_band
            pressed = (reset and not self._was_reset) or (enabled and not self._was_enabled)
            self._was_reset, self._was_enabled = reset, enabled
        else:  # a switch that is held while its frames fail is no new press
            self._was_reset = self._was_reset or reset
            self._was_enabled = enabled or fault in NOTHING_KNOWN

        if trip is not None:
            if state is not TRIPPED:
                self._go(TRIPPED, trip)
        elif state is ACTIVE or state is BYPASS_ON:
            self._moving(stick, centred, added)
        elif state is READY:
            self._ready(stick, centred, added)
        elif state is NEUTRAL_WAIT:
            self._wait(stick, centred)
        elif state is STOPPING:
            self._stop(stick)
        elif pressed and centred:
            self._go(NEUTRAL_WAIT, Reason.RESET)

    def _wait(self, stick: StickInput, centred: bool) -> None:
        if stick.fault is not None:
            self.reason = stick.fault if stick.enabled else Reason.ENABLE_OFF
        elif not centred:
            self.reason = Reason.STICK_NOT_NEUTRAL
        elif not stick.enabled:
            self.reason = Reason.ENABLE_OFF
        else:
            self._go(READY, Reason.STICK_NEUTRAL)

    def _ready(self, stick: StickInput, centred: bool, added: float) -> None:
        if not stick.enabled:
            self._go(NEUTRAL_WAIT, Reason.ENABLE_OFF)
        elif stick.fault is not None:
            self._go(NEUTRAL_WAIT, stick.fault)
        elif not centred:
            if stick.bypass:
                self._go(BYPASS_ON, Reason.BYPASS_REQUESTED)
            else:
                self._go(ACTIVE, Reason.STICK_MOVED)
        elif added:
            self._go(ACTIVE, Reason.COMPENSATING)

    def _moving(self, stick: StickInput, centred: bool, added: float) -> None:
        if not stick.enabled:
            self._go(TRIPPED, Reason.ENABLE_LOST)
        elif stick.fault is not None:
            self._stopping = 0
            self._go(STOPPING, stick.fault)
        elif centred and not added and self._at_rest():
            self._go(READY, Reason.AT_REST)
        elif stick.bypass:
            if self.state is ACTIVE:
                self._go(BYPASS_ON, Reason.BYPASS_REQUESTED)
        elif self.state is BYPASS_ON:
            self._go(ACTIVE, Reason.BYPASS_RELEASED)

    def _stop(self, stick: StickInput) -> None:
        if not stick.enabled:
            self._go(TRIPPED, Reason.ENABLE_LOST)
            return
        self._stopping += 1
        if self._stopping >= self._stop_ticks or self._at_rest():
            self._go(NEUTRAL_WAIT, Reason.STOP_DONE)

    def _go(self, state: State, reason: Reason) -> None:
        # A stop goes on with whatever drove the axis before.
        if state is not STOPPING:
            bypassed = state is BYPASS_ON
            # From rest there is nothing to join to: the stick counts in full at once.
            self._rebump = self.state in MOVING and bypassed is not self._bypassed
            self._bypassed = bypassed
        self.state, self.reason = state, reason

    def _at_rest(self) -> bool:
        """Neutral is sent and the run-on is over: the filter can ask for nothing any more."""
        return self.raw == 0 and not self.asked

    # -- the output ----------------------------------------------------------------------------

    def _wanted(self, command: float, added: float) -> float:
        """What the filter asks for; with ``added``, no step from what was sent before a change."""
        maximum = self._limits.maximum
        if abs(command) > maximum:  # a filter that is cut off damps nothing
            command = math.copysign(maximum, command)
        wanted = self._shaper.wanted(command)
        if self._bypassed:
            wanted = command
        if self._rebump:
            self._rebump = False
            self._bump = self._limited - wanted - added
        elif self._bump:
            self._bump *= self._fade
            if abs(self._bump) < 1e-6:  # far below any frame's resolution
                self._bump = 0.0
        return wanted + self._bump

    def _drive(self, command: float, wanted: float, added: float) -> None:
        limits, recent = self._limits, self._recent
        recent.add(command)
        low, high = allowed_range(command, recent.low, recent.high, limits)
        target = within(wanted, low, high, limits.minimum)
        self._added = added
        if added or self._own != self._limited:
            self._drive_both(command, target, low, high)
            return
        limited = rate_limited(target, self._limited, self._rise, self._fall)
        self._limited = self._own = limited
        if limited < low:  # on its way back in
            low = limited
        elif limited > high:
            high = limited
        self.raw, self.sent = on_grid(
            limited, low, high, limits.deadband, self._grid_steps, curve=limits.curve
        )

    def _drive_both(self, command: float, target: float, low: float, high: float) -> None:
        """Send the operator's part and the added one, or what is left of that.

        The added part is a path to be run, slow and with few steps of the grid: what rounding and
        rates leave out is owed and paid while the axis moves anyway, never by a twitch: by one step
        of the grid in a tick.
        """
        limits, aim = self._limits, target
        own = self._own = rate_limited(target, self._own, self._rise, self._fall)
        if adding := self._added != 0.0:
            low, high = -limits.maximum, limits.maximum
            aim = self._aim(command, target)
        limited = rate_limited(aim, self._limited, self._rise, self._fall)
        # Never against a joystick that is held, but as far as the operator's own part still is.
        if (command > 0.0 and limited < own and limited < 0.0) or (
            command < 0.0 and limited > own and limited > 0.0
        ):
            limited = own if own * command < 0.0 else 0.0
        if self._bounds is not None:
            kept = self._bounds.kept(limited - own)
            if kept != limited - own:
                limited = own + kept
        self._limited = limited
        self.raw, self.sent = on_grid(
            limited,
            min(low, limited),
            max(high, limited),
            limits.deadband,
            self._grid_steps,
            curve=limits.curve,
        )
        if adding:
            owed = self._owed + own + self._added - self.sent
            self._owed = within(owed, -MOST_OWED, MOST_OWED, 0.0)

    def _aim(self, command: float, target: float) -> float:
        """Both parts together; of the added one is left out what goes against a held joystick."""
        added = self._added
        if not abs(added) <= 1.0:
            raise ValueError(f"added velocity is {added}")
        if command > 0.0:
            added = max(added, min(0.0, target) - target)
        elif command < 0.0:
            added = min(added, max(0.0, target) - target)
        self._added = added
        maximum, step = self._limits.maximum, 1.0 / self._grid_steps
        least = max(self._limits.minimum, 0.5 * step)
        wish = within(target + added, -maximum, maximum, least)
        paid = within(self._owed, -step, step, 0.0) if wish else 0.0
        return within(wish + paid, -maximum, maximum, least)

    def _rest(self) -> None:
        self._recent.clear()
        self._bump = self._limited = self._own = self._added = self._owed = self.sent = 0.0
        self.raw = 0

    def _output_invalid(self) -> None:
        """Neutral and latched, with a model that starts anew: its state cannot be trusted."""
        self._go(TRIPPED, Reason.OUTPUT_INVALID)
        self._rest()
        self.command = 0.0
        if self.sway is not None:
            self.sway.angle = self.sway.rate = 0.0
