"""Guesses from the messages of a DBC file: joysticks, valves, switches."""

import math
import re
from collections.abc import Sequence
from difflib import SequenceMatcher

from cantools.database.can import Message, Signal

from canshaper.codec.layout import is_j1939
from canshaper.codec.signals import LEAST_STEPS, command_fault, raw_limits, symmetrical_range
from canshaper.codec.status import AIM, AXIS_STATUS, required_names
from canshaper.machine.corrections import bit_of
from canshaper.machine.sway_sensor import LEAST_SAMPLES, UNITS
from canshaper.machine.used_message import ENABLE as CONTRARY_ENABLE
from canshaper.machine.used_message import contrary_fault

ENABLE = re.compile(r"enable|dead.?man|release|active", re.IGNORECASE)
ENABLING = re.compile(r"(?<!in)(?<!not )(active|enable|operat|ready)|^on$", re.IGNORECASE)
RESET = re.compile(r"reset|acknowledge", re.IGNORECASE)
ANTI_SWAY_OFF = re.compile(r"anti.?sway|bypass|sway.{0,8}off", re.IGNORECASE)
SWAY = re.compile(r"sway|swing|slope|tilt|incl", re.IGNORECASE)
NEUTRAL = re.compile(r"neutral|centre|center|rest", re.IGNORECASE)
NEGATIVE = re.compile(r"neg|left|back|down|minus", re.IGNORECASE)
POSITIVE = re.compile(r"pos|right|forward|fwd|up|plus", re.IGNORECASE)
RADIUS = re.compile(r"radius|reach", re.IGNORECASE)
LOAD = re.compile(r"weight|load|grip|grapple|gripped|lift.?press", re.IGNORECASE)
COUNTER = re.compile(r"alive|count|rolling", re.IGNORECASE)
_JOYSTICK = re.compile(r"lever|joy|joystick|stick|paddle", re.IGNORECASE)
_VALVE = re.compile(r"valve|command|cmd|set.?point|pump|flow|actuat|motor", re.IGNORECASE)
_WORD = re.compile(r"[A-Z]+(?![a-z])\d*|[A-Z]?[a-z]+\d*")
_GENERIC = {"velocity", "speed", "command", "cmd", "valve", "flow", "position", "value", "axis"}
# A switch has two bits at most: off, on, error, not available.
SWITCH_BITS = 2
_BYTE = 8
# Two names that share this part are likely to belong together.
LIKELY = 0.6


def axes(message: Message) -> list[Signal]:
    """Return the signals of a message that the DBC describes as a velocity of an axis."""
    return [s for s in message.signals if not s.is_float and symmetrical_range(s) is None]


def velocities(message: Message) -> list[Signal]:
    """Return the signals that may be a two-sided velocity, perhaps with a scaling in the file."""
    return [s for s in message.signals if two_sided(s)]


def two_sided(signal: Signal) -> bool:
    """Return whether a signal may be a velocity that goes both ways."""
    if not signal.scale:
        return False
    low, high = reach(signal)
    return low < 0.0 < high


def one_sided(message: Message) -> list[Signal]:
    """Return the signals that may be a velocity around a middle value, or with direction flags."""
    return [
        s
        for s in message.signals
        if s.length > SWITCH_BITS and s.scale and not (two_sided(s) or s.is_float)
        if not (s.is_multiplexer or COUNTER.search(s.name))
    ]


def direction_flags(message: Message, signal: Signal) -> tuple[str, str, str] | None:
    """Return flags of neutral, negative and positive of a signal by name; None unless all three."""
    flags = switches(message)
    near = sorted(
        flags, key=lambda s: (-likeness(s.name, signal.name), abs(s.start - signal.start))
    )
    names = [named(near, pattern) for pattern in (NEUTRAL, NEGATIVE, POSITIVE)]
    if None in names or len({*names}) < len(names):
        return None
    return str(names[0]), str(names[1]), str(names[2])


def reach(signal: Signal) -> tuple[float, float]:
    """Return least and largest value of a signal, by its bits, and by its range in the DBC."""
    low, high = -math.inf, math.inf
    if not signal.is_float:
        ends = [raw * signal.scale + signal.offset for raw in raw_limits(signal)]
        low, high = min(ends), max(ends)
    least, most = signal.minimum, signal.maximum
    if least is not None and most is not None and most > least:
        low, high = max(low, least), min(high, most)
    return low, high


