"""Deployment file and DBC files brought together: codecs, or every problem at once."""

import math
from collections.abc import Mapping
from pathlib import Path

from canshaper.codec.frame import (
    ACKNOWLEDGE,
    CLAIMED,
    DM1,
    NULL,
    REQUEST,
    TRANSPORT,
    TRANSPORT_DATA,
    WITHOUT_PRIORITY,
    claims_of,
    group_of,
    identifier,
    pgn_of,
    sent_by,
)
from canshaper.codec.layout import is_j1939
from canshaper.codec.signals import code_fault, special_name
from canshaper.codec.status import IDENTITY, SERVICE_STATUS
from canshaper.config.load import load_config
from canshaper.config.schema import DeploymentConfig
from canshaper.config.source import Diagnostics, Place
from canshaper.errors import ConfigError
from canshaper.machine.axes import bind_axes
from canshaper.machine.buses import check_buses, check_gateway
from canshaper.machine.deployment import Deployment, bind_motions
from canshaper.machine.filters import check_control, check_profiles
from canshaper.machine.identity import Identity, bind_status, filter_lines
from canshaper.machine.inputs import (
    BoundValue,
    Choosing,
    bind_emergency_stop,
    bind_others,
    bind_switch,
)
from canshaper.machine.joysticks import (
    BoundJoystick,
    bind_joystick,
    bind_switches,
    check_conditions,
    check_following,
)
from canshaper.machine.lookup import Lookup, load_messages, protected_sections
from canshaper.machine.named_codes import values_of_schedules
from canshaper.machine.used_message import UsedMessage, key_path


def load_deployment(path: Path, inside: Path | None = None) -> Deployment:
    """Load a deployment file with its DBC files.

    Args:
        path: the deployment file.
        inside: directory outside of which no DBC file is read, for files that others made.

    Raises:
        ConfigError: with every problem of all files.
    """
    config, source = load_config(path)
    diagnostics = Diagnostics(source)
    check_buses(diagnostics, config)
    check_names(diagnostics, config)
    messages = load_messages(diagnostics, config, path.parent, inside)
    if messages is None:
        raise ConfigError(diagnostics.problems)
    lookup = Lookup(diagnostics, config, messages)
    check_conditions(lookup)
    joysticks = {name: bind_joystick(lookup, name, one) for name, one in config.joysticks.items()}
    switches = bind_switches(lookup)
    axes = bind_axes(lookup)
    motions = bind_motions(lookup)
    _check_crane(lookup)
    measured = config.hydraulics.others_measured if config.hydraulics else None
    others = bind_others(lookup, ("hydraulics", "others_measured"), measured) if measured else None
    stop = bind_emergency_stop(lookup, config.emergency_stop) if config.emergency_stop else None
    load_state = (
        bind_switch(lookup, ("load_state",), config.load_state) if config.load_state else None
    )
    profile = _bind_profile(lookup)
    if load_state:
        _check_values(lookup, load_state, values_of_schedules(config))
    status, status_ticks = bind_status(lookup, ("status",), config.status, SERVICE_STATUS)
    identity_status, _ = bind_status(lookup, ("identity",), config.identity, IDENTITY)
    if config.gateway:
        check_gateway(lookup, config.gateway, [axis.valve.message for axis in axes.values()])
    _check_together(lookup, joysticks)
    diagnostics.raise_problems()
    digests = {n: f.sha256 for n, f in zip(config.dbc, messages.files, strict=True)}
    return Deployment(
        path=path,
        config=config,
        messages=messages,
        joysticks={name: joystick for name, joystick in joysticks.items() if joystick},
        axes=axes,
        motions=motions,
        other_flow=others,
        emergency_stop=stop,
        status=status,
        status_ticks=status_ticks,
        identity=Identity(source.sha256, digests, _package_lines(config)),
        identity_status=identity_status,
        load_state=load_state,
        profile=profile,
        switches=switches,
        on_bus=lookup.on_bus(),
        fd=lookup.fd(),
        source=source,
        codes=lookup.codes(),
        starts=lookup.starts(),
    )


def _check_crane(lookup: Lookup) -> None:
    """Check that each coordinate of the crane has an axis of its own."""
    crane, taken = lookup.config.crane, dict[str, str]()
    for key, name in crane.moved.items() if crane else ():
        place = ("crane", key)
        if lookup.diagnostics.check_name(place, "an axis", name, lookup.config.axes):
            if name in taken:
                text = f"expected an axis of its own, got {name!r}, that of {taken[name]}"
                lookup.diagnostics.add(place, text)
            taken.setdefault(name, key)


def _check_together(lookup: Lookup, joysticks: Mapping[str, BoundJoystick | None]) -> None:
    """Check what can only be checked when all parts are bound."""
    diagnostics, config = lookup.diagnostics, lookup.config
    lookup.check_groups()
    check_ids(lookup)
    check_following(diagnostics, config, joysticks)
    check_profiles(diagnostics, config)
    check_control(diagnostics, config)
    for name in config.hydraulics.shares if config.hydraulics else ():
        diagnostics.check_name(("hydraulics", "shares", name), "an axis", name, config.axes)


