"""Codec of a joystick, and the messages that we send."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from cantools.database.can import Message

from canshaper.codec.flags import FlaggedVelocity, RockerVelocity
from canshaper.codec.frame import Frame, new_frame
from canshaper.codec.identifier import with_source
from canshaper.codec.layout import Layout, is_j1939
from canshaper.codec.protection import UNPROTECTED, Protection, Protector
from canshaper.codec.signals import FieldSet, VelocitySignal
from canshaper.errors import WrongLengthError
from canshaper.shaping.states import Reason


class Chosen(NamedTuple):
    """Which frames of a multiplexed message are meant.

    Attributes:
        signal: the multiplexor.
        value: raw, of the frames that are meant.
        alone: whether alive counter or checksum are in these only.
    """

    signal: str
    value: int
    alone: bool


class JoystickCodec:
    """Joystick message to raw values and switches.

    Args:
        message: the message.
        velocities: the signals that move axes.
        chosen: which frames are meant, where the message is multiplexed.
    """

    def __init__(
        self,
        message: Message,
        velocities: Sequence[VelocitySignal | FlaggedVelocity | RockerVelocity],
        chosen: Chosen | None = None,
    ) -> None:
        self.chosen = chosen
        self._length = message.length
        self._layout = Layout(message)
        self._velocities = velocities

    def decode(self, data: bytes) -> tuple[dict[str, Any], dict[str, float | Reason]]:
        """Decode one frame.

        Returns:
            (raw values of all signals, command or fault of every velocity signal); no command of
            frames that are not meant.

        Raises:
            WrongLengthError: the length is not that of the message.
        """
        if len(data) != self._length:
            raise WrongLengthError
        raw = self._layout.decode(data)
        commands: dict[str, float | Reason] = {}
        if self.chosen is not None and raw[self.chosen.signal] != self.chosen.value:
            return raw, commands
        for velocity in self._velocities:
            commands[velocity.name] = velocity.read(raw)
        return raw, commands


class Sender:
    """A message we send: its place on the bus and its fields.

    Args:
        bus: name of the bus.
        message: its definition.
        source: source address, for messages of J1939 instead of that of the DBC.
        protection: that of its frames.
    """

    def __init__(
        self,
        bus: str,
        message: Message,
        source: int | None = None,
        protection: Protection = UNPROTECTED,
    ) -> None:
        self._bus = bus
        self._id = message.frame_id
        if source is not None and is_j1939(message):
            self._id = with_source(message.frame_id, source)
        self._extended = message.is_extended_frame
        self.fields = FieldSet(message)
        self.protection = protection
        self.protector = Protector(protection, self.fields.layout)

    @property
    def key(self) -> tuple[str, int, bool]:
        """Bus, id and whether that is extended."""
        return self._bus, self._id, self._extended

    def frame(self, raw: dict[str, int]) -> Frame:
        """The next frame, protected, with these raw values."""
        data = self.protector.protect({**self.fields.start, **raw})
        return new_frame(Frame, (self._bus, self._id, self._extended, data))
