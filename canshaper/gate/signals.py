"""Converts signals that cantools has loaded to fields, scales, sticks and commands of the gate."""

import math
import struct
from typing import Any

from canshaper.gate.fields import EPSILON, Command, Field, Part, Resolution, Stick

REALS = {16: "<e", 32: "<f", 64: "<d"}
NEUTRAL = ("neutral", "neutralposition", "center", "centre", "zero", "released")
"""Names of codes that are measurements if their value is 0."""


def signal_of(message: Any, name: str) -> Any:
    """Return the signal of that name."""
    return next(signal for signal in message.signals if signal.name == name)


def field_of(message: Any, name: str) -> Field:
    """Return the field of a signal: its bits in the message."""
    signal = signal_of(message, name)
    big = signal.byte_order == "big_endian"
    # ``start`` is the lowest bit in Intel order; in Motorola order the highest, within its byte.
    first = signal.start // 8 * 8 + 7 - signal.start % 8
    shift = 8 * message.length - first - signal.length if big else signal.start
    sign = 1 << signal.length - 1 if signal.is_signed and not signal.is_float else 0
    real = REALS[signal.length] if signal.is_float else ""
    return Field(shift, (1 << signal.length) - 1, sign, int(big), real)


def bits_of(field: Field, length: int, raw: float | None = None) -> int:
    """Return the bits of a field (all, or a raw value) in a frame of ``length``, byte 0 lowest."""
    number = field.mask if raw is None else int(raw) & field.mask
    if field.real and raw is not None:
        number = int.from_bytes(struct.pack(field.real, raw), "little")
    placed = number << field.shift
    return int.from_bytes(placed.to_bytes(length, "big" if field.order else "little"), "little")


def ends_of(signal: Any) -> tuple[int, int]:
    """Return the smallest and largest raw value that the bits of an integer signal hold."""
    low = -(1 << signal.length - 1) if signal.is_signed else 0
    return low, low + (1 << signal.length) - 1


class Scale:
    """Scale, offset, range and full scale of a velocity, by the DBC with the file's corrections."""

    def __init__(self, signal: Any, section: Any, *, magnitude: bool) -> None:
        full, zero, invert = (
            (section.full, section.zero or 0.0, section.invert) if section else (None, 0.0, False)
        )
        scale, offset = signal.scale, signal.offset - zero
        low, high = signal.minimum, signal.maximum
        if full is not None:
            low, high = -full, full
            if not signal.is_float and not magnitude:
                # Two's complement reaches one step farther on one side.
                ends = sorted(raw * scale + offset for raw in ends_of(signal))
                step = abs(scale) * (1.0 + EPSILON)
                low = ends[0] if 0.0 < low - ends[0] <= step else low
                high = ends[1] if 0.0 < ends[1] - high <= step else high
        elif zero:
            low, high = low - zero, high - zero
        if invert:
            scale, offset, low, high = -scale, -offset, -high, -low
        self.scale, self.offset, self.low, self.high = scale, offset, low, high
        self.full = min(-low, high) if low < 0.0 else high


def part_of(field: Field, signal: Any, section: Any) -> Part:
    """Return the reader of a joystick's signal; a code with a name in the DBC is no measurement.

    Exceptions are codes that the file lists as a value, and a name for neutral at exactly 0.
    """
    of = Scale(signal, section, magnitude=bool(section.flags or section.negative))
    listed, named = section.codes, set()
    for code, name in (signal.choices or {}).items():
        letters = "".join(filter(str.isalpha, str(name))).lower()
        neutral = letters in NEUTRAL and abs(code * of.scale + of.offset) < EPSILON
        if listed.get(str(name)) != "value" and not neutral:
            named.add(code)
    low, high = min(of.low / of.full, -1.0) - EPSILON, of.high / of.full + EPSILON
    return Part(field, of.scale, of.offset, of.full, low, high, frozenset(named))


def stick_of(message: Any, command: Any, in_dbc: Any) -> Stick:
    """Return the reader of an axis' demand; ``in_dbc`` is its joystick's uncorrected message."""
    part, *back = (
        part_of(field_of(message, name), signal_of(in_dbc, name), command)
        for name in filter(None, (command.signal, command.negative))
    )
    flags: tuple[Field, ...] = ()
    if one := command.flags:
        flags = tuple(field_of(message, name) for name in (one.neutral, one.negative, one.positive))
    return Stick(part, back[0] if back else None, flags, command.neutral_pct / 100.0)


def command_of(message: Any, valve: Any, joystick: Any, in_dbc: Any) -> Command:
    """Return the reader of the command in the valve frames of an axis.

    Args:
        message: the valve message, of cantools.
        valve: section ``valve`` of the axis.
        joystick: section ``command`` of the axis, if a gateway writes the command into the frames
            of its joystick; else None.
        in_dbc: the valve message as its DBC file has it, which gives the scale.
    """
    names: tuple[str, ...] = ()
    signs: dict[tuple[float, ...], int] = {}
    if one := valve.direction:
        names, signs = (one.signal,), {(one.neutral,): 0, (one.positive,): 1, (one.negative,): -1}
    elif joystick and (flags := joystick.flags):
        names = flags.neutral, flags.negative, flags.positive
        signs = {(1, 0, 0): 0, (0, 0, 1): 1, (0, 1, 0): -1}
    back = joystick.negative if joystick else None

    def resolution(name: str, section: Any) -> Resolution:
        of = Scale(signal_of(in_dbc, name), section, magnitude=bool(names or back))
        full = math.floor(of.full / abs(of.scale) + EPSILON)
        zero = round(-of.offset / of.scale)
        return Resolution(field_of(message, name), zero, 1 if of.scale > 0 else -1, full)

    return Command(
        resolution(valve.signal, joystick or valve),
        tuple(field_of(message, name) for name in names),
        signs,
        resolution(back, joystick) if back else None,
        tuple(resolution(name, None) for name in valve.also),
    )


def start_of(signal: Any, *, j1939: bool) -> float:
    """Return the raw value of an unset signal: GenSigStartValue; or 0, J1939 integers all ones."""
    if signal.is_float:
        real = REALS[signal.length]
        return float(struct.unpack(real, struct.pack(real, signal.raw_initial or 0.0))[0])
    low, high = ends_of(signal)
    if j1939 and signal.raw_initial is None:
        return -1 if signal.is_signed else high
    return min(max(int(signal.raw_initial or 0), low), high)


def rest_of(signal: Any) -> set[float]:
    """Return the raw value at zero of a signed velocity; an empty set for any other signal."""
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or not low < 0 < high:
        return set()
    rest = -signal.offset / signal.scale
    return {rest if signal.is_float else round(rest)}
