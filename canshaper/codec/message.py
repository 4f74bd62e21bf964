"""A message with its protection: building the frames that we send, checking those received.

Protection is an alive counter and a checksum, or a profile of AUTOSAR E2E. The counter is judged by
the rule of E2E: a step of 1 up to a largest step is good (frames may be lost), a step of 0 is a
repetition without news, a larger step is a wrong sequence.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from cantools.database.can import Message, Signal

from canshaper.codec.frame import Frame, FrameFault, new_frame, with_source
from canshaper.codec.layout import Layout, is_j1939
from canshaper.codec.signals import raw_limits

if TYPE_CHECKING:
    from canshaper.checksums.kinds import Checksum
    from canshaper.codec.e2e import E2e

# Two frames may be lost in a row; more is no longer the noise of a bus.
USUAL_MAX_STEP = 3
GOOD = FrameFault.NONE  # by way of the class it takes ten times as long


@dataclass(frozen=True, slots=True)
class Protection:
    """Protection of one message of the deployment.

    Attributes:
        counter: name of the alive counter's signal; None without one, and for E2E.
        counts: number of values of the counter, the signal's or E2E's; 0 without a counter.
        check: checksum or E2E profile that protects the content.
    """

    counter: str | None = None
    counts: int = 0
    check: "Checksum | E2e | None" = None


UNPROTECTED = Protection()


class FieldSet:
    """Converts physical to raw values of one message and back, and has the start values.

    A start value is GenSigStartValue; without one 0, of a J1939 integer all bits 1 (unavailable).

    Attributes:
        message: the message.
        layout: encodes and decodes its signals.
        start: raw start value of every signal, by name.
    """

    def __init__(self, message: Message) -> None:
        self.message = message
        self.layout = Layout(message)
        self.start: dict[str, Any] = {
            s.name: self._start(s, is_j1939(message)) for s in message.signals
        }
        self._fields = {
            s.name: (s.scale, s.offset, *raw_limits(s)) for s in message.signals if not s.is_float
        }

    @staticmethod
    def _start(signal: Signal, all_ones: bool) -> int | float:
        """Return the raw start value, clamped to the bits of an integer signal."""
        if signal.is_float:
            return float(signal.raw_initial or 0.0)
        low, high = raw_limits(signal)
        if all_ones and signal.raw_initial is None:
            return -1 if signal.is_signed else high
        return min(max(int(signal.raw_initial or 0), low), high)

    def raw(self, name: str, value: float) -> int:
        """Return the raw value of an integer signal nearest to ``value``, clamped to its bits.

        It is clamped, not refused: a status beyond its range shall still be seen.
        """
        scale, offset, low, high = self._fields[name]
        return min(max(round((value - offset) / scale), low), high)

    def value(self, name: str, raw: float) -> float:
        """Return the value of an integer signal's raw value, in the unit of the DBC."""
        scale, offset, _, _ = self._fields[name]
        return raw * scale + offset


class SentMessage:
    """One message that we send; it does not change after the deployment is bound.

    Args:
        bus: name of the bus.
        message: definition of the message in the DBC.
        source: source address of a J1939 message, instead of that of the DBC.
        protection: protection of its frames.

    Attributes:
        key: bus, id, and whether the id is extended.
        fields: signals of the message.
        protection: protection of its frames.
        rewrites: whether its frames are a joystick's on their way through a gateway.
        start: initial raw value of every signal; binding a valve codec puts neutral in.
    """

    rewrites = False

    def __init__(
        self,
        bus: str,
        message: Message,
        source: int | None = None,
        protection: Protection = UNPROTECTED,
    ) -> None:
        can_id = message.frame_id
        if source is not None and is_j1939(message):
            can_id = with_source(can_id, source)
        self.key = bus, can_id, message.is_extended_frame
        self.fields = FieldSet(message)
        self.protection = protection
        self.start: dict[str, Any] = dict(self.fields.start)

    def sender(self) -> "Sender":
        """Return a new sender of this message, with the counter at its first value."""
        return Sender(self)


