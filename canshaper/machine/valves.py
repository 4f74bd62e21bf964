"""Binds valve messages to the DBC: each carries the command of one axis, or of several."""

import re
from dataclasses import dataclass
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from cantools.database.can import Message, Signal

from canshaper.codec.message import Protection, SentMessage
from canshaper.codec.sense import direction_fault
from canshaper.codec.signals import (
    command_fault,
    find_signal,
    magnitude_range,
    named_fault,
    raw_limits,
    set_point_fault,
    symmetrical_range,
)
from canshaper.codec.status import StatusCodec
from canshaper.codec.velocity import Direction, DirectionCodec, FlagsCodec, ValveCodec
from canshaper.config.enable import own_switch
from canshaper.config.limits import Ends, RopeSection
from canshaper.config.schema import (
    AxisSection,
    Command,
    DeploymentConfig,
    DirectionCodes,
    FeedbackSection,
    StatusWord,
    Valve,
)
from canshaper.config.source import Place
from canshaper.machine.inputs import Bound, BoundValue
from canshaper.machine.lookup import Lookup
from canshaper.machine.protections import bind_protection
from canshaper.machine.used_message import UsedMessage, key_path

if TYPE_CHECKING:
    from canshaper.machine.sway_sensor import BoundSwaySensor

# Longest cycle of a valve message: a valve learns of a stop no sooner than with its next frame.
SLOWEST_VALVE_MS = 200
# Cycles within the timeout of a valve: it may miss one frame fewer before it closes by itself.
FRAMES_PER_TIMEOUT = 3
# Keys of the section valve that describe the message: equal for all axes in it.
MESSAGE_KEYS = ("alive_counter", "checksum", "e2e", "cycle_ms", "multiplexor")
_FLOAT = re.compile("float", re.IGNORECASE)


@dataclass(frozen=True)
class SharedValve:
    """A bound valve message, kept for its other axes; it is sent every so many ``ticks``."""

    used: UsedMessage
    ticks: int
    config: Valve
    codec: SentMessage


SharedValves = dict[tuple[str, str], SharedValve]


def bind_valve(
    lookup: Lookup, shared_valves: SharedValves, place: Place, valve: Valve, command: Command
) -> tuple[ValveCodec, int] | None:
    """Bind the valve of an axis; return its codec and its period in ticks, None with problems.

    Args:
        lookup: shared data of the deployment.
        shared_valves: valve messages bound so far, by bus and name; a new one is added.
        place: place of the section in the deployment file.
        valve, command: the sections of the axis.
    """
    before = len(lookup.diagnostics.problems)
    name = _rewritten_joystick(lookup.config, valve)
    if name is not None:
        _check_rewritten(lookup, place, valve, command, name)
    shared = _bind_message(lookup, shared_valves, place, valve, name)
    if shared is None:
        return None
    used = shared.used
    _check_cycle(lookup, place, valve, shared)
    magnitude = bool(valve.direction or (name and (command.flags or command.negative)))
    signal = _bind_command(used, (*place, "signal"), valve.signal, magnitude)
    if signal:
        used.add_fault(command_fault(signal))
    also = [
        _bind_command(used, (*place, "also", i), other, magnitude)
        for i, other in enumerate(valve.also)
    ]
    lookup.check_node(place, valve.bus, valve.node)
    if cia408 := valve.cia408:
        lookup.check_node((*place, "cia408"), valve.bus, cia408.node)
        at: Place = (*place, "cia408", "control")
        if word := used.integer(at, cia408.control, key_path(at), signed=False):
            used.check_state_bits(at, word)
        if signal:
            used.add_fault(set_point_fault(signal))
    codec: Direction | None = None
    if valve.direction:
        codec = _bind_direction(used, (*place, "direction"), valve.direction)
    elif name and (flags := command.flags):
        codec = FlagsCodec((flags.neutral, flags.positive, flags.negative))
    negative = used.find((*place, "signal"), command.negative) if name else None
    if signal and negative and not _alike(signal, negative):
        used.add_fault(f"{negative.name}: expected a signal like {signal.name}, got another kind")
    if signal is None or not shared.ticks or len(lookup.diagnostics.problems) > before:
        return None
    return ValveCodec(shared.codec, signal, codec, [s for s in also if s], negative), shared.ticks