def likely_middle(signal: Signal) -> float:
    """Return the likely zero of a one-sided signal: the middle of its reach, rounded up."""
    low, high = reach(signal)
    steps = math.ceil((high - low) / abs(signal.scale) / 2.0)
    return low + steps * abs(signal.scale)


def likely_full(signal: Signal, zero: float = 0.0) -> float:
    """Return the likely distance from zero to full: to the nearer end of its reach; 1 without."""
    low, high = reach(signal)
    full = min(zero - low, high - zero) if low < zero < high else high - zero
    return full if math.isfinite(full) else 1.0


def switches(message: Message) -> list[Signal]:
    """Return the signals of a message that can be a switch."""
    return [s for s in message.signals if not s.is_signed and s.length <= SWITCH_BITS]


def switch_parts(message: Message) -> list[Signal]:
    """Return signals of a byte at most that can be a switch, and each bit of theirs, SIGNAL/BIT."""
    parts: list[Signal] = []
    for s in message.signals:
        bits = s.length <= SWITCH_BITS if s.is_signed else SWITCH_BITS < s.length <= _BYTE
        apart = s.is_float or s.is_multiplexer or s.unit or COUNTER.search(s.name)
        if bits and not apart and (s.is_signed or not s.choices):
            parts += [] if s.is_signed else [s]
            parts += [bit_of(s, number) for number in range(s.length)]
    return parts


def enabling(signals: Sequence[Signal]) -> str | None:
    """Return the likely enable switch, by its name; none whose values say the contrary."""
    fine = [s for s in signals if contrary_fault(s, "enable", CONTRARY_ENABLE) is None]
    return named(fine, ENABLE)


def modes(message: Message) -> list[Signal]:
    """Return wider signals whose values have names in the DBC: one value may be the enable."""
    return [
        s
        for s in message.signals
        if s.choices and s.length > SWITCH_BITS and not (s.is_signed or s.is_float)
        if not s.is_multiplexer
    ]


def enabling_code(signal: Signal) -> int | None:
    """Return the only value whose name says that it enables; None for none or several."""
    codes = [code for code, name in (signal.choices or {}).items() if ENABLING.search(str(name))]
    return codes[0] if len(codes) == 1 else None


def named(signals: Sequence[Signal], pattern: re.Pattern[str]) -> str | None:
    """Return the name of the first signal whose name matches; None for none."""
    return next((s.name for s in signals if pattern.search(s.name)), None)


def counter(message: Message) -> str | None:
    """Return the alive counter of a message, by its name; None for none."""
    candidates = [s for s in message.signals if not s.is_signed and raw_limits(s)[1] > 1]
    return named(candidates, COUNTER)


def joysticks(messages: Sequence[Message]) -> list[Message]:
    """Return the messages that can be of a joystick, the likely ones first."""
    possible = [m for m in messages if not is_status(m) and (velocities(m) or one_sided(m))]
    return sorted(possible, key=lambda m: (*_rank(m, possible), not _JOYSTICK.search(m.name)))


def likely_joysticks(messages: Sequence[Message]) -> list[Message]:
    """Return the messages that are as likely a joystick as the likeliest one."""
    candidates = joysticks(messages)
    ranks = [_rank(m, candidates) for m in candidates]
    return [m for m, rank in zip(candidates, ranks, strict=True) if rank == ranks[0]]


def _rank(message: Message, others: Sequence[Message]) -> tuple[int, int]:
    """Return a rank, low for a likely joystick: by readers and name, then by its description."""
    senders = {node for m in others for node in m.senders} - {*message.senders}
    readers = {node for m in others if m is not message for s in m.signals for node in s.receivers}
    up = any(node in senders for s in message.signals for node in s.receivers)
    down = any(node in readers for node in message.senders)
    if bool(_JOYSTICK.search(message.name)) != bool(_VALVE.search(message.name)):
        down = bool(_VALVE.search(message.name))
        up = not down
    return down - up, _tier(message, axes(message) and switches(message))