class Sender:
    """Builds the successive frames of one message, each with the next count and its checksum.

    Attributes:
        key: bus, id, and whether the id is extended.
        fields: signals of the message.
        raw: raw value of every signal; valve codecs and other writers change it in place.
    """

    def __init__(self, message: SentMessage) -> None:
        self.key, self.fields = message.key, message.fields
        self._bus, self._id, self._extended = message.key  # quicker than to unpack it each time
        protection = message.protection
        self._counter, self._counts = protection.counter, protection.counts
        self._check = protection.check
        self._encode = message.fields.layout.encode
        self._count = 0
        self.raw = dict(message.start)

    def frame(self, values: Mapping[str, Any] | None = None) -> Frame:
        """Return the next frame.

        Args:
            values: raw values for this frame alone, by signal.

        Raises:
            OverflowError: a value does not fit into the bits of its signal.
        """
        raw = {**self.raw, **values} if values else self.raw
        if self._counts:
            self._count = (self._count + 1) % self._counts
            if self._counter is not None:
                raw[self._counter] = self._count
        data = self._encode(raw)
        if self._check is not None:
            data = self._check.protect(data, self._count)
        return new_frame(Frame, (self._bus, self._id, self._extended, data))

    def take_back(self) -> None:
        """Reuse the count of the last frame, which did not leave, for the next one."""
        self._count = (self._count - 1) % self._counts if self._counts else 0

    def instead(self, frame: Frame) -> Frame:
        """Return the last frame, which was not sent, again: same count, present raw values."""
        self.take_back()
        return self.frame()

    def copy_state(self, before: Self) -> None:
        """Continue the count of ``before`` if its counter has as many values; else keep the own."""
        if self._counts == before._counts:
            self._count = before._count


class SequenceChecker:
    """Checks the sequence and the content of the received frames of one message.

    Args:
        protection: protection of the message.
        max_step: largest good step of the counter; None: 3, or half of its values if less.
        qualify: good frames in a row that are needed at the start and after a wrong one.

    Attributes:
        max_step: largest good step of the counter.
        qualified: whether the last good frame may be used: enough have come in a row.
    """

    def __init__(self, protection: Protection, max_step: int | None, qualify: int) -> None:
        self._protection = protection
        self._range = protection.counts
        self.max_step = max_step or min(USUAL_MAX_STEP, protection.counts // 2)
        self._check = protection.check
        # Without a signal of its own, the counter is the one in the header of E2E.
        self._header: Any = None if protection.counter else protection.check
        self._qualify = qualify
        self._last: int | None = None
        self._resynced = True
        self._good = 0
        self.qualified = False

    def copy_state(self, before: Self) -> None:
        """Continue the sequence of ``before``, if the protection of the message is unchanged."""
        if self._protection == before._protection:
            self._last, self._resynced, self._good = before._last, before._resynced, before._good
            self.qualified = self._good >= self._qualify

    def resync(self) -> None:
        """After silence, accept any next count but a repeated one, and count good frames from 0."""
        self._resynced = True
        self._requalify()

    def check(self, data: bytes, count: int) -> FrameFault:
        """Check a frame of the right length; return its fault, ``NONE`` without one.

        Args:
            data: bytes of the frame.
            count: value of the alive counter's signal; unused with E2E, whose header has a counter.
        """
        if self._check is not None and not self._check.verify(data):
            self._requalify()
            return FrameFault.CHECKSUM
        if self._range:
            if self._header is not None:
                count = self._header.count(data)
            last = self._last
            self._last = count
            if last is not None:
                step = (count - last) % self._range
                if step == 0:
                    return FrameFault.COUNTER_REPEATED
                if step > self.max_step and not self._resynced:
                    self._requalify()
                    return FrameFault.COUNTER_JUMP
            self._resynced = False
        if not self.qualified:
            self._good += 1
            self.qualified = self._good >= self._qualify
        return GOOD

    def _requalify(self) -> None:
        self._good = 0
        self.qualified = False
