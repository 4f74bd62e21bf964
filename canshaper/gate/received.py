"""The gate's memory of received frames: messages, switches, joysticks.

Bad news counts in every frame with the right length and checksum, however short; good news only in
one that is in sequence too.
"""

from collections.abc import Sequence

from canshaper.gate.fields import Word
from canshaper.gate.record import Joystick, Message, Switch

NEVER = -(1 << 62)


class Pending:
    """Reasons to stop that were received since an axis had its turn last, however short.

    Attributes:
        hard: a reason to stop at once; ``latches`` whether one was that latches at rest too.
        lost: its joystick was another one meanwhile.
    """

    def __init__(self) -> None:
        self.hard, self.latches, self.lost = "", False, False


class Received:
    """One message: is it whole, right, in sequence, and how old is it?

    Attributes:
        good_ns: when the last frame came that counts; None where none does.
        intact_ns: when the last frame with the right checksum came.
        count: its alive counter.
        good: how many good ones came in a row.
        any_count: after silence the next counter may be any but the last one.
        waiting: a frame that counts has come and was not passed on; of a gateway.
        source, source_ns: of a message from any address, the one that counts, and its last frame.
        switches, joysticks: what is in it; ``axes`` what that moves.
    """

    def __init__(self, message: Message) -> None:
        self.of = message
        self.good_ns: int | None = None
        self.intact_ns: int | None = None
        self.count: int | None = None
        self.good = 0
        self.any_count = True
        self.waiting = False
        self.source, self.source_ns = -1, NEVER
        self.switches: list[SwitchState] = []
        self.joysticks: list[JoystickState] = []
        self.axes: list[Pending] = []

    def take(self, data: bytes, word: Word, now_ns: int) -> tuple[bool, bool]:
        """Whether a frame says anything, and whether it counts."""
        of = self.of
        if len(data) != of.length:
            return False, False
        other = of.page is not None and of.page[0].raw(word) != of.page[1]
        if other and of.alone:
            return False, False
        if self.intact_ns is None or now_ns - self.intact_ns > of.timeout_ns:
            self.any_count, self.good = True, 0
        if not of.protection.right(data):
            self.good = 0
            return False, False
        self.intact_ns = now_ns
        if of.protection.counts and not self._next(data, word):
            return not other, False
        if self.good < of.qualify:
            self.good += 1
        if other or self.good < of.qualify:
            return not other, False
        self.good_ns, self.waiting = now_ns, True
        return True, True

    def _next(self, data: bytes, word: Word) -> bool:
        """Whether the alive counter is the next one."""
        of = self.of.protection
        last, self.count = self.count, of.count(data, word)
        step = 1 if last is None else (self.count - last) % of.counts
        if step == 0:
            return False
        if step > self.of.most_step and not self.any_count:
            self.good = 0
            return False
        self.any_count = False
        return True

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
        self.good_ns = self.intact_ns = None

    def carry_over(self, before: "Received", *, missed: bool) -> None:
        """Go on where the same message was before a reload; its values have to come again.

        Args:
            before: that message.
            missed: its bus was closed meanwhile.
        """
        self.source, self.source_ns = before.source, before.source_ns
        self.intact_ns = None if missed else before.intact_ns
        if self.of.protection == before.of.protection:
            self.count, self.any_count, self.good = before.count, before.any_count, before.good
        released = {(one.of.field, one.of.on) for one in before.switches if one.released}
        for switch in self.switches:
            switch.released = switch.was_off = (switch.of.field, switch.of.on) in released


class SwitchState:
    """One switch, as it was seen.

    Attributes:
        why: what it is, for the log; ``latches`` whether it latches at rest too.
        axes: what it stops.
        released: by the last frame that says so or, if it counts, otherwise.
        was_off: it was seen released since it was pressed last.
    """

    def __init__(self, switch: Switch, received: Received, why: str, *, latches: bool) -> None:
        self.of, self.received, self.why, self.latches = switch, received, why, latches
        self.axes: Sequence[Pending] = ()
        self.released = self.was_off = False

    def see(self, word: Word, *, counts: bool) -> bool:
        """Take a frame; whether it is pressed in it."""
        raw, of = self.of.field.raw(word), self.of
        if raw == 0 if of.only_zero else raw != of.on:
            self.released = self.was_off = True
            for axis in self.axes:
                axis.hard = self.why
                axis.latches = axis.latches or self.latches
        elif counts:
            self.released = False
            if self.was_off and raw == of.on:
                self.was_off = False
                return True
        return False

    def off(self, now_ns: int) -> bool:
        """Whether it does not agree now, or is not known to."""
        return self.released or self.received.lost(now_ns)


class JoystickState:
    """One joystick, and the switches that enable it; the first one is the one that is pressed.

    Attributes:
        press: ticks that were made before enable or reset was pressed last.
        enabled: its own switch was on in the last frame that counts.
        bypassed: anti-sway was off in it; ``flips`` how often that has changed.
        gone: why nothing that it moves may move in this tick, at once.
        valid: it may be used in this tick.
    """

    def __init__(
        self, joystick: Joystick, received: Received, switches: Sequence[SwitchState]
    ) -> None:
        self.of, self.received = joystick, received
        self.pressed, *self.others = switches
        self.was_reset = True
        self.press, self.flips = NEVER, 0
        self.enabled = self.bypassed = self.valid = False
        self.gone = ""

    def take(self, word: Word, made: int, *, stood: bool) -> None:
        """A frame of it that counts. One that has waited in a standstill is no press."""
        of = self.of
        self.enabled = not of.own or of.pressed.field.raw(word) == 1
        bypassed = of.bypass is not None and of.bypass.raw(word) == 1
        self.flips += bypassed is not self.bypassed
        self.bypassed = bypassed
        if of.reset is not None:
            reset = of.reset.raw(word) == 1
            if reset and not self.was_reset and not stood:
                self.press = made
            self.was_reset = reset

    def look(self, now_ns: int) -> None:
        """Find whether it may be used in this tick."""
        pressed = self.pressed
        gone = pressed.released or (not self.of.own and pressed.received.lost(now_ns))
        for one in self.others:
            gone = gone or one.off(now_ns)
        self.gone = "enable" if gone else ""
        self.valid = self.enabled and not self.received.lost(now_ns)