def _tier(message: Message, described: object) -> int:
    """Return 0 for a cyclic and described message, 1 for a two-sided one, 2 for others."""
    if message.cycle_time and described:
        return 0
    return 1 if velocities(message) else 2


def commands(message: Message) -> list[Signal]:
    """Return the signals of a message that the DBC describes as a command of a valve."""
    return [s for s in axes(message) if command_fault(s) is None]


def valve_signals(message: Message) -> list[Signal]:
    """Return the signals of ``commands``, else those that can be one by a scaling in the file."""
    fine = [
        s
        for s in message.signals
        if s.scale and not s.is_float and (likely_full(s) / abs(s.scale) >= LEAST_STEPS)
    ]
    signals = [s for s in fine if two_sided(s)]
    return commands(message) or signals or [s for s in one_sided(message) if s in fine]


def valves(messages: Sequence[Message], joystick: str) -> list[Message]:
    """Return the messages that can command a valve.

    Those that the DBC describes come first, of them those named like their joystick.
    """
    candidates = [m for m in messages if not is_status(m) and valve_signals(m)]
    return sorted(candidates, key=lambda m: (_tier(m, commands(m)), -likeness(m.name, joystick)))


def radii(messages: Sequence[Message], timeout_ms: int) -> list[str]:
    """Return MESSAGE.SIGNAL of radii in m, by name, that come twice or more within a timeout."""
    return [
        f"{message.name}.{signal.name}"
        for message in messages
        if message.cycle_time and 2 * message.cycle_time <= timeout_ms and not is_status(message)
        for signal in message.signals
        if signal.unit == "m" and RADIUS.search(signal.name)
    ]


def loads(messages: Sequence[Message]) -> list[tuple[Message, Signal]]:
    """Return signals that can say what the grapple holds.

    Those of J1939 are left out: the file would have to name their sender too.
    """
    return [
        (message, signal)
        for message in messages
        if not (is_status(message) or is_j1939(message))
        for signal in message.signals
        if not (signal.is_multiplexer or signal.is_float or COUNTER.search(signal.name))
    ]


def sway_sensors(messages: Sequence[Message], swing_s: float) -> list[tuple[Message, Signal]]:
    """Return signals that can measure a swing of so many seconds, the likely ones first.

    Those of J1939 are left out: the file would have to name their sender too.
    """
    sensors = [
        (message, signal)
        for message in messages
        if message.cycle_time and message.cycle_time <= 1000.0 * swing_s / LEAST_SAMPLES
        if not (is_status(message) or is_j1939(message))
        for signal in message.signals
        if any(signal.unit in units for units in UNITS.values())
    ]
    return sorted(sensors, key=lambda one: not SWAY.search(f"{one[0].name}.{one[1].name}"))


def is_status(message: Message) -> bool:
    """Return whether a message carries the status of an axis, or the aim point of a crane."""
    names = {signal.name for signal in message.signals}
    return names >= required_names(AXIS_STATUS) or names >= required_names(AIM)


def status_of(messages: Sequence[Message], axis: str) -> Message | None:
    """Return the cyclic status message that is named like an axis; None for none."""
    candidates = [m for m in messages if is_status(m) and m.cycle_time]
    likely = max(candidates, key=lambda m: likeness(m.name, axis), default=None)
    return likely if likely and likeness(likely.name, axis) >= LIKELY else None


def with_signals(signals: set[str], messages: Sequence[Message]) -> Message | None:
    """Return the first message with all these signals; None for none."""
    return next((m for m in messages if {s.name for s in m.signals} >= signals), None)


def axis_name(signal: str) -> str:
    """Return a name for an axis after its joystick: near_far for NearFar."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", signal).lower()


def alike(one: str, other: str) -> bool:
    """Return whether two names share a word that not every valve has."""
    first, second = ({word.lower() for word in _WORD.findall(name)} for name in (one, other))
    return bool(first & second - _GENERIC)


def likeness(one: str, other: str) -> float:
    """Return how much of the shorter name is in the longer one, 0 to 1."""
    a, b = sorted((one.lower().replace("_", ""), other.lower().replace("_", "")), key=len)
    match = SequenceMatcher(None, a, b, autojunk=False).find_longest_match()
    return match.size / len(a) if a else 0.0
