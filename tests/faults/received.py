"""States of the inputs, from the bytes on the bus alone."""

from tests.faults.axis import Axis
from tests.faults.fields import Field
from tests.faults.inputs import Input, Joystick, Switches

LONG_AGO = -(10**15)

# Reasons by their numbers in docs/states.md.
JOYSTICK_TIMEOUT, SWITCH_INVALID, JOYSTICK_FROZEN, JOYSTICK_UNTRUSTED = 32, 37, 39, 40
LOOP_OVERRUN, ENABLE_LOST, SEND_FAILED, LOOP_STALLED = 41, 64, 66, 67
EMERGENCY_STOP, EMERGENCY_STOP_LOST, SECOND_SENDER = 68, 69, 70


class Received:
    """One input: its last good frame by the rules of its protection.

    Attributes:
        word: bits of the last good frame.
        good_ns: when that came.
        refused_ns: when the last one came that was wrong, out of sequence or not yet trusted.
    """

    def __init__(self, source: Input) -> None:
        self.source = source
        self.word = 0
        self.good_ns = self.refused_ns = self._whole_ns = LONG_AGO
        self._count: int | None = None
        self._in_a_row = 0
        self._any_step = True

    def receive(self, data: bytes, now_ns: int) -> str:
        """Take a frame; the counter of the service status that it adds to, or nothing."""
        source = self.source
        if len(data) != source.length:
            return "WrongLength"
        if now_ns - self._whole_ns > source.timeout_ns:  # the sender was away, or started again
            self._any_step = True
            self._in_a_row = 0
        if not source.whole(data):
            self.refused_ns = now_ns
            self._in_a_row = 0
            return "InvalidSignals"
        self._whole_ns = now_ns
        word = int.from_bytes(data, "little")
        # Frames with another value of a multiplexor count in its sequence, and for nothing else.
        others = source.page is not None and source.page.get(word) != source.page_code
        if not others:
            self.whole(word)
        if source.counter:
            count = source.counter.get(word)
            last, self._count = self._count, count
            step = 1 if last is None else (count - last) & source.counter.mask
            if step == 0 or (step > source.max_step and not self._any_step):
                self.refused_ns = self.refused_ns if others else now_ns
                if step:
                    self._in_a_row = 0
                return "InvalidSignals"
            self._any_step = False
        self._in_a_row += 1
        if others:
            return ""
        if self._in_a_row < source.qualify:
            self.refused_ns = now_ns
            return ""
        self.accepted(word, now_ns)
        self.word, self.good_ns = word, now_ns
        return "" if self.valid() else "InvalidSignals"

    def whole(self, word: int) -> None:
        """A frame came whole, be it in sequence or not."""

    def accepted(self, word: int, now_ns: int) -> None:
        """A frame counts; the last one still stands in ``word``."""

    def valid(self) -> bool:
        """Whether the last good frame says something."""
        return True

    def resync(self) -> None:
        """The loop stood still: what was received is too old."""
        self.good_ns = self._whole_ns = LONG_AGO

    def fresh(self, now_ns: int) -> bool:
        return now_ns - self.good_ns <= self.source.timeout_ns


class ReceivedStop(Received):
    """The emergency stop.

    Attributes:
        presses: how many frames so far said stop.
        says_stop: whether one did and none that counts has freed it since.
    """

    def __init__(self, source: Input, signal: Field) -> None:
        super().__init__(source)
        self._signal = signal
        self.presses = 0
        self.says_stop = False

    def whole(self, word: int) -> None:
        """A stop is a stop, whichever message says so."""
        if self._signal.get(word) != 0:
            self.says_stop = True
            self.presses += 1

    def accepted(self, word: int, now_ns: int) -> None:
        self.says_stop = self._signal.get(word) != 0


class ReceivedSwitches(Received):
    """A message with switches that have to agree.

    Attributes:
        releases: how many frames so far said of each that it does not.
        off: whether one did and none that counts has said otherwise since.
    """

    def __init__(self, source: Switches) -> None:
        super().__init__(source)
        self.codes = {source.fields[name]: code for name, code in source.codes.items()}
        self.releases = {field.name: 0 for field in self.codes}
        self.off = dict.fromkeys(self.releases, False)

    def whole(self, word: int) -> None:
        for field, code in self.codes.items():
            if field.get(word) != code:
                self.releases[field.name] += 1
                self.off[field.name] = True

    def accepted(self, word: int, now_ns: int) -> None:
        for field, code in self.codes.items():
            self.off[field.name] = field.get(word) != code


