"""Routing table: the role of each frame on the buses, built once for a bound deployment.

Sockets filter by it; the controller, and tools that only listen, look frames up in it.
"""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from canshaper.codec.frame import (
    CLAIMED,
    EMERGENCY,
    HEARTBEAT,
    NMT,
    NULL,
    REQUEST,
    MessageKey,
    claims_of,
    group_of,
    identifier,
    sent_by,
)
from canshaper.codec.layout import is_j1939
from canshaper.config.bus import Bus
from canshaper.config.schema import DeploymentConfig
from canshaper.machine.inputs import BoundInput
from canshaper.machine.valves import BoundAxis


class Role(Enum):
    """Role of a frame with a certain id."""

    RECEIVED = "received"
    """A message that we receive."""
    NODE = "node"
    """Heartbeat or emergency of a node of CANopen."""
    VALVE = "valve"
    """Our command to a valve; from any other node it is a second sender's."""
    SENT = "sent"
    """Any other message that we send; from any other node it is a second sender's."""
    CLAIM = "claim"
    """Address message of our J1939 node: other nodes may send the same id."""


@dataclass(frozen=True, slots=True)
class Route:
    """Role of one id on one bus; ``input`` is the input that receives its frames, or None."""

    role: Role
    input: BoundInput | None = None


@dataclass(frozen=True, slots=True)
class GroupRoute:
    """Roles of one J1939 group on one bus.

    Attributes:
        inputs: inputs that receive frames of the group, at any priority.
        axes: names of the axes whose valves the group commands, from any source address.
        claims: whether nodes claim or request addresses with the group.
    """

    inputs: tuple[BoundInput, ...] = ()
    axes: tuple[str, ...] = ()
    claims: bool = False


@dataclass(frozen=True)
class BusRoutes:
    """Routes of one bus as sets of (id, extended), for its sockets.

    Attributes:
        received: messages that we receive by their id.
        sent: messages that we send, and no one else may send.
        valves: the messages among ``sent`` that command valves.
        known: all messages of the DBC files; any other message is a fault.
        received_groups: J1939 groups that we receive, from any source address.
        sent_groups: J1939 groups that we send, and no one else may send.
        claims: address messages of ours, whose echoes come back among the received groups.
        j1939: whether the bus is one of J1939, where unknown ids of 29 bits are normal.
        canopen: whether the bus is one of CANopen, where ids of SDO, SYNC and so on are normal.
        in_line: whether the bus is one of an inline gateway, which forwards every unknown id.
        fd: messages in frames of CAN FD, ours and those of others.
    """

    received: frozenset[tuple[int, bool]]
    sent: frozenset[tuple[int, bool]]
    valves: frozenset[tuple[int, bool]]
    known: frozenset[tuple[int, bool]]
    received_groups: frozenset[int] = frozenset()
    sent_groups: frozenset[int] = frozenset()
    claims: frozenset[tuple[int, bool]] = frozenset()
    j1939: bool = False
    canopen: bool = False
    in_line: bool = False
    fd: frozenset[tuple[int, bool]] = frozenset()


@dataclass(frozen=True)
class Routing:
    """Routing table of all buses.

    Attributes:
        routes: route of each id, by (bus, id, extended).
        groups: route of each J1939 group, by (bus, group).
        valves: names of the axes whose commands a message carries, whoever sends it.
        others: messages of the DBC files that we neither receive nor send.
        buses: routes of each bus, for its sockets.
    """

    routes: Mapping[MessageKey, Route]
    groups: Mapping[tuple[str, int], GroupRoute]
    valves: Mapping[MessageKey, tuple[str, ...]]
    others: frozenset[tuple[int, bool]]
    buses: Mapping[str, BusRoutes]

    @property
    def sent(self) -> frozenset[MessageKey]:
        """Messages that we send, and no one else may send."""
        return frozenset(k for k, r in self.routes.items() if r.role in (Role.VALVE, Role.SENT))

    def received(self, key: MessageKey) -> bool:
        """Return whether we receive a frame: id or group has a route, or no DBC file has the id."""
        bus, can_id, extended = key
        group = extended and (bus, group_of(can_id)) in self.groups
        return key in self.routes or group or key[1:] not in self.others


def grouped_inputs(inputs: Iterable[BoundInput]) -> dict[tuple[str, int], tuple[BoundInput, ...]]:
    """Return the inputs that are received by their J1939 group, by bus and group."""
    groups: dict[tuple[str, int], tuple[BoundInput, ...]] = {}
    for bound in inputs:
        if bound.by_group:
            key = (bound.config.bus, group_of(bound.key[1]))
            groups[key] = (*groups.get(key, ()), bound)
    return groups


