"""The routing table: what each id on a bus is, on the shipped machines and on small ones."""

import dataclasses
from pathlib import Path

import pytest

from canshaper.codec.frame import MessageKey
from canshaper.config.bus import J1939, Bus, Canopen, CanopenNode, J1939Name
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.machine.routing import GroupRoute, Role, Route, Routing, build_routing
from tests.rigs.files import CONFIG, machine_file


def machine(name: str) -> Deployment:
    return load_deployment(CONFIG / f"{name}.yaml")


def test_an_id_is_an_input_a_valve_a_status_or_other_traffic() -> None:
    deployment = machine("forwarder")
    routes = deployment.routing.routes
    joystick = next(iter(deployment.joysticks.values()))
    assert routes[joystick.key] == Route(Role.RECEIVED, joystick)
    axis = deployment.axes["slew"]
    assert axis.status is not None
    assert routes[axis.valve.message.key] == Route(Role.VALVE)
    assert routes[axis.status.message.key] == Route(Role.SENT)
    assert not {key[1:] for key in routes} & deployment.routing.others
    assert {key[1:] for key in routes} | deployment.routing.others == deployment.messages.ids()


def test_a_message_of_two_valves_names_both_axes_in_their_order() -> None:
    deployment = machine("forwarder")
    for axis in deployment.axes.values():
        assert axis.name in deployment.routing.valves[axis.valve.message.key]
    near_far = deployment.axes["near_far"]
    slew = dataclasses.replace(deployment.axes["slew"], valve=near_far.valve)
    axes = {"near_far": near_far, "slew": slew}
    shared = dataclasses.replace(deployment, axes=axes)
    first, second = shared.routing.valves[near_far.valve.message.key]
    assert (first, second) == ("near_far", "slew")  # in their order


def test_j1939_is_known_by_group_and_by_every_priority() -> None:
    deployment = machine("j1939-forwarder")
    routing = deployment.routing
    assert routing.groups["crane", 0xEE0000] == routing.groups["crane", 0xEA0000]
    assert routing.groups["crane", 0xEE0000] == GroupRoute(claims=True)
    commanded = [route.axes for route in routing.groups.values() if route.axes]
    assert {name for names in commanded for name in names} == set(deployment.axes)
    claims = [key for key, route in routing.routes.items() if route.role is Role.CLAIM]
    assert {key[1:] for key in claims} == routing.buses["crane"].claims
    assert not routing.sent & set(claims)  # they come back from others too
    for bound in deployment.inputs():
        if bound.by_group and not bound.any_source:
            assert {routing.routes[key].input for key in bound.keys} == {bound}
            assert not {key[1:] for key in bound.keys} & routing.buses["crane"].received


def test_nodes_of_canopen_have_a_heartbeat_and_an_emergency() -> None:
    deployment = machine("canopen-forwarder")
    (bus,) = (name for name, one in deployment.config.buses.items() if one.canopen)
    canopen = deployment.config.buses[bus].canopen
    assert canopen is not None
    of_nodes = {key for key, route in deployment.routing.routes.items() if route.role is Role.NODE}
    ids = [node.id for node in canopen.nodes.values()]
    assert of_nodes == {(bus, base + n, False) for n in ids for base in (0x700, 0x80)}
    assert {key[1:] for key in of_nodes} <= deployment.routing.buses[bus].received


@pytest.mark.parametrize("name", ["forwarder", "j1939-forwarder", "canopen-forwarder"])
def test_who_only_listens_sends_no_command_but_knows_whose_it_is(name: str) -> None:
    listening = machine(name).listening()
    roles = {route.role for route in listening.routing.routes.values()}
    assert Role.VALVE not in roles
    assert listening.routing.valves == machine(name).routing.valves
    assert not any(route.axes for route in listening.routing.groups.values())


def test_the_table_is_built_once() -> None:
    deployment = machine("forwarder")
    assert deployment.routing is deployment.routing
    with pytest.raises(dataclasses.FrozenInstanceError):
        deployment.routing.routes = {}  # type: ignore[misc]


def nodes_of(buses: dict[str, Bus], *, listen_only: bool = False) -> Routing:
    """The table of these buses with the messages of no DBC file: what nodes say of themselves."""
    config = machine("forwarder").config.model_copy(update={"buses": buses})
    return build_routing(
        config,
        inputs=[],
        axes=[],
        statuses=[],
        known=[],
        j1939=["messages"],
        fd=[],
        listen_only=listen_only,
    )


def canopen_bus(*, master: bool) -> Bus:
    nodes = {"left": CanopenNode(id=0x10, heartbeat_ms=500)}
    canopen = Canopen(node=0x7E, master=master, nodes=nodes)
    return Bus(interface="virtual", channel="canopen", canopen=canopen)


def j1939_bus(address: int) -> Bus:
    node = J1939(address=address, name=J1939Name(identity_number=1, manufacturer_code=2047))
    return Bus(interface="virtual", channel="j1939", j1939=node)


WATCHED = {("crane", 0x710, False), ("crane", 0x090, False)}


