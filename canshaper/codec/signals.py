"""Signals of a DBC message: whether a signal suits its use, and which raw values are codes.

cantools scales whatever it finds: an error code of 1022 at 0.1 % per bit becomes 102.2 %. So we
decode raw values (``Layout``), test them for codes, and scale only the others.
"""

import math
import re
from collections.abc import Container, Mapping
from typing import Any

from cantools.database.can import Message, Signal

from canshaper.shaping.states import Reason

# Tolerance for the rounding of decimals, as part of a raw step.
STEP_ROUNDING = 1e-6
# Tolerance for the rounding of scale and offset, as part of full scale; below any resolution.
ROUNDING = 1e-6
LEAST_STEPS = 10
"""Fewest raw steps from zero to full command with which a valve can be moved."""
FULL_SET_POINT = 0x4000
"""Full setpoint of a valve of CiA 408; +-0x7FFF would be its float position, which drops a load."""

# Names that the tables of a DBC give to raw values, as words in small letters: SensorError is
# "sensor error". In a name without any gap, such as sensorerror, those of an error are found too,
# but not in Default, Interrupted, Terrain and Preserved.
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_NOT_AVAILABLE = re.compile(r"not ?avail|unavail|\bsna\b|^n ?a$")
_ERROR = re.compile(
    r"\berr(?!and)|err\b|error|(?<!\bde)fault|fail|invalid|not ?valid|(?<!\bp)reserved|defect"
)
# Besides those: names of a code at which no switch may agree.
_BROKEN = re.compile(
    r"short[ _-]*(circuit|to|cut)|open[ _-]*(circuit|load|wire)|broken|break\b|lost\b|bad\b"
    r"|implausib|damaged?\b|malfunction|kurzschlu|bruch|fehler|st(oe|ö)rung|defekt|kaputt"
    r"|ung(ue|ü)ltig|unterbrech|virhe|\bvika\b|\bfel\b|erreur|panne",
    re.IGNORECASE,
)
_NEUTRAL = re.compile(r"neutral|neutral position|cent(er|re)|zero|released")


def find_signal(message: Message, name: str) -> Signal | None:
    """Return the signal of that name, or None."""
    return next((s for s in message.signals if s.name == name), None)


def raw_limits(signal: Signal) -> tuple[int, int]:
    """Return the smallest and largest raw value that the bits of an integer signal hold."""
    if signal.is_signed:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def symmetrical_range(signal: Signal) -> str | None:
    """Return why the DBC range of a velocity signal cannot serve as full scale, or None."""
    if fault := _no_range(signal):
        return fault
    low, high = signal.minimum or 0.0, signal.maximum or 0.0
    # Two's complement has one step more on one side.
    step = 0.0 if signal.is_float else abs(signal.scale) * (1.0 + STEP_ROUNDING)
    if not math.isclose(-low, high) and (not low < 0.0 < high or abs(low + high) > step):
        return f"{signal.name}: expected a symmetrical range, got [{low:g}|{high:g}]"
    return _not_reached(signal)


def full_scale(signal: Signal) -> float:
    """Return the value at full command: how far the range reaches both ways, or from 0 upwards."""
    low, high = signal.minimum or 0.0, signal.maximum or 0.0
    return min(-low, high) if low < 0.0 else high


def magnitude_range(signal: Signal) -> str | None:
    """Return why the DBC range of a magnitude cannot be full scale, or None; it begins at 0."""
    if fault := _no_range(signal):
        return fault
    if signal.minimum != 0.0:
        expected = "expected a range from 0, as it is a magnitude"
        return f"{signal.name}: {expected}, got [{signal.minimum:g}|{signal.maximum:g}]"
    return _not_reached(signal)


def _no_range(signal: Signal) -> str | None:
    if not signal.scale:
        return f"{signal.name}: expected a scale other than 0, got 0"
    return ends_fault(signal, "full speed is taken from it, or from full")


def ends_fault(signal: Signal, use: str) -> str | None:
    """Return why a signal has no usable range, or None; ``use`` says what the range is for."""
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or high == low:
        return f"{signal.name} has no range in the DBC; {use}"
    if high < low:
        return f"{signal.name}: expected the range [{high:g}|{low:g}], got [{low:g}|{high:g}]"
    return None


