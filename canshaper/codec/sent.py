"""A message that we send: as it is bound, and at work in one controller."""

from collections.abc import Mapping
from typing import Any

from cantools.database.can import Message

from canshaper.codec.frame import Frame, new_frame
from canshaper.codec.identifier import with_source
from canshaper.codec.layout import is_j1939
from canshaper.codec.protection import UNPROTECTED, Protection, Protector
from canshaper.codec.signals import FieldSet


class SentMessage:
    """One message as it is bound; nothing of it changes afterwards.

    Args:
        bus: name of the bus.
        message: its definition.
        source: source address, for messages of J1939 instead of that of the DBC.
        protection: that of its frames.

    Attributes:
        key: bus, id and whether that is extended.
        fields: its signals.
        protection: that of its frames.
        start: raw value of every signal at first; valve codecs put neutral in while they are bound.
    """

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
        """Make its sender, with the counter at the beginning."""
        return Sender(self)


class Sender:
    """Sends one message: every frame is the next one.

    Attributes:
        key: bus, id and whether that is extended.
        fields: its signals.
        protector: its counter.
        raw: raw value of every signal, changed by those who put values in.
    """

    def __init__(self, message: SentMessage) -> None:
        self.key, self.fields = message.key, message.fields
        self._bus, self._id, self._extended = message.key  # quicker than to unpack it each time
        self.protector = protector = Protector(message.protection, message.fields.layout)
        # Where there is nothing to protect: a call less on the way of every frame.
        self._next = protector.protect if message.protection.check else protector.without_check
        self.raw = dict(message.start)

    def frame(self, values: Mapping[str, Any] | None = None) -> Frame:
        """Return the next frame, protected.

        Args:
            values: raw values for this frame alone, by signal.
        """
        raw = {**self.raw, **values} if values else self.raw
        return new_frame(Frame, (self._bus, self._id, self._extended, self._next(raw)))

    def instead(self, frame: Frame) -> Frame:
        """Make the frame in the place of the last one, which was not sent: with the same count."""
        self.protector.take_back()
        return self.frame()