@pytest.mark.parametrize(
    ("master", "listen_only", "sent"),
    [
        (True, False, {("crane", 0x77E, False), ("crane", 0x000, False)}),
        (False, False, {("crane", 0x77E, False)}),
        (True, True, set()),
        (False, True, set()),
    ],
)
def test_a_node_of_canopen_sends_its_heartbeat_and_only_the_master_sends_nmt(
    master: bool, listen_only: bool, sent: set[MessageKey]
) -> None:
    routing = nodes_of({"crane": canopen_bus(master=master)}, listen_only=listen_only)
    assert routing.routes == dict.fromkeys(WATCHED, Route(Role.NODE)) | dict.fromkeys(
        sent, Route(Role.SENT)
    )
    assert routing.sent == sent
    assert routing.buses["crane"].sent == {key[1:] for key in sent}
    assert routing.buses["crane"].received == {key[1:] for key in WATCHED}


def test_a_node_of_j1939_claims_its_address_and_sends_its_own_messages() -> None:
    routing = nodes_of({"crane": j1939_bus(0x9C)})
    claims = {("crane", can_id, True) for can_id in (0x18EEFF9C, 0x18EEFFFE)}
    ids = (0x18E8FF9C, 0x18FECA9C, 0x1CECFF9C, 0x1CEBFF9C)  # acknowledge, DM1, transport
    sent = {("crane", can_id, True) for can_id in ids}
    assert routing.routes == dict.fromkeys(claims, Route(Role.CLAIM)) | dict.fromkeys(
        sent, Route(Role.SENT)
    )
    assert routing.buses["crane"].claims == {key[1:] for key in claims}
    assert routing.buses["crane"].sent == {key[1:] for key in sent}


def test_a_listening_node_of_j1939_requests_from_the_null_address_and_sends_nothing_else() -> None:
    routing = nodes_of({"crane": j1939_bus(0x9C)}, listen_only=True)
    claims = {("crane", can_id, True) for can_id in (0x18EEFF9C, 0x18EEFFFE, 0x18EAFFFE)}
    assert routing.routes == dict.fromkeys(claims, Route(Role.CLAIM))
    assert routing.buses["crane"].claims == {key[1:] for key in claims}
    assert not routing.buses["crane"].sent


def test_a_bus_is_of_j1939_by_its_node_or_by_its_messages_and_of_canopen_by_its_node() -> None:
    plain = Bus(interface="virtual", channel="plain")
    buses = {
        "node": j1939_bus(0x9C),
        "messages": plain,
        "valves": canopen_bus(master=True),
        "plain": plain,
    }
    flags = {name: (bus.j1939, bus.canopen) for name, bus in nodes_of(buses).buses.items()}
    assert flags == {
        "node": (True, False),
        "messages": (True, False),
        "valves": (False, True),
        "plain": (False, False),
    }


def test_only_the_two_buses_of_a_gateway_are_in_line() -> None:
    deployment = machine("gateway-forwarder")
    aside = Bus(interface="virtual", channel="aside")
    buses = deployment.config.buses | {"aside": aside}
    config = deployment.config.model_copy(update={"buses": buses})
    routing = dataclasses.replace(deployment, config=config).routing
    in_line = {name: bus.in_line for name, bus in routing.buses.items()}
    assert in_line == {"joysticks": True, "machine": True, "aside": False}
    assert not any(bus.in_line for bus in machine("two-cranes").routing.buses.values())


def test_groups_of_two_buses_of_j1939_do_not_mix(tmp_path: Path) -> None:
    name = "{ identity_number: 2, manufacturer_code: 2047 }"
    rear = f"""buses:
  rear:
    interface: socketcan
    channel: vcan1
    bitrate: 250000
    j1939: {{ address: 0x9D, name: {name} }}
"""
    changes = {
        "buses:\n": rear,
        "bus: crane\n    message: BJM2": "bus: rear\n    message: BJM2",
        "bus: crane\n      message: AVC0": "bus: rear\n      message: AVC0",
    }
    file = machine_file(tmp_path, "j1939-forwarder", *changes.items())
    buses = load_deployment(file).routing.buses
    claims = {0xEE0000, 0xEA0000}
    bjm1, bjm2, feedback = 0xFDD600, 0xFDD800, {0xFE1000, 0xFE1100, 0xFE1200}
    avc0, avc1, avc2 = 0xFE3000, 0xFE3100, 0xFE3200
    assert buses["crane"].received_groups == claims | {bjm1} | feedback
    assert buses["rear"].received_groups == claims | {bjm2}
    assert buses["crane"].sent_groups == {avc1, avc2}
    assert buses["rear"].sent_groups == {avc0}


@pytest.mark.parametrize(
    ("key", "matters"),
    [
        (("crane", 0x110, False), True),  # received or sent
        (("other", 0x110, False), False),  # the same id elsewhere is other traffic
        (("crane", 0x18EE0042, True), True),  # its group is received
        (("crane", 0x18EE0042, False), False),
        (("other", 0x18EE0042, True), False),
        (("crane", 0x18FF0042, True), False),
        (("crane", 0x18FF0042, False), True),  # no one knows it
    ],
)
def test_a_message_matters_that_is_used_or_that_no_one_knows(
    key: MessageKey, matters: bool
) -> None:
    known = {(0x110, False), (0x18EE0042, True), (0x18EE0042, False), (0x18FF0042, True)}
    groups = {("crane", 0xEE0000): GroupRoute()}
    routes = {("crane", 0x110, False): Route(Role.SENT)}
    assert Routing(routes, groups, {}, frozenset(known), {}).received(key) is matters