def _bind_profile(lookup: Lookup) -> BoundValue[Choosing] | None:
    """Bind the switch or display that selects the profile; None if the file has none."""
    config = lookup.config.profile
    profile = bind_switch(lookup, ("profile",), config) if config else None
    if profile and config:
        codes = config.codes.items()
        _check_values(lookup, profile, {("profile", "codes", name): code for name, code in codes})
        first: dict[int, str] = {}
        for name, code in codes:
            signal, place = profile.signal, ("profile", "codes", name)
            raw = (code - signal.offset) / signal.scale if signal.scale else math.inf
            if first.setdefault(code, name) != name:
                text = f"expected a code of its own, got {code}, that of {first[code]}"
                lookup.diagnostics.add(place, text)
            elif not raw.is_integer() or code_fault(signal, int(raw)):
                text = f"{signal.name} can never be {code}: expected a value of it, or no profile"
                lookup.diagnostics.add(place, text)
    return profile


def _package_lines(config: DeploymentConfig) -> tuple[str, ...]:
    """Return the log lines of the packages whose checksums or filters this machine may run.

    Breakpoints add no filter kind: they have the kind of their axis or profile.
    """
    checksums = {s.checksum.kind or "" for s in protected_sections(config) if s.checksum}
    axes = config.axes.values()
    filters = {axis.filter.kind for axis in axes}
    filters |= {profile.filter.kind for axis in axes for profile in axis.profiles.values()}
    lines: tuple[str, ...] = ()
    if checksums:
        from canshaper.checksums.kinds import package_line

        lines = tuple(line for kind in sorted(checksums) if (line := package_line(kind)))
    return (*lines, *filter_lines(filters))


def _check_values(
    lookup: Lookup, switch: BoundValue[Choosing], values: Mapping[Place, float]
) -> None:
    """Report values of the file that the DBC names as an error, as they never select anything."""
    signal = switch.signal
    for place, value in values.items():
        if name := special_name(signal, value):
            text = f"expected a value of {signal.name} that the DBC names no error"
            lookup.diagnostics.add(place, f"{text}, got {value:g}, {name}")


# J1939 groups of address management and of the transport protocol for long messages.
PROTOCOL = {
    REQUEST: "request",
    CLAIMED: "address claim",
    ACKNOWLEDGE: "acknowledgement",
    TRANSPORT: "transport",
    TRANSPORT_DATA: "transport data",
}


def check_names(diagnostics: Diagnostics, config: DeploymentConfig) -> None:
    """Check that no two buses, joysticks, switches or axes differ in case or outer spaces only."""
    for key, what in (
        ("buses", "bus"),
        ("joysticks", "joystick"),
        ("switches", "switch"),
        ("axes", "axis"),
    ):
        names: dict[str, str] = {}
        for name in getattr(config, key):
            if (first := names.setdefault(name.strip().casefold(), name)) != name:
                text = f"expected a name that no one takes for {what} {first}, got {name!r}"
                diagnostics.add((key, name), f"{text}: a key that means the other one moves it")


def check_ids(lookup: Lookup) -> None:
    """Check that no J1939 message has the id of another message, or of our own node.

    Two messages of J1939, or two others, are compared where ``Lookup.message`` finds them.
    """
    seen: dict[tuple[str, int], UsedMessage] = {}
    for (bus, _, extended), used in lookup.used.items():
        if not extended:
            continue
        if fault := _fault_of_node(lookup, bus, used):
            used.add("message", fault)
        key = (bus, used.can_id & WITHOUT_PRIORITY)
        other = seen.setdefault(key, used)
        if is_j1939(other.message) != is_j1939(used.message):
            text = f"{used.message.name} has the id {used.can_id:#x} of"
            text += f" {other.message.name}, which {key_path(other.place)} uses: one would be taken"
            used.add("message", f"{text} for the other; expected another id, or VFrameFormat alike")
    _check_sources(lookup)


def _fault_of_node(lookup: Lookup, bus: str, used: UsedMessage) -> str | None:
    """Return a fault if our own J1939 node sends or waits for this message; else None."""
    own = lookup.own_address(bus)
    if own is None:
        return None
    sent = (*claims_of(own), *sent_by(own), identifier(REQUEST, NULL))
    ours = {one & WITHOUT_PRIORITY for one in sent}
    pgn = pgn_of(used.can_id)
    name = PROTOCOL.get(pgn, "DM1" if pgn == DM1 else None)
    meant = used.can_id & WITHOUT_PRIORITY in ours
    if not meant and not (is_j1939(used.message) and pgn in PROTOCOL):
        return None
    text = f"{used.message.name} has the id {used.can_id:#x}, {name} of J1939, which our node on"
    return f"{text} bus {bus} uses itself: expected a message with another id"


def _check_sources(lookup: Lookup) -> None:
    """Check that a group is not received from any source address and also from a certain one."""
    read = [
        (bus, used)
        for (bus, _, _), used in lookup.used.items()
        if is_j1939(used.message) and used.can_id & 0xFF != lookup.own_address(bus)
    ]
    any_source = {(bus, group_of(used.can_id)): used for bus, used in read if used.any_source}
    for bus, used in read:
        other = any_source.get((bus, group_of(used.can_id)))
        if other is not None and not used.any_source:
            text = f"expected the source address of {other.message.name}, got any source:"
            text += f" frames of {used.message.name}, from {used.can_id & 0xFF:#04x}, are of its"
            other.add("source", f"{text} group and would be taken for it")
