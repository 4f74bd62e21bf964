"""A joystick's message on its way through a gateway: ours in it are the velocities, no more."""

from typing import Any

from cantools.database.can import Message, Signal

from canshaper.codec.frame import Frame, new_frame
from canshaper.codec.protection import Protection
from canshaper.codec.sent import Sender, SentMessage
from canshaper.codec.signals import named_fault, raw_limits


class RewrittenMessage(SentMessage):
    """The message of a joystick as it leaves on the other bus.

    Args:
        bus: name of that bus.
        message: its definition.
        source: its source address, where it is one of J1939.
        protection: that of its frames, computed again.
        enable: name of its enable switch.
        ours: names of the signals that the axes put in.

    Attributes:
        start: raw value of every signal: neutral in those of the axes, in all others what a frame
            of our own says, which is nothing: rest, or "not available".
        enable: name of its enable switch.
        ours: names of the signals that the axes put in.
        ours_mask: bits of the velocities, byte 0 the lowest.
        mask_of_all: the same with those of the alive counter.
    """

    def __init__(
        self,
        bus: str,
        message: Message,
        source: int | None,
        protection: Protection,
        *,
        enable: str,
        ours: frozenset[str],
    ) -> None:
        super().__init__(bus, message, source, protection)
        self.ours, self.enable = ours, enable
        for signal in message.signals:
            self.start[signal.name] = _at_rest(signal, self.start[signal.name])
        self.ours_mask = self._mask(ours)
        counter = protection.counter
        self.mask_of_all = self.ours_mask | (self._mask({counter}) if counter else 0)

    def _mask(self, names: frozenset[str] | set[str]) -> int:
        """Bits of these signals."""
        zeros: dict[str, Any] = dict.fromkeys(self.start, 0)
        message, layout = self.fields.message, self.fields.layout
        ones = {
            s.name: -1 if s.is_signed else raw_limits(s)[1]
            for s in message.signals
            if s.name in names
        }
        low, high = (layout.encode({**zeros, **some}) for some in ({}, ones))
        return int.from_bytes(low, "little") ^ int.from_bytes(high, "little")

    def neutral_bits(self) -> int:
        """The velocities of a machine that stands, byte 0 the lowest."""
        return int.from_bytes(self.fields.layout.encode(self.start), "little") & self.ours_mask

    def sender(self) -> "RewritingSender":
        """Make its sender, with the counter at the beginning."""
        return RewritingSender(self)


class RewritingSender(Sender):
    """Sends it: in the place of frames of the joystick, and where none comes."""

    def __init__(self, message: RewrittenMessage) -> None:
        super().__init__(message)
        self._mask, self._length = message.mask_of_all, message.fields.message.length
        self._enable, self._start = message.enable, message.fields.start[message.enable]

    def onto(self, data: bytes) -> Frame:
        """The next frame: this one of the joystick with our velocities, protected again."""
        ours = int.from_bytes(self.protector.without_check(self.raw), "little") & self._mask
        word = int.from_bytes(data, "little") & ~self._mask | ours
        protected = self.protector.add_check(word.to_bytes(self._length, "little"))
        return new_frame(Frame, (*self.key, protected))

    def instead(self, frame: Frame) -> Frame:
        """The same frame with what the axes have put in now, and with the same count."""
        self.protector.take_back()
        return self.onto(frame.data)

    def own(self, *, enabled: bool) -> Frame:
        """The next frame without one of the joystick: nothing in it is older than the axes."""
        self.raw[self._enable] = 1 if enabled else self._start
        return self.frame()


def _at_rest(signal: Signal, start: Any) -> Any:
    """Raw value that asks for nothing: the start value, and no velocity but 0."""
    low, high = signal.minimum, signal.maximum
    name = str((signal.choices or {}).get(start, ""))
    if low is None or high is None or not low < 0 < high or named_fault(name):
        return start
    rest = 0.0 - signal.offset / signal.scale
    return rest if signal.is_float else round(rest)
