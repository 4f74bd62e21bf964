"""The gate's memory of received frames: messages, switches, joysticks.

A reason to stop counts in every frame with the right length and checksum, however briefly it was
there; a reason to go on counts only in a frame that is in sequence too.
"""

from collections.abc import Sequence

from canshaper.gate.fields import Word
from canshaper.gate.record import Axis, Joystick, Message, Switch

NEVER = -(1 << 62)


class AxisInput:
    """Input of an axis: its demand, and each reason to stop since its last turn, however brief.

    Attributes:
        demand: demand, [-1, 1], of the last joystick frame that counts; None where it has none.
        changed_ns: time since when the demand has this value.
        foreign_ns: time when a second sender was received last.
        hard: a reason to stop at once, or empty.
        hard_at: number of the frame that gave it.
        latches: whether any of these reasons latches at rest too.
        lost: whether another joystick has taken over meanwhile.
    """

    __slots__ = ("changed_ns", "demand", "foreign_ns", "hard", "hard_at", "latches", "lost", "of")

    def __init__(self, axis: Axis) -> None:
        self.of = axis
        self.demand: float | None = None
        self.changed_ns, self.foreign_ns = 0, NEVER
        self.hard, self.hard_at, self.latches, self.lost = "", NEVER, False, False

    def stop(self, why: str, at: int, *, latches: bool = False) -> None:
        """Stop the axis in its turn, for a reason in the frame of this number."""
        self.hard, self.hard_at, self.latches = why, at, self.latches or latches

    def take(self, word: Word, now_ns: int) -> None:
        """Store the demand of a joystick frame that counts."""
        demand = self.of.stick.demand(word)
        if demand != self.demand:
            self.demand, self.changed_ns = demand, now_ns


class Received:
    """State of one received message: whether its frames are right and in sequence, and its age."""

    def __init__(self, message: Message) -> None:
        self.of = message
        self.good_ns: int | None = None  # time of the last frame that counts
        self.intact_ns = NEVER  # time of the last frame with the right checksum
        self.count: int | None = None  # alive counter of the last frame with the right checksum
        self.any_count = True  # after silence: any next count is good except the last one
        self.good = 0  # good frames in a row
        self.waiting = False  # in a gateway: a frame that counts has come and was not passed on
        # For a message from any address: the address that counts, and the time of its last frame.
        self.source, self.source_ns = -1, NEVER
        self.switches: list[SwitchState] = []  # switches in the message
        self.joystick: JoystickState | None = None  # the joystick in the message
        self.axes: list[AxisInput] = []  # axes that the joystick moves

    def take(self, data: bytes, word: Word, now_ns: int) -> tuple[bool, bool]:
        """Receive a frame; return (whether its reasons to stop count, whether it counts fully)."""
        of, protection = self.of, self.of.protection
        if len(data) != of.length:
            return False, False
        other = of.page is not None and of.page[0].raw(word) != of.page[1]
        if other and of.alone:
            return False, False
        if now_ns - self.intact_ns > of.timeout_ns:
            self.any_count, self.good = True, 0
        if not protection.right(data):
            self.good = 0
            return False, False
        self.intact_ns = now_ns
        if protection.counts:
            last, self.count = self.count, protection.count(data, word)
            step = 1 if last is None else (self.count - last) % protection.counts
            if step > of.most_step and not self.any_count:
                self.good = step = 0
            if step == 0:
                return not other, False
            self.any_count = False
        self.good = min(self.good + 1, of.qualify)
        if other or self.good < of.qualify:
            return not other, False
        self.good_ns, self.waiting = now_ns, True
        return True, True

    def from_other(self, source: int, now_ns: int) -> bool:
        """Return whether another J1939 address still sends the message; else ``source`` counts."""
        if source != self.source:
            if now_ns - self.source_ns <= self.of.timeout_ns:
                return True
            if self.source >= 0:  # another joystick: neutral comes first
                for axis in self.axes:
                    axis.lost = True
            self.source = source
        self.source_ns = now_ns
        return False

    def lost(self, now_ns: int) -> bool:
        """Return whether the message is older than its timeout, or never came."""
        return self.good_ns is None or now_ns - self.good_ns > self.of.timeout_ns

    def forget(self) -> None:
        """Let no frame received so far count, and accept any next counter but the last."""
        self.good_ns, self.intact_ns = None, NEVER

    def carry_over(self, before: "Received", *, missed: bool) -> None:
        """Continue the state before a reload; ``missed``: its bus was closed meanwhile."""
        self.source, self.source_ns = before.source, before.source_ns
        self.intact_ns = NEVER if missed else before.intact_ns
        if self.of.protection == before.of.protection:
            self.count, self.any_count, self.good = before.count, before.any_count, before.good
        released = {(s.of.field, s.of.on): s.was_off for s in before.switches if s.released}
        for switch in self.switches:
            key = switch.of.field, switch.of.on
            switch.released, switch.was_off = key in released, released.get(key, False)