class ReceivedJoystick(Received):
    """A joystick, as its axes may use it.

    Attributes:
        releases: how many frames so far had the enable switch off.
        resets: how many times the reset switch went from 0 to 1.
        presses: by axis, how many times enable went from 0 to 1 in frames that it can use.
    """

    def __init__(self, source: Joystick) -> None:
        super().__init__(source)
        self.joystick = source
        self.releases = self.resets = 0
        self.presses = {a.name: 0 for a in source.axes}
        self._enabled = {a.name: True for a in source.axes}
        self._still_ns = {a.name: LONG_AGO for a in source.axes}
        # by axis: deflection and reason why it is none, of the last good frame
        self.joysticks: dict[str, tuple[float, int]] = {a.name: (0.0, -1) for a in source.axes}
        self._reset = 1
        self._rollers: list[ReceivedJoystick] = []  # which its switch enables too
        self._by: ReceivedJoystick | None = None  # whose switch enables this one
        self._off = False
        self._agree: list[tuple[ReceivedSwitches, str]] = []

    def connect(
        self, joysticks: dict[str, "ReceivedJoystick"], switches: dict[Switches, ReceivedSwitches]
    ) -> None:
        """Know what enables it besides its own switch."""
        self._agree = [(switches[one], signal) for one, signal in self.joystick.agree]
        if by := self.joystick.enabled_by:
            self._by = joysticks[by.name]
            self._by._rollers.append(self)

    @property
    def disagreements(self) -> int:
        """How often another switch was seen not to agree."""
        return sum(one.releases[name] for one, name in self._agree)

    def disagree(self, now_ns: int) -> bool:
        """Whether another switch does not agree, or is lost."""
        lost = self._by is not None and not self._by.fresh(now_ns)
        return lost or any(one.off[n] or not one.fresh(now_ns) for one, n in self._agree)

    def _release(self) -> None:
        self.releases += 1
        self._enabled = dict.fromkeys(self._enabled, False)

    def whole(self, word: int) -> None:
        if (enable := self.joystick.enable) is None:
            return
        if enable.get(word) == 0:  # released is released, whichever message says so
            self._release()
        if enable.get(word) != 1:  # of a joystick that another one's switch enables, any code
            for one in self._rollers:
                one._release()
                one._off = True

    def accepted(self, word: int, now_ns: int) -> None:
        joystick = self.joystick
        enable = 1
        if joystick.enable is not None:
            enable = joystick.enable.get(word)
            for one in self._rollers if enable == 1 else ():
                for name, before in one._enabled.items():
                    one.presses[name] += not before
                    one._enabled[name] = True
                one._off = False
        if joystick.reset:
            reset = joystick.reset.get(word)
            self.resets += reset == 1 and self._reset == 0
            if reset in (0, 1):  # the codes above say nothing
                self._reset = reset
        for axis in joystick.axes:
            command = axis.read(word)
            if command != self.joysticks[axis.name]:
                self.joysticks[axis.name], self._still_ns[axis.name] = command, now_ns
            if joystick.enable and (enable == 0 or (enable == 1 and not command[1])):
                self.presses[axis.name] += enable == 1 and not self._enabled[axis.name]
                self._enabled[axis.name] = enable == 1

    def valid(self) -> bool:
        return self.enable() in (0, 1) and not any(why for _, why in self.joysticks.values())

    def bypasses(self) -> bool:
        """Whether anti-sway is switched off."""
        return self.joystick.off is not None and self.joystick.off.get(self.word) == 1

    def faults(self, axis: Axis, now_ns: int) -> set[int]:
        """Every reason why the joystick of this axis cannot be used now; empty when it can."""
        if not self.fresh(now_ns):
            faults = {JOYSTICK_TIMEOUT}
            if now_ns - self.refused_ns <= self.source.timeout_ns:
                faults = {JOYSTICK_UNTRUSTED}
            return faults
        joystick, why = self.joysticks[axis.name]
        faults = {why} if why else set()
        if self.enable() not in (0, 1):
            faults.add(SWITCH_INVALID)
        still_ns = now_ns - self._still_ns[axis.name]
        if not faults and still_ns > self.joystick.frozen_ns and abs(joystick) > axis.band:
            faults.add(JOYSTICK_FROZEN)
        return faults

    def enable(self) -> int:
        """The enable switch in the last good frame."""
        enable = self.joystick.enable
        return int(not self._off) if enable is None else enable.get(self.word)
