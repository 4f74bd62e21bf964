"""Corrections that the deployment file makes where the DBC states nothing, or a wrong value."""

import re
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass
from operator import is_
from types import MappingProxyType
from typing import Any

from cantools.database.can import Message, Signal

from canshaper.codec.layout import Chosen, frame_length
from canshaper.codec.signals import STEP_ROUNDING, raw_limits
from canshaper.config.inputs import Protected
from canshaper.config.schema import DeploymentConfig, Scaling
from canshaper.config.section import sections
from canshaper.machine.named_codes import Listing


@dataclass(frozen=True)
class Correction:
    """Scaling that the file gives to a signal; with ``magnitude`` it has no negative values."""

    scaling: Scaling
    magnitude: bool


def scalings(config: DeploymentConfig, bus: str, message: str) -> dict[str, Correction]:
    """Return the scaling of each signal of a message that the file corrects, by name."""
    result: dict[str, Correction] = {}
    for axis in config.axes.values():
        command, valve = axis.command, axis.valve
        joystick = config.joysticks.get(command.joystick)
        rewritten = False
        if joystick and config.gateway:
            other = config.gateway.other(valve.bus)
            rewritten = (joystick.bus, joystick.message) == (other, valve.message)
        received = joystick is not None and (joystick.bus, joystick.message) == (bus, message)
        sent = (valve.bus, valve.message) == (bus, message)
        if received or (sent and rewritten):
            one_way = bool(command.flags or command.negative)
            for name in filter(None, (command.signal, command.negative)):
                result[name] = Correction(command, one_way)
        elif sent:
            result[valve.signal] = Correction(valve, valve.direction is not None)
    return {name: one for name, one in result.items() if one.scaling.corrects}


_BIT = re.compile(r"([^/.]+)/(\d{1,2})")


def bit_names(config: DeploymentConfig, bus: str, message: str) -> dict[str, set[int]]:
    """Return the numbers of the bits that the file names as SIGNAL/BIT in a message, by signal."""
    names: list[str] = []
    for _, section in sections(config):
        if isinstance(section, Protected) and (section.bus, section.message) == (bus, message):
            for _, value in section:
                names += [value] if isinstance(value, str) else value if type(value) is list else []
    for joystick in config.joysticks.values():
        for text in joystick.enable or ():
            of, dot, name = text.partition(".")
            owner = config.joysticks.get(of)
            if dot and owner and (owner.bus, owner.message) == (bus, message):
                names.append(name)
    bits: dict[str, set[int]] = {}
    for match in filter(None, map(_BIT.fullmatch, map(str, names))):
        bits.setdefault(match[1], set()).add(int(match[2]))
    return bits


def bit_of(signal: Signal, number: int) -> Signal:
    """Return one bit of a signal (0 the lowest) as a signal of its own named SIGNAL/BIT."""
    result, at = copy(signal), signal.start
    for _ in range(signal.length - 1 - number if signal.byte_order == "big_endian" else 0):
        at += -1 if at % 8 else 15  # after the lowest bit of a byte comes the highest of the next
    result.name, result.length, result.byte_order = f"{signal.name}/{number}", 1, "little_endian"
    result.start = at + (number if signal.byte_order == "little_endian" else 0)
    result.is_signed, result.scale, result.offset = False, 1, 0
    result.minimum = result.maximum = result.raw_initial = None
    choices: Mapping[int, Any] = signal.choices or {}
    named = OrderedDict((abs(raw), name) for raw, name in choices.items())
    result.choices = named if signal.length == 1 else None
    return result


def _cut(signal: Signal, bits: Mapping[str, set[int]]) -> list[Signal]:
    """Return the named bits of a signal as signals; itself if it is a float or has none of them."""
    numbers = sorted(n for n in bits.get(signal.name, ()) if n < signal.length)
    return [bit_of(signal, n) for n in numbers] if numbers and not signal.is_float else [signal]