class SwitchState:
    """State of one switch, and the axes that it stops."""

    def __init__(
        self, switch: Switch, received: Received, axes: Sequence[AxisInput], *, emergency: bool
    ) -> None:
        self.of, self.received, self.axes = switch, received, axes
        self.emergency = emergency  # an emergency stop, which latches at rest too
        self.on = False  # whether it is on in the last frame that counts
        self.released = False  # set by any frame that says so, cleared only by one that counts
        self.was_off = False  # whether a frame that counts released it since its last press
        self.press = NEVER  # number of the frame with its last press, or with that of reset

    def take(self, word: Word, number: int, *, counts: bool, stood: bool) -> None:
        """Receive the frame of this number; one that has waited in a standstill is no press."""
        of = self.of
        raw = of.field.raw(word)
        on = raw == of.on
        if counts:
            self.on = on
        if raw == 0 if of.only_zero else not on:
            self.released, self.was_off = True, self.was_off or counts
            why = "emergency stop" if self.emergency else "enable"
            for axis in self.axes:
                axis.stop(why, number, latches=self.emergency)
        elif counts:
            self.released = False
            if on and self.was_off:
                self.was_off = False
                if not stood:
                    self.press = number

    def off(self, now_ns: int) -> bool:
        """Return whether the switch is off now, or its state is not known."""
        return self.released or self.received.lost(now_ns)


class JoystickState:
    """State of one joystick and of the switches that enable it; the operator presses the first."""

    def __init__(self, joystick: Joystick, received: Received, *switches: SwitchState) -> None:
        self.of, self.received = joystick, received
        self.pressed, *self.others = switches
        self.was_reset = True
        self.bypassed, self.flips = False, 0  # anti-sway is off; how often that has changed
        self.gone = ""  # why all its axes have to stop at once in this tick, or empty
        self.valid = False  # whether its demand may be used in this tick

    def take(self, word: Word, number: int, *, stood: bool) -> None:
        """Receive the frame of this number, which counts; in a standstill it is no press."""
        of = self.of
        bypassed = of.bypass is not None and of.bypass.raw(word) == 1
        self.flips += bypassed is not self.bypassed
        self.bypassed = bypassed
        if of.reset is not None:
            reset = of.reset.raw(word) == 1
            if reset and not self.was_reset and not stood:
                self.pressed.press = number
            self.was_reset = reset

    def look(self, now_ns: int) -> None:
        """Find whether the joystick may be used in this tick, and whether its axes have to stop."""
        pressed, lost = self.pressed, self.received.lost(now_ns)
        own = pressed.received is self.received
        gone = pressed.released if own else pressed.off(now_ns)
        for one in self.others:
            gone = gone or one.off(now_ns)
        self.gone = "enable" if gone else ""
        self.valid = not lost and (pressed.on or not own)
