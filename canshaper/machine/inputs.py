"""Binds received messages to their DBC messages: all but the velocities of joysticks."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

from cantools.database.can import Message, Signal

from canshaper.codec.frame import NULL, MessageKey, at_every_priority, has_destination, with_source
from canshaper.codec.layout import Chosen, Layout, is_j1939
from canshaper.codec.message import Protection
from canshaper.codec.signals import LENGTHS, ends_fault, find_signal, radius_range
from canshaper.config.crane import Radius
from canshaper.config.filters import LoadState, ProfileSwitch
from canshaper.config.inputs import InputSection
from canshaper.config.limits import Ends, OtherFlow, Position, RopeSection
from canshaper.config.schema import EmergencyStop, FeedbackSection, StatusWord
from canshaper.config.source import Place
from canshaper.machine.lookup import Lookup
from canshaper.machine.protections import bind_protection
from canshaper.machine.used_message import ENABLE, STOP, UsedMessage, key_path

Choosing = LoadState | ProfileSwitch
"""Sections whose value selects parameters: the load state, and the operator's profile."""
Section_co = TypeVar("Section_co", bound=InputSection, covariant=True)


@dataclass(frozen=True)
class Bound(Generic[Section_co]):
    """A received message, bound to the DBC.

    Attributes:
        config: section of the deployment file.
        message: definition of the message in the DBC, with the file's corrections.
        layout: decodes its signals.
        protection: protection of its frames.
        chosen: which frames count, where the message is multiplexed.
    """

    config: Section_co
    message: Message
    layout: Layout
    protection: Protection
    chosen: Chosen | None

    @property
    def key(self) -> MessageKey:
        """(bus, id, extended) of its frames; in J1939 with the source address, 254 for any."""
        can_id, source = self.message.frame_id, self.config.source
        if source is not None:
            can_id = with_source(can_id, source)
        return self.config.bus, can_id, self.message.is_extended_frame

    @property
    def keys(self) -> list[MessageKey]:
        """Every key that its frames may have: in J1939, with a known source, each priority."""
        bus, can_id, extended = self.key
        if not is_j1939(self.message) or self.any_source:
            return [self.key]
        return [(bus, one, extended) for one in at_every_priority(can_id)]

    @property
    def any_source(self) -> bool:
        """Whether the message may come from any source address."""
        return is_j1939(self.message) and self.key[1] & 0xFF == NULL

    @property
    def by_group(self) -> bool:
        """Whether its frames are recognised by group and source, at any priority."""
        return is_j1939(self.message) and not has_destination(self.message.frame_id)


BoundInput = Bound[InputSection]
"""A received message of any section."""


@dataclass(frozen=True)
class BoundValue(Bound[Section_co]):
    """A message of which one signal is read: a radius, a weight, a choice, a flow."""

    signal: Signal


AnySection = TypeVar("AnySection", bound=InputSection)
AnyValue = TypeVar("AnyValue", LoadState, ProfileSwitch, LoadState | ProfileSwitch, FeedbackSection)
AnyPosition = TypeVar("AnyPosition", bound=Position)
# Keys of a section that describe its message: equal in every section that reads the message.
OF_MESSAGE = tuple(InputSection.model_fields)


def bind_input(
    lookup: Lookup,
    place: Place,
    config: AnySection,
    switches: tuple[str, ...] = (),
    *,
    enable: Iterable[tuple[Place, str]] = (),
    value: str | None = None,
) -> tuple[UsedMessage, Bound[AnySection]] | None:
    """Bind a received message: its switches, its cycle and its protection.

    Args:
        lookup: shared data of the deployment.
        place: place of the section in the deployment file.
        config: the section.
        switches: keys of the section that name switches.
        enable: signals that enable joysticks, each with the place that names it.
        value: name of a signal that is a value and no switch.

    Returns:
        The message with its uses, and the bound message; None where the message does not exist.
    """
    used = lookup.message(place, config, received=True, source=config.source)
    if not used:
        return None
    if used.message.cycle_time or isinstance(config, Position):  # which may come on change only
        lookup.check_timeout(used, config.timeout_ms)
    else:
        used.add_fault("has no GenMsgCycleTime; cycle_ms may say it")
    for at, signal in enable:
        used.integer(at, signal, "enable")
        used.check_switch(at, signal, {1: "on"}, "not on", ENABLE)
    for key in switches:
        used.integer((*place, key), getattr(config, key), key)
    if value is not None:
        used.uses[value] = "signal"
    protection = bind_protection(used, config)
    most = protection.counts // 2
    # With a larger step than half of the counter's range, a step back would count as one forward.
    if protection.counts and (config.alive_max_step or 0) > most:
        text = f"expected up to {most} with a counter of {protection.counts} values"
        used.add("alive_max_step", f"{text}, got {config.alive_max_step}")
    return used, Bound(config, used.message, Layout(used.message), protection, used.chosen)


def bind_emergency_stop(lookup: Lookup, config: EmergencyStop) -> Bound[EmergencyStop] | None:
    """Bind the emergency stop; None where its message is missing."""
    if (result := bind_input(lookup, ("emergency_stop",), config, ("signal",))) is None:
        return None
    used, bound = result
    used.check_switch(("emergency_stop", "signal"), config.signal, {0: "free"}, "stop", STOP)
    check_source(used, "the emergency stop")
    return bound


def bind_radius(lookup: Lookup, place: Place, config: Radius) -> BoundValue[Radius] | None:
    """Bind the measured radius of the tip; None where its message or signal is missing."""
    if (result := _bind_position(lookup, place, config, "the radius")) is None:
        return None
    used, bound = result
    used.add_fault(radius_range(bound.signal))
    return bound