def corrected(
    message: Message,
    config: Protected,
    signals: Mapping[str, Correction],
    listings: Iterable[Listing] = (),
    bits: Mapping[str, set[int]] = MappingProxyType({}),
) -> Message | str:
    """Return the message with the corrections of the file, or why its multiplexor is wrong.

    Args:
        message: the message of the DBC.
        config: the section that names the message.
        signals: corrected scaling, by signal.
        listings: which named values of its signals are measurements.
        bits: which bits of its signals are switches, by signal.
    """
    value = config.multiplexor
    length = frame_length(message)
    if isinstance(of_value := _of_value(message, value), str):
        return of_value
    for name, one in signals.items():
        of_value = [scaled(s, one) if s.name == name else s for s in of_value]
    for listing in listings:
        of_value = [listing.without_values(s) if s.name in listing.signals else s for s in of_value]
    if bits:
        of_value = [part for s in of_value for part in _cut(s, bits)]
    own = length == message.length and config.cycle_ms is None
    if own and not bits and all(map(is_, of_value, message.signals)):
        return message
    return Message(
        message.frame_id,
        message.name,
        length,
        of_value,
        cycle_time=message.cycle_time if config.cycle_ms is None else config.cycle_ms,
        comment=message.comments,
        senders=message.senders,
        dbc_specifics=message.dbc,
        is_extended_frame=message.is_extended_frame,
        is_fd=message.is_fd,
        protocol=message.protocol,
    )


def chosen(message: Message, config: Protected) -> Chosen | None:
    """Return which frames of a message count by the section's multiplexor value; None for all."""
    signal = multiplexor(message)
    if config.multiplexor is None or signal is None:
        return None
    protecting = {config.alive_counter, config.checksum.signal if config.checksum else None}
    alone = any(s.multiplexer_ids for s in message.signals if s.name in protecting)
    return Chosen(signal.name, config.multiplexor, alone)


def multiplexor(message: Message) -> Signal | None:
    """Return the only multiplexor of a message; None where it has none, or several."""
    signals = [s for s in message.signals if s.is_multiplexer]
    chosen_by = {s.multiplexer_signal for s in message.signals if s.multiplexer_ids}
    return signals[0] if len(signals) == 1 and chosen_by <= {signals[0].name} else None


def _of_value(message: Message, value: int | None) -> list[Signal] | str:
    """Return the signals present at this multiplexor value (None: all), or why it is wrong."""
    if value is None:
        return list(message.signals)
    signal = multiplexor(message)
    if signal is None:
        return f"expected a message with one multiplexor, got {message.name}"
    low, high = raw_limits(signal)
    named = {i for s in message.signals for i in s.multiplexer_ids or ()}
    values = sorted(i for i in named if low <= i <= high)
    if value not in values:
        names = ", ".join(map(str, values))
        return f"expected a value of {signal.name}, got {value}; there are {names}"
    result = []
    for one in message.signals:
        if one.multiplexer_ids is None or value in one.multiplexer_ids:
            there = copy(one)
            there.is_multiplexer, there.multiplexer_ids = False, None
            there.multiplexer_signal = None
            if one is signal:
                there.raw_initial = value
            result.append(there)
    return result


def scaled(signal: Signal, correction: Correction) -> Signal:
    """Return the signal with the scaling of the deployment file, and 0 at zero command."""
    scaling = correction.scaling
    result = copy(signal)
    result.offset -= scaling.zero or 0.0
    step = abs(signal.scale) * (1.0 + STEP_ROUNDING)
    if scaling.full is not None:
        low, high = (0.0 if correction.magnitude else -scaling.full), scaling.full
        # Two's complement reaches one step farther on one side.
        reached = [raw * signal.scale + result.offset for raw in raw_limits(signal)]
        if not signal.is_float and not correction.magnitude:
            low = min(reached) if 0.0 < low - min(reached) <= step else low
            high = max(reached) if 0.0 < max(reached) - high <= step else high
        result.minimum, result.maximum = low, high
    elif scaling.zero and signal.minimum is not None and signal.maximum is not None:
        result.minimum, result.maximum = (
            signal.minimum - scaling.zero,
            signal.maximum - scaling.zero,
        )
    if scaling.invert:
        result.scale, result.offset = -result.scale, -result.offset
        ends = [None if end is None else -end for end in (result.maximum, result.minimum)]
        result.minimum, result.maximum = ends
    return result