def _check_cycle(lookup: Lookup, place: Place, valve: Valve, shared: SharedValve) -> None:
    """Check that a valve message is sent often enough, for a stop and for the valve's timeout."""
    cycle_ms = shared.ticks * lookup.config.tick_ms
    least_ms = cycle_ms * FRAMES_PER_TIMEOUT
    if cycle_ms > SLOWEST_VALVE_MS:
        text = f"expected up to {SLOWEST_VALVE_MS} ms for a valve, got {cycle_ms} ms"
        shared.used.add_fault(f"GenMsgCycleTime: {text}")
    elif least_ms > valve.timeout_ms:
        text = (
            f"expected {least_ms} ms or more, three cycles of {shared.used.message.name}, so that"
        )
        text += f" two lost frames do not close it, got {valve.timeout_ms}"
        lookup.diagnostics.add((*place, "timeout_ms"), text)


def _rewritten_joystick(config: DeploymentConfig, valve: Valve) -> str | None:
    """Return the joystick whose frames leave as this valve message through the gateway, or None."""
    gateway = config.gateway
    if gateway is None or (bus := gateway.other(valve.bus)) is None:
        return None
    of = {(joystick.bus, joystick.message): name for name, joystick in config.joysticks.items()}
    return of.get((bus, valve.message))


def _check_rewritten(
    lookup: Lookup, place: Place, valve: Valve, command: Command, name: str
) -> None:
    """Check that only a joystick's own axes rewrite its frames, with the joystick's protection."""
    add, joystick = lookup.diagnostics.add, lookup.config.joysticks[name]
    if command.joystick != name:
        text = f"expected the message of joystick {command.joystick}, or one of no joystick"
        add((*place, "message"), f"{text}, got {valve.message!r} of joystick {name}")
    elif valve.signal != command.signal:
        text = f"expected the signal of its command, {command.signal!r}, in the message of its"
        add((*place, "signal"), f"{text} joystick, got {valve.signal!r}")
    for axis, other in lookup.config.axes.items():
        there = other.valve.bus, other.valve.message
        if other.command.joystick == name and there != (valve.bus, valve.message):
            text = f"expected {valve.message} on bus {valve.bus}, as the frames of joystick {name}"
            text += f" leave with this command in them, got {other.valve.message!r}"
            add(("axes", axis, "valve", "message"), text)
    for key in ("direction", "cia408", "full", "zero", "invert", "multiplexor"):
        if getattr(valve, key) not in (None, False):
            text = f"expected none in the message of joystick {name}, which has that of the command"
            add((*place, key), f"{text}, got one")
    text = f"joystick {name}, got another"
    lookup.diagnostics.check_same(place, valve, MESSAGE_KEYS, joystick, text)
    # Our frames for a lost joystick begin with the first tick after its timeout.
    lost_ms = joystick.timeout_ms + lookup.config.tick_ms
    if valve.timeout_ms <= lost_ms:
        text = f"expected more than {lost_ms} ms, a tick more than joystick {name}, whose receiver"
        text += f" must not give up before we do, got {valve.timeout_ms}"
        add((*place, "timeout_ms"), text)


def _bind_message(
    lookup: Lookup, shared_valves: SharedValves, place: Place, valve: Valve, joystick: str | None
) -> SharedValve | None:
    """Bind the message of a valve, or return it if another axis has bound it already."""
    key = (valve.bus, valve.message)
    if shared := shared_valves.get(key):
        text = f"the other axes of {valve.message}, got another"
        lookup.diagnostics.check_same(place, valve, MESSAGE_KEYS, shared.config, text)
        return shared
    # A joystick's message keeps the address of its sender, which is on the other bus.
    source = lookup.config.joysticks[joystick].source if joystick is not None else None
    used = lookup.message(place, valve, received=joystick is not None, source=source)
    if not used:
        return None
    ticks, protection = lookup.period(used), bind_protection(used, valve)
    if joystick is not None:
        codec = _rewritten_message(lookup.config, used, valve, joystick, protection)
    else:
        codec = lookup.sent(valve.bus, used.message, protection)
    shared_valves[key] = SharedValve(used, ticks, valve, codec)
    return shared_valves[key]


