"""Checks of buses and gateway of a deployment file: options, contradictions; load of a bus."""

from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass
from importlib import import_module
from inspect import Parameter, signature
from itertools import takewhile
from typing import Any, get_type_hints

from cantools.database.can import Message
from pydantic import PydanticSchemaGenerationError, TypeAdapter, ValidationError

from canshaper.codec.layout import is_fd
from canshaper.codec.message import SentMessage
from canshaper.config.bus import LAST_SPN, Bus, Gateway, J1939Name
from canshaper.config.schema import DeploymentConfig
from canshaper.config.source import Diagnostics, Place
from canshaper.errors import did_you_mean
from canshaper.machine.lookup import Lookup

# Characters of the name of an interface (linux/if.h, IFNAMSIZ less the end).
LONGEST_NAME = 15
# Interfaces that carry CAN FD without an option.
ALWAYS_FD = frozenset(("udp_multicast", "virtual"))
# Interfaces that take bit rate and switch of CAN FD without such a parameter (python-can 4.6).
UNNAMED_FD = frozenset(("kvaser", "neovi"))
# Parameters of python-can that other keys of the file give, or that the program sets.
OURS = frozenset(("channel", "bitrate", "can_filters", "receive_own_messages"))
OURS |= {"fd", "data_bitrate"}

# Types of parameters that python-can does not annotate.
UNTYPED = {"host": str, "port": int}


def option_faults(bus: Bus) -> Iterator[tuple[Place, str]]:
    """Yield (key in the section of the bus, fault) for its interface and options.

    Options of an interface whose module cannot be imported here are not checked.
    """
    if bus.interface == "socketcan":
        if bus.options:
            yield ("options",), "expected none with socketcan, which the system sets up, got some"
        return
    from can.interfaces import BACKENDS

    if bus.interface not in BACKENDS:
        text = f"expected an interface of python-can, got {bus.interface}"
        yield ("interface",), text + did_you_mean(bus.interface, BACKENDS)
        return
    module, name = BACKENDS[bus.interface]
    try:
        opens = getattr(import_module(module), name).__init__
    except Exception:  # each interface needs something else, which is not here
        return
    parameters = {
        key: parameter
        for key, parameter in list(signature(opens).parameters.items())[1:]
        if key not in OURS
        and parameter.kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
    }
    yield from _fd_faults(bus, signature(opens).parameters)
    for key, parameter in parameters.items():
        if parameter.default is Parameter.empty and key not in bus.options:
            yield ("options",), f"expected {key}, which {bus.interface} needs, got none"
    kinds = _kinds(opens)
    for key, value in bus.options.items():
        if key not in parameters:
            known = ", ".join(parameters) or "it has none"
            text = f"expected an option of {bus.interface} ({known}), got {key}"
            yield ("options", key), text + did_you_mean(key, parameters)
        elif fault := _value_fault(kinds.get(key, UNTYPED.get(key)), value):
            yield ("options", key), fault


def _fd_faults(bus: Bus, parameters: Container[str]) -> Iterator[tuple[Place, str]]:
    """Yield (key, fault) where an interface with these parameters lacks the bus's CAN FD keys."""
    if bus.interface in ALWAYS_FD | UNNAMED_FD:
        return
    for key, used in (("fd", bus.fd), ("data_bitrate", bus.fd and bus.data_bitrate)):
        if used and key not in parameters:
            yield (key,), f"expected an interface of python-can that takes it, got {bus.interface}"


def _kinds(opens: Any) -> dict[str, Any]:
    """Return the annotated types of the parameters, by name; {} if one of them is unknown here."""
    try:
        return get_type_hints(opens)
    except Exception:  # names that only a type checker knows
        return {}


def _value_fault(kind: Any, value: object) -> str | None:
    """Return why a value does not have a parameter's type; None where it does, or may."""
    if kind is None:
        return None
    try:
        TypeAdapter(kind).validate_python(value, strict=True)
    except PydanticSchemaGenerationError:  # a class of python-can, which converts the value itself
        return None
    except ValidationError:
        expected = kind.__name__ if isinstance(kind, type) else str(kind)
        return f"expected {expected}, got {value!r}"
    return None