def _not_reached(signal: Signal) -> str | None:
    """Return why the bits of a signal do not reach the ends of its range, or None."""
    if signal.is_float:
        return None
    low, high = signal.minimum or 0.0, signal.maximum or 0.0
    raw_low, raw_high = raw_limits(signal)
    ends = [(v - signal.offset) / signal.scale for v in (low, high)]
    # Scale and range are decimals, 88.9 / 0.7 is a little above 127.
    if min(ends) < raw_low - STEP_ROUNDING or max(ends) > raw_high + STEP_ROUNDING:
        return (
            f"{signal.name} cannot reach its range [{low:g}|{high:g}] with {signal.length}"
            f" bits at {signal.scale:g} per bit"
        )
    return None


def neutral_fault(signal: Signal, band: float, listed: Container[str] = ()) -> str | None:
    """Return why a joystick is never in neutral, so that its axis is never ready, or None.

    Args:
        signal: signal of the velocity (``symmetrical_range``, ``magnitude_range`` find no fault).
        band: deflection that counts as neutral, part of full scale.
        listed: names of values whose meaning the deployment file states.
    """
    if signal.is_float:
        return None
    zero, (low, high) = round(-signal.offset / signal.scale), raw_limits(signal)
    zero = min(max(zero, low), high)
    value = abs(zero * signal.scale + signal.offset)
    text = f"{signal.name}: expected neutral, within {100.0 * band:g} % (neutral_pct) of 0"
    if value > band * full_scale(signal) + ROUNDING:
        return f"{text}, got {value:g} next to it: its axis is never ready"
    choices: Mapping[int, object] = signal.choices or {}
    name = str(choices.get(zero, ""))
    if named_fault(name) and name not in listed:
        return f'{text}, got {zero} "{name}" there in the DBC: its axis is never ready'
    return None


def few_steps(signal: Signal, full: float) -> str | None:
    """Return why a signal has too few steps to ``full``, or None; floats and 4 bits have enough."""
    steps = full / abs(signal.scale)
    if signal.is_float or signal.length <= 4 or steps + STEP_ROUNDING >= LEAST_STEPS:
        return None
    return f"expected {LEAST_STEPS} steps of {signal.name} or more, got {steps:.2g}"


def valve_steps(full: float, scale: float) -> int:
    """Return the raw steps from zero to full command, rounded down so that full is not passed."""
    return int(full / scale + STEP_ROUNDING)


def command_fault(signal: Signal) -> str | None:
    """Return why a signal has too few steps or no exact zero to command a valve, or None."""
    if valve_steps(full_scale(signal), abs(signal.scale)) < LEAST_STEPS:
        return f"{signal.name} has fewer than {LEAST_STEPS} steps to full command"
    zero = signal.offset / signal.scale
    if abs(zero - round(zero)) > 1e-6:
        return f"{signal.name} has no raw value for zero, which neutral needs"
    return None


def set_point_fault(signal: Signal) -> str | None:
    """Return why a command signal cannot be the setpoint of a valve of CiA 408, or None."""
    if signal.offset:
        return f"{signal.name} has the offset {signal.offset:g}; a set point of CiA 408 has none"
    if (steps := valve_steps(full_scale(signal), abs(signal.scale))) > FULL_SET_POINT:
        text = f"{signal.name} has {steps} steps to full command; a set point of CiA 408 has"
        return f"{text} {FULL_SET_POINT}, and float at {raw_limits(signal)[1]}"
    return None


def _words(name: str) -> str:
    return " ".join(_WORD.findall(name)).lower()


def named_fault(name: str) -> Reason | None:
    """Return why a value is no measurement by its name in the DBC; None for any other name."""
    words = _words(name)
    if _NOT_AVAILABLE.search(words):
        return Reason.JOYSTICK_NOT_AVAILABLE
    return Reason.JOYSTICK_ERROR if _ERROR.search(words) else None


def names_broken(name: str) -> bool:
    """Return whether a name in the DBC is that of a broken switch, sensor or wire."""
    return named_fault(name) is not None or _BROKEN.search(name) is not None


def is_neutral(signal: Signal, raw: float, name: str) -> bool:
    """Return whether a value has a name for neutral and is exactly 0, so that it moves nothing."""
    at_zero = math.isclose(raw * signal.scale, -signal.offset)
    return at_zero and _NEUTRAL.fullmatch(_words(name)) is not None


def in_range(signal: Signal, value: float) -> bool:
    """Return whether a value is within the range of its signal; any value if it has no range."""
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or high <= low:
        return True
    rounding = ROUNDING * (high - low)
    return bool(low - rounding <= value <= high + rounding)


