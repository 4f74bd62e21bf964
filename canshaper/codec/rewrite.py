"""A joystick's message on its way through a gateway: ours in it are the velocities, no more."""

from typing import Any

from cantools.database.can import Signal

from canshaper.codec.codecs import Sender
from canshaper.codec.frame import Frame, new_frame
from canshaper.codec.signals import named_fault, raw_limits
from canshaper.codec.valve import ValveMessage


class RewrittenMessage(ValveMessage):
    """The message of a joystick as it leaves on the other bus.

    Args:
        sender: its place on that bus, and its protection, which is computed again.
        enable: name of its enable switch.
        ours: names of the signals that the axes put in.

    Attributes:
        raw: raw value of every signal: in those of the axes what they put, in all others what a
            frame of our own says, which is nothing: rest, or "not available".
        ours_mask: bits of the velocities, byte 0 the lowest.
    """

    def __init__(self, sender: Sender, enable: str, ours: frozenset[str]) -> None:
        super().__init__(sender)
        self.ours = ours
        self._enable = enable
        self._protector = sender.protector
        self._layout = sender.fields.layout
        self._start = sender.fields.start[enable]
        message = sender.fields.message
        self._length = message.length
        for signal in message.signals:
            self.raw[signal.name] = _at_rest(signal, self.raw[signal.name])
        self.ours_mask = self._mask(ours)
        counter = sender.protection.counter
        self._mask_of_all = self.ours_mask | (self._mask({counter}) if counter else 0)

    def _mask(self, names: frozenset[str] | set[str]) -> int:
        """Bits of these signals."""
        zeros: dict[str, Any] = dict.fromkeys(self.raw, 0)
        message = self.sender.fields.message
        ones = {
            s.name: -1 if s.is_signed else raw_limits(s)[1]
            for s in message.signals
            if s.name in names
        }
        low, high = (self._layout.encode({**zeros, **some}) for some in ({}, ones))
        return int.from_bytes(low, "little") ^ int.from_bytes(high, "little")

    def neutral_bits(self) -> int:
        """The velocities of a machine that stands, byte 0 the lowest; for the axes at rest."""
        return int.from_bytes(self._layout.encode(self.raw), "little") & self.ours_mask

    def onto(self, data: bytes) -> Frame:
        """The next frame: this one of the joystick with our velocities, protected again."""
        ours = int.from_bytes(self._protector.without_check(self.raw), "little") & self._mask_of_all
        word = int.from_bytes(data, "little") & ~self._mask_of_all | ours
        protected = self._protector.add_check(word.to_bytes(self._length, "little"))
        return new_frame(Frame, (self.bus, self._id, self._extended, protected))

    def instead(self, frame: Frame) -> Frame:
        """The same frame with what the axes have put in now, and with the same count."""
        self._protector.take_back()
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
