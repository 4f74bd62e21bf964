"""The gate's memory of one axis: demands of its operator, and frames that left for its valve."""

from collections import deque
from collections.abc import Sequence

from canshaper.gate.fields import EPSILON
from canshaper.gate.received import NEVER, AxisInput, JoystickState
from canshaper.gate.record import Axis, Valve

FOREIGN_NS = 1_000_000_000
"""Time (ns) for which a second sender has to be silent before the axis may move again."""
BLEND_S = 0.3
"""Time (s) for which the output may keep its velocity when another filter takes over."""
UP = 0.5
"""Largest rounding up of a velocity, in steps of the frame."""
ROUNDING = 1.0 + UP
"""Largest change between two frames by rounding, in steps: ``UP`` up, 1 down at the range's end."""


class Asked:
    """Demand of the operator in one direction within the tail, and the distance it has left."""

    __slots__ = ("_last", "_since", "_sizes", "before", "most", "remaining")

    def __init__(self) -> None:
        # (period of the last demand of this size, size); largest first, each later one smaller.
        self._sizes: deque[tuple[int, float]] = deque()
        self.most = self.before = 0.0  # largest size within the tail: since the last stop; at all
        # Demanded distance that has not been travelled, full speed times seconds; not below 0 when
        # a stroke begins, since a sound filter may travel farther after a tap than was demanded.
        self.remaining = 0.0
        self._last = self._since = -1  # period of the last note, and of the last stop

    def note(self, size: float, distance: float, period: int, of: Axis) -> None:
        """Remember the demand of this period, and the demanded distance since the last note.

        Size is a part of full speed, distance full speed times seconds.
        """
        sizes, self._last = self._sizes, period
        if not (size or sizes or self.remaining):
            return
        oldest = period - of.tail
        while sizes and sizes[0][0] < oldest:
            sizes.popleft()
        if size:
            while sizes and sizes[-1][1] <= size:
                sizes.pop()
            sizes.append((period, size))
        at, most = sizes[0] if sizes else (0, 0.0)
        self.before = most
        if at <= self._since:
            most = next((one for at, one in sizes if at > self._since), 0.0)
        self.most = most
        # Never more than the tail holds: an output that stays slower may not catch up later.
        remaining, most = self.remaining + distance, most * of.tail * of.period_s
        self.remaining = (remaining if remaining < most else most) if most else 0.0

    def forget(self) -> None:
        """Forget the demand at a stop: the output may not run on by it."""
        self._since = self._last
        self.most = self.remaining = 0.0