def bind_ends(lookup: Lookup, place: Place, config: Ends) -> BoundValue[Ends] | None:
    """Bind the position of an axis with end stops; None where message or signal is missing."""
    if (result := _bind_position(lookup, place, config, "a position")) is None:
        return None
    _check_range(lookup, place, result, ("lowest", "highest"), "a position")
    return result[1]


def bind_rope(lookup: Lookup, place: Place, config: RopeSection) -> BoundValue[RopeSection] | None:
    """Bind the measured length of a rope; None where its message or signal is missing."""
    if (result := _bind_position(lookup, place, config, "a length")) is None:
        return None
    used, bound = result
    signal = bound.signal
    if signal.unit not in LENGTHS:
        used.add_fault(f"{signal.name}: expected a length in m, got a signal in {signal.unit}")
    elif fault := ends_fault(signal, "what lies outside is no length"):
        used.add_fault(fault)
    else:
        low, high = (
            float(end or 0.0) + config.offset_m for end in (signal.minimum, signal.maximum)
        )
        for key in ("lowest_m", "highest_m"):
            if not low <= (value := getattr(config, key)) <= high:
                text = f"expected a length within the range of {signal.name}, {low:g} to {high:g} m"
                lookup.diagnostics.add((*place, key), f"{text}, got {value:g}")
    return bound


def bind_others(lookup: Lookup, place: Place, config: OtherFlow) -> BoundValue[OtherFlow] | None:
    """Bind the flow of functions that are not ours; None where message or signal is missing."""
    if (result := _bind_position(lookup, place, config, "a flow")) is None:
        return None
    _check_range(lookup, place, result, ("full",), "a flow")
    return result[1]


def _check_range(
    lookup: Lookup,
    place: Place,
    result: tuple[UsedMessage, BoundValue[AnyPosition]],
    keys: Iterable[str],
    what: str,
) -> None:
    """Check that a signal has a range, and that the values of these keys lie in the range."""
    used, bound = result
    signal = bound.signal
    if fault := ends_fault(signal, f"what lies outside is not {what}"):
        used.add_fault(fault)
        return
    low, high = signal.minimum or 0.0, signal.maximum or 0.0
    for key in keys:
        if not low <= (value := getattr(bound.config, key)) <= high:
            text = f"expected {what} within the range of {signal.name}, [{low:g}|{high:g}]"
            lookup.diagnostics.add((*place, key), f"{text}, got {value:g}")


def _bind_position(
    lookup: Lookup, place: Place, config: AnyPosition, what: str
) -> tuple[UsedMessage, BoundValue[AnyPosition]] | None:
    """Bind ``what``, a position in a message of its own or in one that other sections read too."""
    key = (config.bus, config.message)
    first = lookup.positions.get(key)
    if alone := first is None:
        if (result := bind_input(lookup, place, config, value=config.signal)) is None:
            return None
        check_source(result[0], what)
        first = lookup.positions[key] = result
    used, bound = first
    text = f"{key_path(used.place)}, which reads the message too"
    lookup.diagnostics.check_same(place, config, OF_MESSAGE, bound.config, text)
    signal = used.find((*place, "signal"), config.signal)
    if signal is None:
        return None
    if not alone and used.uses.get(signal.name) != "signal":  # two parts may read one position
        used.use((*place, "signal"), signal, "signal")
    used.check_errors(signal)
    return used, BoundValue(**{**vars(bound), "config": config}, signal=signal)


def bind_status_word(lookup: Lookup, place: Place, config: StatusWord) -> Bound[StatusWord] | None:
    """Bind the CiA 408 status word of a valve; None where its message is missing."""
    if (result := bind_input(lookup, place, config, ("signal",))) is None:
        return None
    used, bound = result
    if signal := find_signal(used.message, config.signal):
        used.check_state_bits((*place, "signal"), signal)
    return bound


def bind_switch(lookup: Lookup, place: Place, config: Choosing) -> BoundValue[Choosing] | None:
    """Bind load state or the operator's choice; None where message or signal is missing."""
    if (result := _bind_value(lookup, place, config)) is None:
        return None
    used, bound = result
    if isinstance(config, ProfileSwitch):
        used.check_integer((*place, "signal"), bound.signal)
    return bound


def bind_feedback(
    lookup: Lookup, place: Place, config: FeedbackSection
) -> BoundValue[FeedbackSection] | None:
    """Bind the feedback of a valve; None where its message or signal is missing."""
    if (result := _bind_value(lookup, place, config)) is None:
        return None
    used, bound = result
    if config.full is None and not bound.signal.maximum:
        text = "expected a range in the DBC, or full, got neither"
        used.add_fault(f"{bound.signal.name}: {text}")
    return bound


def _bind_value(
    lookup: Lookup, place: Place, config: AnyValue
) -> tuple[UsedMessage, BoundValue[AnyValue]] | None:
    """Bind a message of which one signal is read; None where one of both is missing."""
    if (result := bind_input(lookup, place, config, value=config.signal)) is None:
        return None
    used, bound = result
    signal = used.find((*place, "signal"), config.signal)
    if signal is None:
        return None
    if not isinstance(config, ProfileSwitch):  # a code that the file does not list selects nothing
        used.check_errors(signal)
    return used, BoundValue(**vars(bound), signal=signal)


def check_source(used: UsedMessage, what: str) -> None:
    """Check that the file or the DBC names the source address of a message.

    Without it the first sender would count, and no other.
    """
    if used.any_source:
        text = f"missing: in the DBC {used.message.name} may come from any source address"
        used.add("source", f"{text}; {what} needs a known one")