def build_routing(
    config: DeploymentConfig,
    *,
    inputs: Sequence[BoundInput],
    axes: Iterable[BoundAxis],
    statuses: Iterable[MessageKey],
    known: Iterable[tuple[int, bool]],
    j1939: Container[str],
    fd: Iterable[MessageKey],
    listen_only: bool,
) -> Routing:
    """Build the routing table of a deployment.

    Args:
        config: the deployment file.
        inputs: every message that we receive.
        axes: the axes.
        statuses: status messages that we send.
        known: every message of the DBC files.
        j1939: buses on which a message of J1939 is used.
        fd: messages of CAN FD that are used.
        listen_only: whether we send only status, and another controller drives the valves.
    """
    axes = list(axes)
    valves: dict[MessageKey, tuple[str, ...]] = {}
    for axis in axes:
        key = axis.valve.message.key
        valves[key] = (*valves.get(key, ()), axis.name)
    routes = dict.fromkeys(statuses, Route(Role.SENT))
    if not listen_only:
        routes |= dict.fromkeys(valves, Route(Role.VALVE))
    for name, bus in config.buses.items():
        routes.update(_node_routes(name, bus, listen_only))
    known_source = (bound for bound in inputs if not bound.any_source)
    routes |= {key: Route(Role.RECEIVED, bound) for bound in known_source for key in bound.keys}
    groups = _group_routes(config, inputs, () if listen_only else axes)
    used = {key[1:] for key, route in routes.items() if route.role not in (Role.CLAIM, Role.NODE)}
    ids, in_line = frozenset(known), config.gateway.between if config.gateway else ()
    buses = {
        name: BusRoutes(
            _ids(routes, name, Role.RECEIVED, Role.NODE),
            _ids(routes, name, Role.VALVE, Role.SENT),
            _ids(routes, name, Role.VALVE),
            ids,
            frozenset(
                at[1] for at, g in groups.items() if at[0] == name and (g.inputs or g.claims)
            ),
            frozenset(at[1] for at, g in groups.items() if at[0] == name and g.axes),
            _ids(routes, name, Role.CLAIM),
            bus.j1939 is not None or name in j1939,
            bus.canopen is not None,
            name in in_line,
            frozenset(key[1:] for key in fd if key[0] == name),
        )
        for name, bus in config.buses.items()
    }
    return Routing(routes, groups, valves, ids - used, buses)


def _ids(routes: Mapping[MessageKey, Route], bus: str, *roles: Role) -> frozenset[tuple[int, bool]]:
    """Return the ids of one bus with these roles, but not of inputs received by their group."""
    return frozenset(
        key[1:]
        for key, route in routes.items()
        if key[0] == bus and route.role in roles and not (route.input and route.input.by_group)
    )


def _node_routes(name: str, bus: Bus, listen_only: bool) -> Iterator[tuple[MessageKey, Route]]:
    """Yield the routes of messages with which J1939 or CANopen nodes report themselves on a bus."""
    if bus.canopen:
        for node in bus.canopen.nodes.values():
            for base in (HEARTBEAT, EMERGENCY):
                yield (name, base + node.id, False), Route(Role.NODE)
        if not listen_only:
            yield (name, HEARTBEAT + bus.canopen.node, False), Route(Role.SENT)
            if bus.canopen.master:
                yield (name, NMT, False), Route(Role.SENT)
    if bus.j1939:
        claims = claims_of(bus.j1939.address)
        claims += [identifier(REQUEST, NULL)] if listen_only else []
        for can_id in claims:
            yield (name, can_id, True), Route(Role.CLAIM)
        for can_id in () if listen_only else sent_by(bus.j1939.address):
            yield (name, can_id, True), Route(Role.SENT)


def _group_routes(
    config: DeploymentConfig, inputs: Iterable[BoundInput], axes: Iterable[BoundAxis]
) -> dict[tuple[str, int], GroupRoute]:
    """Return the routes of J1939 groups: valve commands, inputs, claims and requests."""
    commanded: dict[tuple[str, int], tuple[str, ...]] = {}
    for axis in axes:
        # Joystick frames that we forward are left out: the joystick itself sends the same group.
        if is_j1939(axis.valve_message) and not axis.rewrites:
            bus, can_id, _ = axis.valve.message.key
            at = (bus, group_of(can_id))
            commanded[at] = (*commanded.get(at, ()), axis.name)
    received = grouped_inputs(inputs)
    nodes = [
        (name, pgn << 8)
        for name, bus in config.buses.items()
        if bus.j1939
        for pgn in (CLAIMED, REQUEST)
    ]
    return {
        at: GroupRoute(received.get(at, ()), commanded.get(at, ()), at in nodes)
        for at in (*commanded, *received, *nodes)
    }