class AxisState(AxisInput):
    """State of one axis. It may move while armed, and for ``stop_left`` periods of a shaped stop.

    In its methods ``made`` counts ticks that were run, ``number`` counts deadlines, missed ones
    too; ``passed`` and ``ticks`` count periods of the valve.
    """

    __slots__ = (
        "alone", "armed", "asked", "asked_now", "back", "cause", "due", "flips", "forth", "held",
        "high", "joystick", "last", "latched", "least", "most", "now", "partner", "ramp", "ran",
        "sent_at", "stop_left", "ticks", "top", "way", "way_back", "why", "zero_at",
    )  # fmt: skip

    def __init__(self, axis: Axis, joystick: JoystickState) -> None:
        super().__init__(axis)
        self.joystick = joystick
        self.partner: AxisState | None = None
        # During a measurement: the demand that replaces the joystick's, which stays neutral.
        self.ramp: float | None = None
        self.armed = False  # neutral was seen, valid and enabled, since the last reason to stop
        self.latched = False  # neutral does not arm before reset or enable is pressed again
        self.cause = NEVER  # number of the last frame at the last reason that latched
        self.why, self.stop_left = "start", 0  # why it is not armed
        self.now = 0.0  # demand in this period; 0 while not armed
        self.held = 0  # number of periods before this one with the demand on the same side
        self.forth, self.back = Asked(), Asked()  # demand in each direction
        self.least = self.most = 0.0  # velocities that may leave in this tick
        # There is a demand to the axis or its partner: in this period; in this or the last one.
        self.asked_now = self.asked = False
        self.due = False  # it has its turn in this tick, and has sent nothing yet
        self.ticks = 0  # periods since its last frame
        self.sent_at = 0  # number of the deadline of its last frame
        self.flips = 0  # how often anti-sway was switched in its joystick, as the axis has seen
        # ``last``: velocity of the last frame. ``top``: what it may have been before rounding, or
        # may be by now where no frame was passed on. ``way_back``: a fall at ``fall_per_s`` from
        # the last demand; that is no run-on, and a velocity no faster counts no distance.
        # ``high``: ``top`` by the rise of all frames since it was at rest.
        self.last, self.top, self.high, self.way_back = 0.0, axis.step, axis.step, axis.step
        self.zero_at = NEVER  # ``made`` when it came to rest, or lost the right to move
        self.ran = 0.0  # distance in one run beyond the demand and what a partner may add
        # Distance and periods in motion since the axis last had a demand, or its partner had none;
        # a pause resets neither.
        self.way, self.alone = 0.0, 0

    def halt(self, why: str, made: int, cause: int | None = None) -> None:
        """Stop the axis at once: no velocity may leave from now on.

        With a ``cause`` it latches, as after a trip: until a press in a frame behind that number.
        """
        if self.armed or self.last:
            self.zero_at = made
        self.armed, self.stop_left, self.why = False, 0, why
        if cause is not None:
            self.latched, self.cause = True, cause
        self.forth.forget()
        self.back.forget()

    def look(
        self,
        why: str,
        demand: float | None,
        made: int,
        number: int,
        passed: int,
        *,
        cause: int,
        latches: bool,
    ) -> None:
        """Decide whether the axis may move in this period, and remember its demand.

        Args:
            why: the reason to stop at once, or empty; ``latches``: it latches at rest too.
            demand: demand of the joystick; None is a reason for a shaped stop.
            made, number, passed: as in the class; ``passed`` counts from the last turn.
            cause: number of the frame with the reason; a lasting reason is as new as the last one.
        """
        of, before = self.of, self.now
        self.now = 0.0
        self.ticks += 1
        if self.last and number - self.sent_at > of.silent:  # its valve has closed by itself
            self.last, self.top, self.high, self.zero_at = 0.0, of.step, of.step, made
        left = self.stop_left - passed if self.stop_left > passed else 0
        if not why and self.joystick.pressed.press > self.cause:
            self.latched = False
        if why:  # as long as it lasts, no press ends a latch
            self.halt(why, made, cause if self.latched or latches or self.last != 0.0 else None)
        elif demand is None:
            self.stop_left = of.stop if self.armed else left
            self.armed, self.why = False, "joystick"
        elif abs(demand) > of.stick.band or (self.armed and self.ramp):
            self.stop_left = left
            self.now = demand if self.armed else 0.0
        else:
            self.stop_left = 0
            self.armed = self.armed or not self.latched
        self.hard, self.latches, self.lost = "", False, False
        self._ask(before, number // of.period, passed)

    def _ask(self, before: float, period: int, passed: int) -> None:
        """Remember the demand; over missed deadlines the demand before counts as held."""
        of, now = self.of, self.now
        self.held = self.held + passed if now * before > 0.0 else 0
        if self.flips != self.joystick.flips:
            self.flips = self.joystick.flips
            self.change_filter()
        if now and not before:
            began = self.forth if now > 0.0 else self.back
            began.remaining = max(began.remaining, 0.0)
        distance = (now + before * (passed - 1)) * of.period_s
        forth = distance if distance > 0.0 else 0.0
        self.forth.note(now if now > 0.0 else 0.0, forth, period, of)
        self.back.note(-now if now < 0.0 else 0.0, forth - distance, period, of)

    def change_filter(self) -> None:
        """Allow the way of ``last`` in BLEND_S more: another filter, or none, takes over."""
        (self.forth if self.last > 0.0 else self.back).remaining += abs(self.last) * BLEND_S

    def dropped(self, made: int) -> float:
        """Return how much velocity may end in one frame: what a partner added, if it has stopped.

        The gate does not know when a partner that is at rest now has stopped.
        """
        partner = self.partner
        if partner is None:
            return 0.0
        if made - partner.zero_at <= 2 * self.of.period:
            return 1.0
        return 0.0 if partner.last else self.of.added

    def share(self) -> None:
        """Find whether axis or partner has a demand within its tail, after ``look`` of both."""
        own, partner = self.forth.most or self.back.most, self.partner
        asked = bool(own or (partner and (partner.forth.most or partner.back.most)))
        self.asked_now, self.asked = asked, asked or self.asked_now
        if own or not self.asked:
            self.way, self.alone = 0.0, 0
        if self.of.forwarded and self.ticks > 1:
            # No frame was passed on in the period before: from now on what it allowed has to fall.
            reach = self.most if self.last > 0.0 else -self.least
            self.top = max(self.top - self.of.fall, min(self.top, reach))

    def risen(self, velocity: float, periods: int) -> float:
        """Return the speed, before rounding up, to which the output may rise in so many periods."""
        of, rise = self.of, self.of.rise * periods
        if velocity * self.last >= 0.0:
            return min(self.top, self.high) + rise
        # A part of the time goes by on the way to zero.
        left = 1.0 - max(abs(self.last) - of.step, 0.0) / (of.fall * max(periods, 1))
        return max(left, 0.0) * rise + of.step

    def fallen(self, velocity: float, periods: int) -> float:
        """Return the speed to fall to in so many periods; 0 where ``velocity`` turns direction."""
        return self.top - self.of.fall * periods if velocity * self.last >= 0.0 else 0.0

    def held_at(self, velocity: float) -> float:
        """Return the size of the demand in the direction of a velocity; 0 if it points back."""
        return max(self.now if velocity > 0.0 else -self.now, 0.0)

    def left(self, velocity: float, made: int, number: int) -> None:
        """Remember the velocity, part of full speed, of a valve frame that has left."""
        of, last = self.of, self.last
        passed, self.ticks, self.sent_at = self.ticks, 0, number
        if not velocity:
            self._rests(passed, made)
            return
        size, held = abs(velocity), self.held_at(velocity)
        self.high = self.risen(velocity, passed if of.forwarded else 1)
        asked, other = (self.forth, self.back) if velocity > 0.0 else (self.back, self.forth)
        reach = self.most if velocity > 0.0 else -self.least
        fallen = self.fallen(velocity, min(passed, 1) if of.forwarded else passed)
        self.way += velocity * of.period_s
        self.alone += 1
        if (beyond := size - held - of.added) > EPSILON:
            self.ran += beyond * of.period_s * passed
        elif self.now:
            self.ran = 0.0
        on = self.way_back - of.fall * passed if velocity * last > 0.0 else 0.0
        self.way_back = max(on, held + of.step)
        if size > min(fallen, self.way_back) + EPSILON:
            way = size * of.period_s * passed
            asked.remaining -= way
            if of.added:  # an added motion to and fro: this way makes up for an overrun back
                other.remaining = max(min(other.remaining + way, 0.0), other.remaining)
        self.top = size + of.step
        if size > reach + EPSILON:  # on its way back to ``reach``: it has to fall with each frame
            self.top = min(self.top, max(reach, fallen))
        self.last = velocity

    def _rests(self, passed: int, made: int) -> None:
        """Remember that a neutral frame has left."""
        of = self.of
        if self.last:
            self.zero_at = made
            fall = of.fall * max(passed, 1) + ROUNDING * of.step
            if abs(self.last) > fall + self.dropped(made):
                # Only a stop falls so fast: from here on rule 3 demands neutral first.
                self.halt("fell to neutral at once", made)
        if self.now:
            self.ran = 0.0
        self.last, self.top, self.high, self.way_back = 0.0, of.step, of.step, of.step

    def carry_over(self, before: "AxisState") -> None:
        """Keep the latch over a reload, and any reason to stop that no tick has seen yet."""
        self.latched = self.latched or before.latched
        self.cause = max(self.cause, before.cause)
        if before.hard:
            self.stop(before.hard, before.hard_at, latches=before.latches)
        self.foreign_ns = max(self.foreign_ns, before.foreign_ns)


class ValveState:
    """State of one valve message; its axes have one period, and so their turn together.

    Attributes:
        count: alive counter of the last frame that left.
        before: alive counter of the frame before.
    """

    def __init__(self, valve: Valve, axes: Sequence[AxisState]) -> None:
        self.of, self.axes, self.joystick = valve, axes, axes[0].joystick
        self.count: int | None = None
        self.before: int | None = None
