"""What the messages of a DBC file look like: joysticks, valves, switches. Only a first guess."""

import re
from collections.abc import Sequence
from difflib import SequenceMatcher

from cantools.database.can import Message, Signal

from canshaper.codec.signals import command_fault, raw_limits, symmetrical_range
from canshaper.codec.status import AXIS_STATUS, IDENTITY, SERVICE_STATUS, required_names

ENABLE = re.compile(r"enable|dead.?man|release|active", re.IGNORECASE)
RESET = re.compile(r"reset|acknowledge", re.IGNORECASE)
ANTI_SWAY_OFF = re.compile(r"anti.?sway|bypass|sway.?off", re.IGNORECASE)
RADIUS = re.compile(r"radius|reach", re.IGNORECASE)
COUNTER = re.compile(r"alive|count|rolling", re.IGNORECASE)
_JOYSTICK = re.compile(r"lever|joy|joystick", re.IGNORECASE)
# A switch has two bits at most: off, on, error, not available.
_SWITCH_BITS = 2
# Part of a name that two have in common, from which on they are likely to belong together.
LIKELY = 0.6


def axes(message: Message) -> list[Signal]:
    """Signals of a message that can be the velocity of an axis."""
    return [s for s in message.signals if not s.is_float and symmetrical_range(s) is None]


def switches(message: Message) -> list[Signal]:
    """Signals of a message that can be a switch."""
    return [s for s in message.signals if not s.is_signed and s.length <= _SWITCH_BITS]


def named(signals: Sequence[Signal], pattern: re.Pattern[str]) -> str | None:
    """The first signal whose name says what is looked for."""
    return next((s.name for s in signals if pattern.search(s.name)), None)


def counter(message: Message) -> str | None:
    """The alive counter of a message, by its name."""
    found = [s for s in message.signals if not s.is_signed and raw_limits(s)[1] > 1]
    return named(found, COUNTER)


def joysticks(messages: Sequence[Message]) -> list[Message]:
    """Messages that come again and again with a joystick and a switch; the likely ones first."""
    found = [m for m in messages if m.cycle_time and axes(m) and switches(m)]
    return sorted(found, key=lambda m: not _JOYSTICK.search(m.name))


def commands(message: Message) -> list[Signal]:
    """Signals of a message that can command a valve."""
    return [s for s in axes(message) if command_fault(s) is None]


def valves(messages: Sequence[Message], joystick: str) -> list[Message]:
    """Messages that can command a valve; those whose names are like that of its joystick first."""
    found = [m for m in messages if m.cycle_time and commands(m) and not is_status(m)]
    return sorted(found, key=lambda m: -likeness(m.name, joystick))


def radii(messages: Sequence[Message], timeout_ms: int) -> list[str]:
    """MESSAGE.SIGNAL of what can be a radius in m, by name, at least twice within a timeout."""
    return [
        f"{message.name}.{signal.name}"
        for message in messages
        if message.cycle_time and 2 * message.cycle_time <= timeout_ms
        for signal in message.signals
        if signal.unit == "m" and RADIUS.search(signal.name)
    ]


def is_status(message: Message) -> bool:
    """Whether a message carries the status of an axis."""
    return {s.name for s in message.signals} >= required_names(AXIS_STATUS)


def status_of(messages: Sequence[Message], axis: str) -> Message | None:
    """The status message of an axis, by its name."""
    found = [m for m in messages if is_status(m) and m.cycle_time]
    likely = max(found, key=lambda m: likeness(m.name, axis), default=None)
    return likely if likely and likeness(likely.name, axis) >= LIKELY else None


def service_status(messages: Sequence[Message]) -> Message | None:
    """The message with the counters of the service."""
    return _with(required_names(SERVICE_STATUS), messages)


def identity(messages: Sequence[Message]) -> Message | None:
    """The message with the digest of what runs."""
    return _with(required_names(IDENTITY), messages)


def _with(signals: set[str], messages: Sequence[Message]) -> Message | None:
    """The first message that has all these signals."""
    return next((m for m in messages if {s.name for s in m.signals} >= signals), None)


def axis_name(signal: str) -> str:
    """A name for an axis after its joystick: NearFar is near_far."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", signal).lower()


def likeness(one: str, other: str) -> float:
    """How much of the shorter name is in the longer one, 0 to 1."""
    a, b = sorted((one.lower().replace("_", ""), other.lower().replace("_", "")), key=len)
    match = SequenceMatcher(None, a, b, autojunk=False).find_longest_match()
    return match.size / len(a) if a else 0.0