def _rewritten_message(
    config: DeploymentConfig, used: UsedMessage, valve: Valve, joystick: str, protection: Protection
) -> SentMessage:
    """Return the joystick message that we rewrite, with the switch that enables the joystick."""
    if (enable := own_switch(config, joystick)) is None:
        text = "expected one switch of its own message, where its frames leave through the gateway"
        used.diagnostics.add(("joysticks", joystick, "enable"), f"{text}, got another")
    elif "/" in enable:
        text = f"expected a whole signal, whose frames leave through the gateway, got {enable!r}"
        used.diagnostics.add(("joysticks", joystick, "enable"), text)
    if used.any_source:
        text = f"in the DBC {used.message.name} may come from any source address; where its frames"
        used.add("message", f"{text} leave, its joystick needs the key source")
    ours: set[str] = set()
    for axis in config.axes.values():
        if (axis.valve.bus, axis.valve.message) == (valve.bus, valve.message):
            command = axis.command
            ours |= {axis.valve.signal, *axis.valve.also}
            ours |= {command.negative} if command.negative else set()
            ours |= {*command.flags.model_dump().values()} if command.flags else set()
    at = valve.bus, used.message, used.can_id & 0xFF, protection
    if enable is None or find_signal(used.message, enable) is None:  # noted with the joystick
        return SentMessage(*at)
    from canshaper.codec.rewrite import RewrittenMessage

    return RewrittenMessage(*at, enable=enable, ours=frozenset(ours))


def _bind_command(used: UsedMessage, place: Place, name: str, magnitude: bool) -> Signal | None:
    """Bind the integer signal of a command, or of its ``magnitude``; None with a problem."""
    signal = used.find(place, name)
    if signal is None:
        return None
    if fault := magnitude_range(signal) if magnitude else symmetrical_range(signal):
        if not magnitude and not magnitude_range(signal):
            fault += "; with a direction it is right"
        used.add_fault(fault)
        return None
    used.check_integer(place, signal)
    used.check_errors(signal, command=True)
    used.use(place, signal, key_path(place))
    return None if signal.is_float else signal


def _bind_direction(
    used: UsedMessage, place: Place, config: DirectionCodes
) -> DirectionCodec | None:
    """Bind the signal with the direction of a command; None where it is missing."""
    at: Place = (*place, "signal")
    signal = used.integer(at, config.signal, key_path(at), signed=False)
    if signal is None:
        return None
    codes = (config.neutral, config.positive, config.negative)
    largest = raw_limits(signal)[1]
    for key, code in zip(("neutral", "positive", "negative"), codes, strict=True):
        name = next((str(n) for raw, n in (signal.choices or {}).items() if raw == code), "")
        if code > largest:
            text = f"expected up to {largest}, of {signal.length} bits of {signal.name}, got {code}"
            used.diagnostics.add((*place, key), text)
        elif direction_fault(name, moves=key != "neutral") or (name and named_fault(name)):
            text = f'expected a code of {key}, got {code}, in the DBC "{name}": the valve would'
            text += " rest" if key != "neutral" else " not rest"
            used.diagnostics.add((*place, key), text)
        elif _FLOAT.search(name):
            text = (
                f"expected no code of floating, which drops the load, got {code}, in the DBC {name}"
            )
            used.diagnostics.add((*place, key), text)
    return DirectionCodec(signal.name, codes)


def _alike(one: Signal, other: Signal) -> bool:
    """Return whether two signals have the same scaling, maximum and length."""
    kind = attrgetter("scale", "offset", "maximum", "length")
    return bool(kind(one) == kind(other))


@dataclass(frozen=True, kw_only=True)
class BoundAxis:
    """An axis with all its messages, bound to the DBC.

    Attributes:
        period_ticks: ticks from one command to the next.
        timeout_ms: longest time until its joystick, or a switch that enables it, counts as lost.
        status_ticks: ticks from one status message to the next.
    """

    name: str
    config: AxisSection
    valve: ValveCodec
    period_ticks: int
    timeout_ms: int
    status: StatusCodec[Any] | None
    status_ticks: int
    feedback: BoundValue[FeedbackSection] | None = None
    status_word: Bound[StatusWord] | None = None
    ends: BoundValue[Ends] | None = None
    sway_sensor: "BoundSwaySensor | None" = None
    rope: BoundValue[RopeSection] | None = None

    @property
    def valve_message(self) -> Message:
        """The DBC message of its valve."""
        return self.valve.message.fields.message

    @property
    def rewrites(self) -> bool:
        """Whether the command leaves through a gateway, in the frames of the axis' own joystick."""
        return self.valve.message.rewrites