def code_fault(signal: Signal, raw: int) -> str | None:
    """Return why an integer signal can never be ``raw``, by bits or range; None for a float."""
    if signal.is_float:
        return None  # noted as no integer
    low, high = raw_limits(signal)
    value = raw * signal.scale + signal.offset
    if low <= raw <= high and in_range(signal, value):
        return None
    got = f"{low} to {high}"
    if low <= raw <= high:
        got = f"[{signal.minimum:g}|{signal.maximum:g}] in the DBC"
    return f"{signal.name} can never be {raw}: expected a signal that has it, got {got}"


def j1939_code(signal: Signal) -> int | None:
    """Return the first raw value that J1939-71 gives to an error, or None where it gives none.

    An error or "not available" is FE or FF in the highest byte of whole bytes, else one of the two
    last codes. Floats, signed signals and single bits have no such codes.
    """
    if signal.is_float or signal.is_signed or signal.length < 2:
        return None
    whole = signal.length % 8 == 0
    return 0xFE << signal.length - 8 if whole else (1 << signal.length) - 2


def j1939_fault(signal: Signal, *, command: bool = False) -> str | None:
    """Return why an error code of J1939-71 would be a measurement, or a ``command``; or None.

    It is none out of the range; nor is it a measurement where the DBC names it.
    """
    if (first := j1939_code(signal)) is None:
        return None
    names: Mapping[int, object] = {} if command else signal.choices or {}
    last, few = raw_limits(signal)[1], len(names)
    # A range has one end beyond these codes, and each name takes one of them.
    ends = (*range(first, min(first + few, last) + 1), *range(last, max(last - few, first) - 1, -1))
    raws = (r for r in ends if r not in names)
    raw = next((r for r in raws if in_range(signal, r * signal.scale + signal.offset)), None)
    if raw is None:
        return None
    low, high = signal.minimum, signal.maximum
    got = "no range" if low is None or high is None or high <= low else f"[{low:g}|{high:g}]"
    value = f"{raw * signal.scale + signal.offset:g} {signal.unit or ''}".rstrip()
    cure = "" if command else ", or names for them (VAL_)"
    return (
        f"{signal.name}: expected a range that ends before the error codes of J1939, {first} to"
        f" {last}{cure}, got {got}: {raw} would be {value}"
    )


def raw_fault(signal: Signal) -> str | None:
    """Return the fault of a switch that the DBC scales, as its raw value counts; else None."""
    if (signal.scale, signal.offset) == (1, 0):
        return None
    text = f"{signal.name}: expected (1,0) in the DBC, as the raw value of a switch counts, got"
    return f"{text} ({signal.scale:g},{signal.offset:g}), by which its 0 and 1 mean something else"


def special_codes(signal: Signal) -> dict[Any, Reason]:
    """Return every raw value that the DBC names, but neutral, and why it is no measurement.

    The deployment file says which named values are measurements: in a bound message they have no
    name any more (``Listing.without_values``). The words of a name only select the reason.
    """
    return {
        raw: named_fault(str(name)) or Reason.JOYSTICK_ERROR
        for raw, name in (signal.choices or {}).items()
        if not is_neutral(signal, raw, str(name))
    }


def special_name(signal: Signal, value: float) -> str | None:
    """Return the DBC name of a value (in its unit) that is no measurement; None of any other."""
    special = special_codes(signal)
    codes = {raw * signal.scale + signal.offset: raw for raw in special}
    return str((signal.choices or {})[codes[value]]) if value in codes else None


# Units that a length may have in a DBC file; many files give none.
LENGTHS = (None, "", "m")
# Largest radius of a crane, with room; a range in mm or cm is far beyond.
FARTHEST_M = 120.0


def radius_range(signal: Signal) -> str | None:
    """Return why unit or range of a signal cannot be those of a radius in m, or None."""
    if signal.unit not in LENGTHS:
        return f"{signal.name}: expected a radius in m, got a signal in {signal.unit}"
    if fault := ends_fault(signal, "what lies outside is no radius"):
        return fault
    low, high = signal.minimum or 0.0, signal.maximum or 0.0
    if low < 0.0:
        return f"{signal.name}: expected a range from 0 m or more, got [{low:g}|{high:g}]"
    if high > FARTHEST_M:
        text = f"expected a radius in m, up to {FARTHEST_M:g}"
        return f"{signal.name}: {text}, got [{low:g}|{high:g}]"
    return None
