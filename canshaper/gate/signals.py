"""Converts signals that cantools has loaded to fields, sticks, commands and protections."""

import math
import struct
from typing import TYPE_CHECKING, Any

from canshaper.gate.checks import COUNTS, Checksum, Crc, E2e, crc_of
from canshaper.gate.fields import EPSILON, Command, Field, Part, Resolution, Stick
from canshaper.gate.record import Protection

if TYPE_CHECKING:  # for the checker of types only: nothing of it is loaded with the gate
    from cantools.database.can import Message, Signal

    from canshaper.config.inputs import Checksum as ChecksumSection
    from canshaper.config.inputs import Protected
    from canshaper.config.schema import Command as CommandSection
    from canshaper.config.schema import Scaling
    from canshaper.config.schema import Valve as ValveSection

REALS = {16: "<e", 32: "<f", 64: "<d"}
NEUTRAL = ("neutral", "neutralposition", "center", "centre", "zero", "released")
"""Names of codes that are measurements if their value is 0."""


def signal_of(message: "Message", name: str) -> "Signal":
    """Return the signal of that name."""
    return next(signal for signal in message.signals if signal.name == name)


def field_of(message: "Message", name: str) -> Field:
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


def ends_of(signal: "Signal") -> tuple[int, int]:
    """Return the smallest and largest raw value that the bits of an integer signal hold."""
    low = -(1 << signal.length - 1) if signal.is_signed else 0
    return low, low + (1 << signal.length) - 1


class Scale:
    """Scale, offset, range and full scale of a velocity, by the DBC with the file's corrections."""

    def __init__(self, signal: "Signal", section: "Scaling | None", *, magnitude: bool) -> None:
        full, zero, invert = (
            (section.full, section.zero or 0.0, section.invert) if section else (None, 0.0, False)
        )
        scale, offset = signal.scale, signal.offset - zero
        low, high = signal.minimum or 0.0, signal.maximum or 0.0
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


def part_of(field: Field, signal: "Signal", section: "CommandSection") -> Part:
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


def stick_of(message: "Message", command: "CommandSection", in_dbc: "Message") -> Stick:
    """Return the reader of an axis' demand; ``in_dbc`` is its joystick's uncorrected message."""
    part, *back = (
        part_of(field_of(message, name), signal_of(in_dbc, name), command)
        for name in filter(None, (command.signal, command.negative))
    )
    flags: tuple[Field, ...] = ()
    if one := command.flags:
        flags = tuple(field_of(message, name) for name in (one.neutral, one.negative, one.positive))
    return Stick(part, back[0] if back else None, flags, command.neutral_pct / 100.0)


def command_of(
    message: "Message", valve: "ValveSection", joystick: "CommandSection | None", in_dbc: "Message"
) -> Command:
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

    def resolution(name: str, section: "Scaling | None") -> Resolution:
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


def protection_of(section: "Protected", message: "Message", can_id: int) -> Protection:
    """Return the protection of a message, from its section of the file."""
    if one := section.e2e:
        counts, ids = COUNTS.get(one.profile, 256), bytes(one.data_ids or ())
        e2e = E2e(one.profile, counts, one.data_id or 0, one.data_id_mode or "", ids)
        return Protection(e2e, counts=counts)
    counter = field_of(message, section.alive_counter) if section.alive_counter else None
    counts = counter.mask + 1 if counter else 0
    of = section.checksum
    check = _checksum(of, message, can_id) if of else None
    return Protection(check, of is None or check is not None, counter, counts)


def _checksum(section: "ChecksumSection", message: "Message", can_id: int) -> Checksum | None:
    """Return the checksum of a message; None for a kind that another package adds."""
    signal, kind = signal_of(message, section.signal), section.kind
    place, bits = bits_of(field_of(message, section.signal), message.length), signal.length
    lowest = (place & -place).bit_length() - 1
    order = "big" if signal.byte_order == "big_endian" and bits > 8 else "little"
    where: Any = {"byte": lowest // 8, "shift": lowest % 8, "bits": bits, "order": order}
    if kind is None:
        crc = Crc(bits, section.polynomial or 0, section.start, section.end, section.reflected)
        return Checksum(crc, **where)
    plus = {"sum": 0, "sum_id": sum(can_id.to_bytes(4, "little")), "sum_length": message.length}
    if kind in plus:
        return Checksum("sum", **where, plus=plus[kind])
    named = ("crc8_sae_j1850", "crc8_autosar", "crc16_ccitt_false", "crc16_arc")
    how: Any = crc_of(kind) if kind in named else {"xor": "xor", "sum4": "halves"}.get(kind)
    return Checksum(how, **where) if how else None


def start_of(signal: "Signal", *, j1939: bool) -> float:
    """Return the raw value of an unset signal: GenSigStartValue; or 0, J1939 integers all ones."""
    if signal.is_float:
        real = REALS[signal.length]
        return float(struct.unpack(real, struct.pack(real, signal.raw_initial or 0.0))[0])
    low, high = ends_of(signal)
    if j1939 and signal.raw_initial is None:
        return -1 if signal.is_signed else high
    return min(max(int(signal.raw_initial or 0), low), high)


def rest_of(signal: "Signal") -> set[float]:
    """Return the raw value at zero of a signed velocity; an empty set for any other signal."""
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or not low < 0 < high:
        return set()
    rest = -signal.offset / signal.scale
    return {rest if signal.is_float else round(rest)}
