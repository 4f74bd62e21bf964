"""Codecs of a joystick and of the status messages."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from cantools.database.can import Message

from canshaper.codec.flags import FlaggedVelocity, RockerVelocity
from canshaper.codec.frame import Frame, FrameFault
from canshaper.codec.j1939 import with_source
from canshaper.codec.layout import Layout, is_j1939
from canshaper.codec.protection import UNPROTECTED, Protection, Protector
from canshaper.codec.signals import FieldSet, VelocitySignal
from canshaper.shaping.states import Reason, State

DIGEST_BITS = 16


class WrongLengthError(Exception):
    """A frame is shorter or longer than its message in the DBC."""


class JoystickCodec:
    """Joystick message to raw values and switches."""

    def __init__(
        self,
        message: Message,
        velocities: Sequence[VelocitySignal | FlaggedVelocity | RockerVelocity],
    ) -> None:
        self._length = message.length
        self._layout = Layout(message)
        self._velocities = velocities

    def decode(self, data: bytes) -> tuple[dict[str, Any], dict[str, float | Reason]]:
        """Decode one frame.

        Returns:
            (raw values of all signals, command or fault of every velocity signal).

        Raises:
            WrongLengthError: the length is not that of the message.
        """
        if len(data) != self._length:
            raise WrongLengthError
        raw = self._layout.decode(data)
        commands: dict[str, float | Reason] = {}
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
        return Frame(self._bus, self._id, self._extended, data)


ACTIVE_SET = "ActiveSet"


@dataclass(frozen=True, slots=True)
class AxisStatusCodec:
    """Status message of an axis."""

    sender: Sender
    SIGNALS = ("State", "Reason", "RawCommand", "ShapedCommand", "PredictedSway")
    CODES: ClassVar[dict[str, int]] = {"State": max(State), "Reason": max(Reason)}

    def frame(
        self,
        state: State,
        reason: Reason,
        command: float,
        sent: float,
        sway_deg: float,
        *,
        active_set: int = 0,
    ) -> Frame:
        """Status frame; command and sent in [-1, 1].

        The signal ActiveSet need not be there.
        """
        fields = self.sender.fields
        raw = {
            "State": int(state),
            "Reason": int(reason),
            "RawCommand": fields.raw("RawCommand", 100.0 * command),
            "ShapedCommand": fields.raw("ShapedCommand", 100.0 * sent),
            "PredictedSway": fields.raw("PredictedSway", sway_deg),
        }
        if ACTIVE_SET in fields.start:
            raw[ACTIVE_SET] = fields.raw(ACTIVE_SET, active_set)
        return self.sender.frame(raw)


@dataclass(frozen=True, slots=True)
class IdentityCodec:
    """Message with the digest of what runs."""

    sender: Sender
    SIGNALS = ("Digest",)
    CODES: ClassVar[dict[str, int]] = {"Digest": (1 << DIGEST_BITS) - 1}

    def frame(self, digest: int) -> Frame:
        """The frame with this digest."""
        return self.sender.frame({"Digest": digest})

    def digest(self, data: bytes) -> int | None:
        """The digest in a frame; None where its length is wrong."""
        layout = self.sender.fields.layout
        return int(layout.decode(data)["Digest"]) if len(data) == layout.length else None


@dataclass(frozen=True, slots=True)
class ServiceStatusCodec:
    """Status message of the whole service: counters that stop at their largest value."""

    sender: Sender
    SIGNALS = (
        "LastFault",
        "MissedDeadlines",
        "WrongLength",
        "UnknownId",
        "ErrorFrames",
        "InvalidSignals",
        "SendFailures",
    )
    CODES: ClassVar[dict[str, int]] = {"LastFault": max(FrameFault)}

    def frame(self, values: dict[str, int]) -> Frame:
        """Status frame from the counters by signal name."""
        fields = self.sender.fields
        return self.sender.frame({name: fields.raw(name, values[name]) for name in self.SIGNALS})