def check_buses(diagnostics: Diagnostics, config: DeploymentConfig) -> None:
    """Check every bus: keys, options, node ids; that no two share channel, device or NAME."""
    add = diagnostics.add
    channels: dict[tuple[str, str], str] = {}
    names: dict[J1939Name, str] = {}
    for name, bus in config.buses.items():
        key = (bus.interface, bus.channel)
        if key in channels:
            add(("buses", name), f"has the channel {bus.channel} of bus {channels[key]}")
        channels[key] = name
        if bus.interface == "socketcan" and not (1 <= len(bus.channel) <= LONGEST_NAME):
            text = f"expected the name of an interface, 1 to {LONGEST_NAME} characters"
            add(("buses", name, "channel"), f"{text}, got {bus.channel!r}")
        _check_match(diagnostics, config, name, bus)
        _check_node_ids(diagnostics, name, bus)
        _check_fd(diagnostics, name, bus)
        if bus.network and bus.interface != "udp_multicast":
            text = f"expected true with udp_multicast only, got it with {bus.interface}"
            add(("buses", name, "network"), text)
        for place, text in option_faults(bus):
            add(("buses", name, *place), text)
        if bus.j1939 is None:
            continue
        # A gateway may bring both onto one bus, where nothing distinguishes them.
        if (other := names.setdefault(bus.j1939.name, name)) != name:
            text = f"is the NAME of bus {other}; each node needs one of its own:"
            add(("buses", name, "j1939", "name"), f"{text} another ecu_instance will do")
        last = bus.j1939.first_spn + 2 * len(config.axes) - 1
        if last > LAST_SPN:
            text = f"expected the last SPN up to {LAST_SPN}, got {last}"
            add(("buses", name, "j1939", "first_spn"), f"{text} from {bus.j1939.first_spn} on")


def _check_match(diagnostics: Diagnostics, config: DeploymentConfig, name: str, bus: Bus) -> None:
    """Check the section ``match`` of a bus, as far as possible without the device."""
    if bus.match is None:
        return
    place = ("buses", name, "match")
    if bus.interface != "socketcan":
        text = f"expected the interface socketcan with it, got {bus.interface}"
        diagnostics.add(place, text)
    rate = bus.match.bitrate
    if rate and bus.bitrate and rate != bus.bitrate:
        text = f"expected the bitrate of the bus, {bus.bitrate}, got {rate}"
        diagnostics.add((*place, "bitrate"), text)
    for other, before in takewhile(lambda item: item[0] != name, config.buses.items()):
        if before.match and bus.match.may_be(before.match):
            text = f"expected another serial, path or port than bus {other}"
            diagnostics.add(place, f"{text}, got what may be its device")


def _check_fd(diagnostics: Diagnostics, name: str, bus: Bus) -> None:
    """Check CAN FD: no data bit rate below the bit rate, and no protocol on top."""
    place = ("buses", name)
    if bus.data_bitrate is not None and not bus.fd:
        diagnostics.add((*place, "data_bitrate"), "expected it with fd: true, got it without")
    elif bus.data_bitrate is not None and bus.data_bitrate < (bus.bitrate or 0):
        text = f"expected the bitrate of the bus, {bus.bitrate}, or more, got {bus.data_bitrate}"
        diagnostics.add((*place, "data_bitrate"), text)
    for protocol in ("j1939", "canopen"):
        if bus.fd and getattr(bus, protocol):
            text = f"expected none on a bus of {protocol}, whose frames are classical, got true"
            diagnostics.add((*place, "fd"), text)


