"""Meaning of values that a DBC names (VAL_): a fault, unless the deployment file says a value."""

import json
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass

from cantools.database.can import Signal

from canshaper.codec.signals import find_signal, full_scale, in_range, is_neutral, named_fault
from canshaper.config.filters import Profile
from canshaper.config.inputs import Meaning
from canshaper.config.schema import AxisSection, DeploymentConfig
from canshaper.config.source import Place
from canshaper.errors import there_are
from canshaper.machine.used_message import NamedCode, UsedMessage, key_path


@dataclass(frozen=True)
class Listing:
    """The signals of one section, and which of their named values are measurements.

    Attributes:
        place: place of the key ``codes`` in the file.
        signals: names of the signals.
        codes: meaning of named values, by name.
        values: values that other keys of the file use, which makes them measurements.
        moves: the axis that the signals move; None where they move none.
        choice: True: every value counts that is not named as an error, as of a profile's code,
            which selects nothing unless the file lists it.
    """

    place: Place
    signals: tuple[str, ...]
    codes: Mapping[str, Meaning]
    values: frozenset[float] = frozenset()
    moves: str | None = None
    choice: bool = False

    def is_value(self, name: str, value: float) -> bool:
        """Return whether a named value is a measurement by the file."""
        if meaning := self.codes.get(name):
            return meaning == "value"
        return not named_fault(name) and (self.choice or value in self.values)

    def without_values(self, signal: Signal) -> Signal:
        """Return the signal without the names of measurements: the names left are faults."""
        choices = signal.choices or OrderedDict()
        values = [r for r, n in choices.items() if self.is_value(str(n), _value(signal, r))]
        if not values:
            return signal
        result = copy(signal)
        result.choices = OrderedDict((r, n) for r, n in choices.items() if r not in values)
        return result


def listings(config: DeploymentConfig) -> dict[tuple[str, str], list[Listing]]:
    """Return a listing of every signal that is read as a number, by bus and message."""
    result: dict[tuple[str, str], list[Listing]] = {}

    def add(bus: str, message: str, listing: Listing) -> None:
        result.setdefault((bus, message), []).append(listing)

    for name, axis in config.axes.items():
        command, joystick = axis.command, config.joysticks.get(axis.command.joystick)
        signals = (command.signal, *([command.negative] if command.negative else ()))
        place: Place = ("axes", name, "command", "codes")
        if joystick:
            listing = Listing(place, signals, command.codes, moves=name)
            add(joystick.bus, joystick.message, listing)
        for key, section in (
            (("feedback",), axis.feedback),
            (("sway_sensor",), axis.sway_sensor),
            (("limits", "ends"), axis.limits.ends),
            (("sway", "length"), axis.sway.length if axis.sway else None),
        ):
            if section:
                place = ("axes", name, *key, "codes")
                add(section.bus, section.message, Listing(place, (section.signal,), section.codes))
    for name, motion in config.motion.items():
        if one := motion.radius:
            listing = Listing(("motion", name, "radius", "codes"), (one.signal,), one.codes)
            add(one.bus, one.message, listing)
    if config.hydraulics and (others := config.hydraulics.others_measured):
        listing = Listing(
            ("hydraulics", "others_measured", "codes"), (others.signal,), others.codes
        )
        add(others.bus, others.message, listing)
    if load := config.load_state:
        values = frozenset(values_of_schedules(config).values())
        listing = Listing(("load_state", "codes"), (load.signal,), load.codes, values)
        add(load.bus, load.message, listing)
    if profile := config.profile:
        listing = Listing(("profile", "codes"), (profile.signal,), {}, choice=True)
        add(profile.bus, profile.message, listing)
    return result


def values_of_schedules(config: DeploymentConfig) -> dict[Place, float]:
    """Return the breakpoints of all gain schedules (values of the load state), by place."""
    parts: dict[Place, AxisSection | Profile] = {}
    for name, axis in config.axes.items():
        parts["axes", name] = axis
        parts |= {
            ("axes", name, "profiles", profile): part for profile, part in axis.profiles.items()
        }
    return {
        (*place, "gain_schedule", i, "breakpoint"): one.breakpoint
        for place, part in parts.items()
        for i, one in enumerate(part.gain_schedule)
    }


def check_codes(used: UsedMessage, in_dbc: Iterable[Signal], listing: Listing) -> None:
    """Record what named values mean; report undecided ones, and names that the DBC lacks.

    Args:
        used: the message, which collects the meanings.
        in_dbc: signals of the DBC with all their named values.
        listing: the signals of the section.
    """
    named = [s for s in in_dbc if s.name in listing.signals and s.choices]
    names = list(dict.fromkeys(str(n) for s in named for n in (s.choices or {}).values()))
    for name in listing.codes:
        if name not in names:
            text = f"expected a value of {' and '.join(listing.signals)} that the DBC names"
            text += f", got {name!r}{there_are(name, names)}"
            used.diagnostics.add((*listing.place, name), text)
    for one in named:
        if (signal := find_signal(used.message, one.name)) is None:
            continue
        for raw, choice in (one.choices or {}).items():
            means = _meaning(used, listing, signal, raw, str(choice))
            used.codes.append(NamedCode(used.message.name, one.name, raw, str(choice), means))


def is_guess(signal: Signal, raw: float, name: str) -> bool:
    """Return whether the DBC leaves it open if a named value is a measurement or a fault."""
    if named_fault(name) or is_neutral(signal, raw, name):
        return False
    return in_range(signal, _value(signal, raw))


def _meaning(used: UsedMessage, listing: Listing, signal: Signal, raw: float, name: str) -> str:
    """Return the meaning of a named value in words; report it where the file has to decide."""
    value, neutral, listed = _value(signal, raw), is_neutral(signal, raw, name), listing.codes
    needed = "value" if neutral else "fault" if not in_range(signal, value) else None
    if needed and listed.get(name, needed) != needed:
        why = "neutral" if neutral else "out of the range"
        text = f"expected {needed} for {value:g} of {signal.name}, which is {why}"
        used.diagnostics.add((*listing.place, name), f"{text}, got {listed[name]}")
    if neutral or listing.is_value(name, value):
        return _effect(listing, signal, value)
    if is_guess(signal, raw, name) and name not in listed:
        would = _effect(listing, signal, value)
        used.add_fault(
            f"{signal.name}: expected {key_path(listing.place)} to say whether {raw}"
            f' "{name}" is a value ({would}) or a fault, got neither;'
            f" write codes: {{ {json.dumps(name, ensure_ascii=False)}: fault }}"
        )
    reason = named_fault(name)
    return f"fault ({reason.name})" if reason and listing.moves else "fault"


def _effect(listing: Listing, signal: Signal, value: float) -> str:
    """Return the effect of a value in words."""
    if listing.moves is None:
        return f"{value:g} {signal.unit or ''}".strip()
    if not value:
        return "neutral"
    full = full_scale(signal)
    part = max(min(value / full, 1.0), -1.0) if full else 0.0
    sign = -1 if signal.name in listing.signals[1:] else 1
    return f"moves {listing.moves} at {100.0 * sign * part:.0f} %"


def _value(signal: Signal, raw: float) -> float:
    """Return the value of a raw value in the unit of the DBC."""
    return float(raw * signal.scale + signal.offset)
