"""The gate's memory of received frames: messages, switches, joysticks.

Bad news counts in every frame with the right length and checksum, however short; good news only in
one that is in sequence too.
"""

from collections.abc import Sequence

from canshaper.gate.fields import Word
from canshaper.gate.record import Axis, Joystick, Message, Switch

NEVER = -(1 << 62)


class AxisInput:
    """Input of an axis: its demand, and each reason to stop since its last turn, however short.

    Attributes:
        demand: of the last joystick frame that counts, and ``changed_ns`` since when.
        foreign_ns: when a second sender was received last.
        hard: a reason to stop at once; ``latches`` whether one was that latches at rest too.
        lost: its joystick was another one meanwhile.
    """

    __slots__ = ("changed_ns", "demand", "foreign_ns", "hard", "latches", "lost", "of")

    def __init__(self, axis: Axis) -> None:
        self.of = axis
        self.demand: float | None = None
        self.changed_ns, self.foreign_ns = 0, NEVER
        self.hard, self.latches, self.lost = "", False, False

    def take(self, word: Word, now_ns: int) -> None:
        """Take a frame of its joystick that counts."""
        demand = self.of.stick.demand(word)
        if demand != self.demand:
            self.demand, self.changed_ns = demand, now_ns


class Received:
    """One message: is it whole, right, in sequence, and how old is it?"""

    def __init__(self, message: Message) -> None:
        self.of = message
        self.good_ns: int | None = None  # when the last frame came that counts
        self.intact_ns = NEVER  # when the last one came with the right checksum
        self.count: int | None = None  # its alive counter
        self.any_count = True  # after silence the next one may be any but that
        self.good = 0  # good ones in a row
        self.waiting = False  # of a gateway: one that counts has come and was not passed on
        # Of a message from any address, the one that counts, and its last frame.
        self.source, self.source_ns = -1, NEVER
        self.switches: list[SwitchState] = []  # in it, as the joystick
        self.joystick: JoystickState | None = None
        self.axes: list[AxisInput] = []  # that this moves

    def take(self, data: bytes, word: Word, now_ns: int) -> tuple[bool, bool]:
        """Whether a frame says anything, and whether it counts."""
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
        """Whether another address sends this message while the first one does; see J1939."""
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
        """Whether it is not known what it says now."""
        return self.good_ns is None or now_ns - self.good_ns > self.of.timeout_ns

    def forget(self) -> None:
        """Nothing received so far counts."""
        self.good_ns, self.intact_ns = None, NEVER

    def carry_over(self, before: "Received", *, missed: bool) -> None:
        """Go on where it was before a reload; ``missed`` where its bus was closed meanwhile."""
        self.source, self.source_ns = before.source, before.source_ns
        self.intact_ns = NEVER if missed else before.intact_ns
        if self.of.protection == before.of.protection:
            self.count, self.any_count, self.good = before.count, before.any_count, before.good
        released = {(one.of.field, one.of.on) for one in before.switches if one.released}
        for switch in self.switches:
            switch.released = switch.was_off = (switch.of.field, switch.of.on) in released


class SwitchState:
    """One switch, as it was seen, and the axes that it stops."""

    def __init__(
        self, switch: Switch, received: Received, axes: Sequence[AxisInput], *, emergency: bool
    ) -> None:
        self.of, self.received, self.axes = switch, received, axes
        self.emergency = emergency  # it latches at rest too
        self.on = False  # it agrees in the last frame that counts
        self.released = False  # by the last frame that says so or, if it counts, otherwise
        self.was_off = False  # it was seen released since it was pressed last
        self.press = NEVER  # ticks that were made before that, or before reset was

    def take(self, word: Word, made: int, *, counts: bool, stood: bool) -> None:
        """Take a frame. One that has waited in a standstill is no press."""
        of = self.of
        raw = of.field.raw(word)
        on = raw == of.on
        if counts:
            self.on = on
        if raw == 0 if of.only_zero else not on:
            self.released = self.was_off = True
            for axis in self.axes:
                axis.hard = "emergency stop" if self.emergency else "enable"
                axis.latches = axis.latches or self.emergency
        elif counts:
            self.released = False
            if on and self.was_off:
                self.was_off = False
                if not stood:
                    self.press = made

    def off(self, now_ns: int) -> bool:
        """Whether it does not agree now, or is not known to."""
        return self.released or self.received.lost(now_ns)


class JoystickState:
    """One joystick, and the switches that enable it; the first one is the one that is pressed."""

    def __init__(self, joystick: Joystick, received: Received, *switches: SwitchState) -> None:
        self.of, self.received = joystick, received
        self.pressed, *self.others = switches
        self.was_reset = True
        self.bypassed, self.flips = False, 0  # anti-sway was off; how often that has changed
        self.gone = ""  # why nothing that it moves may move in this tick, at once
        self.valid = False  # it may be used in this tick

    def take(self, word: Word, made: int, *, stood: bool) -> None:
        """Take a frame of it that counts. One that has waited in a standstill is no press."""
        of = self.of
        bypassed = of.bypass is not None and of.bypass.raw(word) == 1
        self.flips += bypassed is not self.bypassed
        self.bypassed = bypassed
        if of.reset is not None:
            reset = of.reset.raw(word) == 1
            if reset and not self.was_reset and not stood:
                self.pressed.press = made
            self.was_reset = reset

    def look(self, now_ns: int) -> None:
        """Find whether it may be used in this tick."""
        pressed, lost = self.pressed, self.received.lost(now_ns)
        own = pressed.received is self.received
        gone = pressed.released if own else pressed.off(now_ns)
        for one in self.others:
            gone = gone or one.off(now_ns)
        self.gone = "enable" if gone else ""
        self.valid = not lost and (pressed.on or not own)
