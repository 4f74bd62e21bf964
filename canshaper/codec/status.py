"""Status messages: which fields they have, and how each is encoded and decoded.

A field is declared once, in a table below; a message carries those fields that its DBC has. To send
another field, add a line to the table: it is then sent where a DBC has the signal, decoded by every
reader of status messages, and required by none. A field of an axis reads an attribute of
``AxisControl``, one of the aim an attribute of ``AimPoint``.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import IntEnum
from operator import attrgetter, itemgetter
from typing import Any, Generic, TypeVar

from cantools.database.can import Message

from canshaper.codec.frame import FrameFault
from canshaper.codec.message import SentMessage
from canshaper.codec.signals import raw_limits
from canshaper.shaping.states import Reason, State, Trust

DIGEST_BITS = 16

Source = TypeVar("Source")


@dataclass(frozen=True, slots=True)
class StatusField(Generic[Source]):
    """One field of a status message.

    Attributes:
        name: name of its signal in the DBC.
        encode: returns the value for a source (such as an axis): in the DBC's unit, or a code.
        decode: converts that value to the one that is shown.
        required: whether a message without this signal is refused.
        largest: largest code of a field whose raw value is a code; None for a measurement.
        meaning: meaning and unit, for docs/states.md.
    """

    name: str
    encode: Callable[[Source], float]
    decode: Callable[[Any], Any] = float
    required: bool = False
    largest: int | None = None
    meaning: str = ""

    def shown(self, value: object) -> str:
        """Return a decoded value as text: a code's name, "unknown (7)" without one, or a number."""
        if isinstance(value, IntEnum):
            return value.name
        return f"unknown ({value})" if isinstance(self.decode, _Code) else f"{value:g}"


@dataclass(frozen=True, slots=True)
class _Code:
    """Decodes a code to a member of an enum; a code that this program does not know stays int."""

    kind: type[IntEnum]

    def __call__(self, value: int) -> int:
        try:
            return self.kind(value)
        except ValueError:
            return int(value)


def _command_pct(one: Any) -> float:
    return 100.0 * float(one.axis.demand)


def _applied_pct(one: Any) -> float:
    return 100.0 * float(one.axis.output.setpoint)


# Nothing here may be a lambda: a deployment is pickled by the process that has read it.
AXIS_STATUS: list[StatusField[Any]] = [
    StatusField("State", attrgetter("axis.state"), _Code(State), True, max(State), "number, above"),
    StatusField("Reason", attrgetter("reason"), _Code(Reason), True, max(Reason), "number, below"),
    StatusField("RawCommand", _command_pct, required=True, meaning="joystick, % of full speed"),
    StatusField("ShapedCommand", _applied_pct, required=True, meaning="valve, % of full speed"),
    StatusField(
        "PredictedSway", attrgetter("sway_deg"), required=True, meaning="predicted swing, degrees"
    ),
    StatusField("ActiveSet", attrgetter("active_set"), int, meaning="selected parameter set"),
    StatusField(
        "SwaySensor",
        attrgetter("trust"),
        _Code(Trust),
        largest=max(Trust),
        meaning="[trust](sensor.md#when-it-is-trusted) in the sway sensor",
    ),
    StatusField(
        "SwingLength",
        attrgetter("swing_length_m"),
        meaning="pendulum length by the sway sensor, m; 0 before it is known",
    ),
]
LAST_FAULT: StatusField[dict[str, int]] = StatusField(
    "LastFault", itemgetter("LastFault"), _Code(FrameFault), True, max(FrameFault)
)
COUNTERS: list[StatusField[dict[str, int]]] = [
    StatusField(name, itemgetter(name), int, required=True)
    for name in (
        "MissedDeadlines",
        "WrongLength",
        "UnknownId",
        "ErrorFrames",
        "InvalidSignals",
        "SendFailures",
    )
]
"""Counters of the service; each stops at its largest value."""
SERVICE_STATUS = [LAST_FAULT, *COUNTERS]
IDENTITY: list[StatusField[int]] = [
    StatusField("Digest", int, int, required=True, largest=(1 << DIGEST_BITS) - 1)
]
"""Digest of what runs."""
AIM: list[StatusField[Any]] = [
    StatusField("AimSlew", attrgetter("slew_deg"), required=True),
    StatusField("AimReach", attrgetter("radius_m"), required=True),
    StatusField("AimKnown", attrgetter("known"), bool, True, 1),
]
"""How far (degrees, m) the tip still travels if the joysticks are released now."""


class StatusCodec(Generic[Source]):
    """Encodes and decodes the fields of one status message.

    Args:
        message: message that carries the status.
        fields: fields that such a message may have.

    Attributes:
        message: message that carries the status.
        fields: fields that the message has in its DBC.
    """

    def __init__(self, message: SentMessage, fields: Iterable[StatusField[Source]]) -> None:
        self.message = message
        self.fields = [one for one in fields if one.name in message.fields.start]

    def values(self, source: Source) -> dict[str, int]:
        """Return raw values of ``source`` by signal; measurements are clamped to their bits."""
        raw: dict[str, int] = {}
        for one in self.fields:
            value = one.encode(source)
            coded = one.largest is not None
            raw[one.name] = int(value) if coded else self.message.fields.raw(one.name, value)
        return raw

    def decode(self, data: bytes) -> dict[str, Any] | None:
        """Return the decoded values of a frame by field name; None where its length is wrong."""
        fields = self.message.fields
        if len(data) != fields.layout.length:
            return None
        raw = fields.layout.decode(data)
        return {
            one.name: one.decode(
                raw[one.name] if one.largest is not None else fields.value(one.name, raw[one.name])
            )
            for one in self.fields
        }


def status_faults(message: Message, fields: Iterable[StatusField[Source]]) -> list[str]:
    """Return the reasons why a message cannot carry a status with these fields."""
    signals = {signal.name: signal for signal in message.signals}
    missing = [one.name for one in fields if one.required and one.name not in signals]
    faults = [f"lacks the signals {', '.join(missing)}"] if missing else []
    for one in fields:
        signal = signals.get(one.name)
        if signal is None:
            continue
        if signal.is_float or not signal.scale:
            got = "a float" if signal.is_float else "a scale of 0"
            faults.append(f"{one.name}: expected an integer signal with a scale, got {got}")
        elif raw_limits(signal)[1] < (one.largest or 0):
            faults.append(f"{one.name} cannot carry {one.largest} with {signal.length} bits")
    return faults


def required_names(fields: Iterable[StatusField[Source]]) -> set[str]:
    """Return the names of the signals that a status message must have."""
    return {one.name for one in fields if one.required}