def _check_node_ids(diagnostics: Diagnostics, name: str, bus: Bus) -> None:
    """Check that no two CANopen nodes of a bus have the same id."""
    if bus.canopen is None:
        return
    owners = {bus.canopen.node: "node"}
    for node, config in bus.canopen.nodes.items():
        if config.id in owners:
            text = f"expected a node id of its own, got {config.id}, that of {owners[config.id]}"
            diagnostics.add(("buses", name, "canopen", "nodes", node, "id"), text)
        owners.setdefault(config.id, f"nodes.{node}")


def check_gateway(lookup: Lookup, gateway: Gateway, valves: list[SentMessage]) -> None:
    """Check the gateway against the buses, the messages and the valves that it forwards to.

    Args:
        lookup: shared data of the deployment.
        gateway: the gateway.
        valves: messages of the bound valves.
    """
    add, buses = lookup.diagnostics.add, lookup.config.buses
    for i, bus in enumerate(gateway.between):
        lookup.diagnostics.check_name(("gateway", "between", i), "a bus", bus, buses)
    fd = [buses[bus].fd for bus in gateway.between if bus in buses]
    if len({*fd}) > 1:
        add(("gateway", "between"), "expected fd: true of both buses or of none, got it of one")
    elif any(fd) and gateway.forwarding == "kernel":
        text = "expected daemon with fd: true: our rules of can-gw pass classical frames only"
        add(("gateway", "forwarding"), f"{text}; got kernel")
    for i, name in enumerate(gateway.blocked):
        if isinstance(result := lookup.messages.find(name), str):
            add(("gateway", "blocked", i), result)
    if gateway.fallback == "stop":
        return
    from canshaper.codec.rewrite import neutral_fault

    rewritten = [one for one in valves if one.rewrites]
    if not rewritten:
        text = "expected stop where no valve has the message of a joystick on the other bus"
        add(("gateway", "fallback"), f"{text}, got {gateway.fallback}")
    faults = {neutral_fault(s.protection, s.fields.message.length): s for s in rewritten}
    for fault, sender in faults.items():
        if fault and gateway.fallback == "neutral":
            name = sender.fields.message.name
            add(
                ("gateway", "fallback"),
                f"expected stop or pass, got neutral: {fault}, which {name} has",
            )


# Load above which a frame of low priority may wait for several others.
BUSY = 0.5


def longest_frame_bits(extended: bool, length: int) -> int:
    """Return the most bits of a data frame, stuff bits and interframe space included."""
    if extended:
        return 67 + 8 * length + (53 + 8 * length) // 4
    return 47 + 8 * length + (33 + 8 * length) // 4


def longest_fd_bits(extended: bool, length: int) -> tuple[int, int]:
    """Return the most bits of a CAN FD frame at the nominal bit rate, and at the data bit rate."""
    head = 36 if extended else 17
    stuffed_head = (head - 1) // 4
    content = 5 + 8 * length
    crc = 4 + 17 + 6 if length <= 16 else 4 + 21 + 7
    return head + stuffed_head + 13, content + (head + content - 1) // 4 - stuffed_head + crc


@dataclass(frozen=True)
class BusLoad:
    """Load of one bus.

    Attributes:
        share: part of the time in which the bus is busy, 0 to 1 (more is overload).
        messages: number of cyclic messages that make the load.
    """

    share: float
    messages: int


def bus_load(messages: Iterable[Message], bitrate: int, data_bitrate: int | None = None) -> BusLoad:
    """Return the load of a bus by its cyclic messages; messages without a cycle do not count.

    Args:
        messages: messages on the bus.
        bitrate: bit rate, bit/s.
        data_bitrate: bit rate of the data of CAN FD, bit/s, where it is another.
    """
    cyclic = [m for m in messages if m.cycle_time]
    share = 0.0
    for one in cyclic:
        per_s = 1000.0 / (one.cycle_time or 1)
        if is_fd(one):
            slow, fast = longest_fd_bits(one.is_extended_frame, one.length)
            share += (slow / bitrate + fast / (data_bitrate or bitrate)) * per_s
        else:
            share += longest_frame_bits(one.is_extended_frame, one.length) / bitrate * per_s
    return BusLoad(share, len(cyclic))
