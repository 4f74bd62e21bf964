"""The judge of one axis: whether motion is allowed at all, and within which velocities.

    WAIT     nothing may move before a fresh, valid, enabled joystick in neutral was seen
    FREE     the joystick moves the axis
    STOP     the input was lost or invalid in motion: to zero, within stop_s
    LATCHED  neutral at once, until enable or reset is pressed with the joystick in neutral

Never faster than was commanded within the tail, never against the joystick, never quicker than the
valve's rates, all on the grid of the valve's frame.
"""

from collections import deque
from typing import Any

from canshaper.codec.frame import Frame
from tests.faults import received
from tests.faults.axis import Axis
from tests.faults.received import LONG_AGO, ReceivedJoystick

WAIT, FREE, STOP, LATCHED = range(4)
WORDS = ("WAIT", "FREE", "STOP", "LATCHED")

# States of the status message by their numbers in docs/states.md, and the ways between them.
BYPASS_ON, STOPPING, TRIPPED = 3, 4, 5
MOVING = (2, 3, STOPPING)
WAYS = {(0, 1), (1, 0), (1, 2), (1, 3), (2, 3), (3, 2), (2, 1), (3, 1), (2, 4), (3, 4), (4, 0)}
WAYS |= {(state, TRIPPED) for state in range(5)} | {(TRIPPED, 0)}

# Causes that latch an axis in any state; the others only one in motion.
ALWAYS_LATCHED = {received.EMERGENCY_STOP, received.SECOND_SENDER}

# Steps that rounding to the grid may make between two frames, down by one and up by half of one.
ROUNDING = 1.5
# How long another sender of a valve's id must be silent before a trip for it can be reset.
FOREIGN_NS = 1_000_000_000
# Ticks after which a filter that answers the last swing of the joystick is done with it.
SETTLED = {"off": 3, "first_order": 3, "s_curve": 3}
SETTLED_OTHERS = 25


