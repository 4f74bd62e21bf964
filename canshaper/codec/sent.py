"""A message that we send: its place on the bus, what is in it now, and its protection."""

from collections.abc import Mapping
from typing import Any

from cantools.database.can import Message

from canshaper.codec.frame import Frame, new_frame
from canshaper.codec.identifier import with_source
from canshaper.codec.layout import is_j1939
from canshaper.codec.protection import UNPROTECTED, Protection, Protector
from canshaper.codec.signals import FieldSet


class SentMessage:
    """One message, of which every frame is the next one.

    Args:
        bus: name of the bus.
        message: its definition.
        source: source address, for messages of J1939 instead of that of the DBC.
        protection: that of its frames.

    Attributes:
        key: bus, id and whether that is extended.
        fields: its signals.
        protection: that of its frames.
        protector: its counter.
        raw: raw value of every signal, changed by who has something to say.
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
        self.protector = protector = Protector(protection, self.fields.layout)
        # Where there is nothing to protect: a call less on the way of every frame.
        self._next = protector.protect if protection.check else protector.without_check
        self.raw: dict[str, Any] = dict(self.fields.start)

    def frame(self, values: Mapping[str, Any] | None = None) -> Frame:
        """The next frame, protected.

        Args:
            values: raw values that are put in first, by signal.
        """
        if values:
            self.raw.update(values)
        return new_frame(Frame, (*self.key, self._next(self.raw)))

    def instead(self, frame: Frame) -> Frame:
        """What takes the place of the last frame, which was not sent: with the same count."""
        self.protector.take_back()
        return self.frame()