class AxisJudge:
    """Judge of the frames of one axis."""

    def __init__(self, axis: Axis, joystick: ReceivedJoystick) -> None:
        self.axis = axis
        self.joystick = joystick
        self.mode = WAIT
        self.raw = 0
        self.low = self.high = 0.0
        self.commanded = self.was_commanded = False
        self.command = 0.0
        self.causes: set[int] = set()  # of neutral at once, since the last frame of the valve
        self.foreign_ns = LONG_AGO
        self.state = 0
        self.reasons: set[int] = set()  # of a stop or trip that hold now
        self._commands: deque[tuple[int, float]] = deque()
        self._range = (0.0, 0.0)
        self._end = 0
        self._side, self._crossed = 1.0, 0  # to which side the joystick is held, and since when
        self._releases = self._presses = self._resets = self._disagreements = 0
        self._shaped_since = -(10**9)  # deadline at which anti-sway was switched on in motion
        self._steady = 0
        self._count: int | None = None
        self._must_fall = False
        self._pressed_since = False
        self._pressed_again = False  # and released between two frames of the valve
        self._status: dict[str, Any] = {}

    # -- may it move? ---------------------------------------------------------------------------

    def decide(self, now_ns: int, index: int, overrun: bool, slewing: bool) -> None:
        """Bring mode and bounds to this frame of the valve.

        Args:
            now_ns: time of the tick.
            index: number of this frame's deadline.
            overrun: so many ticks came late that the axis may stop for it.
            slewing: the other axis of a two-axis motion may move this one.
        """
        joystick, axis = self.joystick, self.axis
        faults = joystick.faults(axis, now_ns)
        alone, released, pressed = self._switches(now_ns)
        causes, self.causes = self.causes, set()
        self._pressed_since = pressed or (self._pressed_since and not causes)
        # As it reported last; ``agrees`` holds that against the valve.
        in_motion = self.state in MOVING
        if now_ns - self.foreign_ns <= FOREIGN_NS:
            causes.add(received.SECOND_SENDER)
        if not in_motion:
            causes.discard(received.SEND_FAILED)
        usable = not faults and not causes and not alone and joystick.enable() == 1
        deflection = joystick.joysticks[axis.name][0] if usable else 0.0
        centred = usable and abs(deflection) <= axis.band
        self.reasons = causes | faults | ({received.LOOP_OVERRUN} if overrun else set())
        if released:
            self.reasons.add(received.ENABLE_LOST)
        reported = self._status.get("State", self.state)
        began = self.mode

        if causes & ALWAYS_LATCHED or ((causes or released) and in_motion):
            self._go(LATCHED)
        elif self.mode == LATCHED:
            # A press among frames that say nothing else, or with enable off, may count later.
            late = self._pressed_since and reported == 0 and not faults and not causes
            if (pressed and centred) or (
                late and abs(joystick.joysticks[axis.name][0]) <= axis.band
            ):
                self._go(WAIT)
        elif causes or released:
            self._go(WAIT)
        elif self.mode == FREE and faults:
            self._go(STOP if in_motion else WAIT)
            self._end = index + axis.stop
        elif self.mode == STOP and (index >= self._end or reported not in MOVING):
            self._go(WAIT)
        elif self.mode == FREE and overrun and reported in (0, STOPPING):
            # It may stop for late ticks; then it has to wait for neutral like after any stop.
            self._go(WAIT if reported == 0 else STOP)
            self._end = index + axis.stop
        if reported == TRIPPED:  # latched is latched, whatever for
            self._go(LATCHED)
        self._pressed_again = released and pressed and self.mode == LATCHED
        if self.mode == began == WAIT and centred:
            self._go(FREE)
        deflection = deflection if abs(deflection) > axis.band else 0.0
        self._stop_against(deflection)
        self._bounds(index, deflection, slewing)
        stops = began == FREE and self.mode == STOP and bool(faults)
        self._must_fall = stops and self._settled()

    def _switches(self, now_ns: int) -> tuple[bool, bool, bool]:
        """Whether an enable switch does not agree, enable is released, a switch was pressed."""
        joystick, name = self.joystick, self.axis.name
        alone = joystick.disagreements > self._disagreements or joystick.disagree(now_ns)
        off = joystick.fresh(now_ns) and joystick.enable() == 0
        released = alone or off or joystick.releases > self._releases
        pressed = joystick.presses[name] > self._presses or joystick.resets > self._resets
        pressed |= self._pressed_again
        self._disagreements, self._releases = joystick.disagreements, joystick.releases
        self._resets, self._presses = joystick.resets, joystick.presses[name]
        return alone, released, pressed

    def _go(self, mode: int) -> None:
        self.mode = mode
        if mode in (WAIT, LATCHED):
            self._commands.clear()
            self._range = (0.0, 0.0)
            self.commanded = False

    def _stop_against(self, deflection: float) -> None:
        """Nothing runs on against a valid joystick, unless a reversal may."""
        shaped = self.axis.reversal or self.axis.allow_reverse
        if self.mode == STOP and deflection * self.raw < 0.0 and not shaped:
            self._commands.clear()
            self._range = (0.0, 0.0)

    def _settled(self) -> bool:
        return self._steady >= SETTLED.get(self.axis.filter, SETTLED_OTHERS)

    def _bounds(self, index: int, command: float, slewing: bool) -> None:
        axis = self.axis
        before, self.commanded = self.commanded, False
        self.was_commanded = before
        self.low = self.high = 0.0
        self.command = 0.0
        if self.mode in (WAIT, LATCHED):
            return
        self.command = command if self.mode == FREE else 0.0
        if self.command * self._side < 0.0:
            self._side, self._crossed = -self._side, index
        low, high = self._range = self._range_since(index - axis.tail, index)
        in_motion = self.raw or before or self.command
        released = self.state == BYPASS_ON and in_motion and not self.joystick.bypasses()
        if released and self.mode == FREE:  # a stop goes on with what drove the axis before
            self._shaped_since = index
        self.commanded = low < 0.0 or high > 0.0
        if index < self._shaped_since + axis.tail:  # the filter does not run on yet
            low, high = min(0.0, self.command), max(0.0, self.command)
        if axis.allow_faster:
            low, high = -float(low < 0.0), float(high > 0.0)
        if axis.allow_reverse:
            low, high = min(low, -high), max(high, -low)
        elif index - self._crossed >= axis.reversal:
            low = low if self.command <= 0.0 else 0.0
            high = high if self.command >= 0.0 else 0.0
        added = axis.largest_added and (before or self.commanded or slewing) and self.mode == FREE
        if added and not self.joystick.bypasses():
            # Where its operator holds nothing against it, another one may, no faster than he did.
            most = axis.largest_added
            if self.command <= 0.0:
                low = min(low, max(self._range[0] or -most, -most))
            if self.command >= 0.0:
                high = max(high, min(self._range[1] or most, most))
        self.low, self.high = max(low, -axis.maximum), min(high, axis.maximum)

    def _range_since(self, first: int, index: int) -> tuple[float, float]:
        """Smallest and largest command since a deadline, zero included, with the one of now."""
        recent, (low, high), command = self._commands, self._range, self.command
        recent.append((index, command))
        gone = False
        while recent[0][0] < first:
            old = recent.popleft()[1]
            gone = gone or (old != 0.0 and old in (low, high))
        if gone:
            commands = [c for _, c in recent]
            return min(0.0, *commands), max(0.0, *commands)
        return min(low, command), max(high, command)

    # -- what was sent ----------------------------------------------------------------------------

    def check(self, frame: Frame) -> str:
        """Return the fault of a frame of the valve; nothing when it is allowed."""
        axis = self.axis
        raw, count = axis.sent(frame.data)
        if axis.valve_counter:
            if self._count is not None and count != (self._count + 1) & axis.valve_counter.mask:
                return f"alive counter {count} after {self._count}"
            self._count = count
        before, self.raw = self.raw, raw
        wrong = self._wrong(axis.velocity(before), axis.velocity(raw), raw)
        if wrong:
            return f"{WORDS[self.mode]}: sent {raw} after {before}: {wrong}"
        follows = self.mode == FREE and abs(self.command) >= 0.2
        follows = follows and abs(axis.velocity(raw) - self.command) <= axis.step
        self._steady = self._steady + 1 if follows and raw == before else 0
        return ""

    def _wrong(self, before: float, now: float, raw: int) -> str:
        axis = self.axis
        if self.mode in (WAIT, LATCHED):
            return "allowed is neutral" if raw else ""
        slack = ROUNDING * axis.step
        edge = 1e-9
        if raw and not now:
            return "allowed is no command inside the deadband"
        # Beyond the bounds only on the way back to them, at the rate of the fall.
        high = max(self.high, before - axis.fall + slack)
        low = min(self.low, before + axis.fall - slack)
        if not low - edge <= now <= high + edge:
            return f"allowed is {low:.4f} to {high:.4f}, got {now:.4f}"
        low, high = self._range
        if before < 0.0:
            before, now, low, high = -before, -now, -high, -low
        grown = before + axis.rise + slack
        # An added velocity may end at once: the rate holds for what is left of the command.
        most = axis.largest_added
        own = max(0.0, before - most)
        if own > 0.0 > now:
            fallen = -axis.rise * max(0.0, 1.0 - own / axis.fall) - slack
        else:
            fallen = own - axis.fall - slack if own else -axis.rise - slack
        if most:  # where it went against what is left, that is faster, as far as it was commanded
            grown = max(grown, min(high + slack, grown + most))
            fallen = min(fallen, max(low - slack, before - most - axis.rise - slack))
        if not fallen - edge <= now <= grown + edge:
            return f"rates allow {fallen:.4f} to {grown:.4f}, got {now:.4f}"
        if self._must_fall and now >= before:
            return f"the input is lost and nothing falls: {before:.4f} to {now:.4f}"
        return ""

    def read(self, frame: Frame) -> None:
        """Take the status frame of this tick."""
        self._status = self.axis.status(frame.data)

    def wrong_status(self) -> str:
        """Return the fault of the status frame of this tick, if there is one."""
        values, self._status = self._status, {}
        if not values:
            return ""
        before, self.state = self.state, values["State"]
        if before != self.state:
            if (before, self.state) not in WAYS:
                return f"state {self.state} after {before}"
            if self.state in (STOPPING, TRIPPED) and values["Reason"] not in self.reasons:
                known = ", ".join(map(str, sorted(self.reasons))) or "none"
                return f"state {self.state} for reason {values['Reason']}, true are {known}"
        shown = values["ShapedCommand"]
        if abs(shown - 100.0 * self.axis.velocity(self.raw)) > 0.01:
            return f"status shows {shown} % for {self.raw} steps"
        return ""

    def agrees(self) -> str:
        """Compare the state reported so far with the frame sent."""
        if self.raw and self.state not in MOVING:
            return f"moves in state {self.state}"
        if self.mode == LATCHED and self.state != TRIPPED:
            return f"state {self.state}, allowed is {TRIPPED}"
        return ""
