"""The routing table of the shipped machines: what each id on a bus is."""

import dataclasses
from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.machine.routing import GroupRoute, Role, Route

CONFIG = Path(__file__).parents[2] / "config"


def machine(name: str) -> Deployment:
    return load_deployment(CONFIG / f"{name}.yaml")


def test_an_id_is_an_input_a_valve_a_status_or_other_traffic() -> None:
    deployment = machine("forwarder")
    routes = deployment.routing.routes
    joystick = next(iter(deployment.joysticks.values()))
    assert routes[joystick.key] == Route(Role.RECEIVED, joystick)
    axis = deployment.axes["slew"]
    assert axis.status is not None
    assert routes[axis.valve.message.sender.key] == Route(Role.VALVE)
    assert routes[axis.status.sender.key] == Route(Role.SENT)
    assert not {key[1:] for key in routes} & deployment.routing.others
    assert {key[1:] for key in routes} | deployment.routing.others == deployment.messages.ids()


def test_a_message_of_two_valves_names_both_axes_in_their_order() -> None:
    deployment = machine("forwarder")
    for axis in deployment.axes.values():
        assert axis.name in deployment.routing.valves[axis.valve.message.sender.key]
    near_far = deployment.axes["near_far"]
    slew = dataclasses.replace(deployment.axes["slew"], valve=near_far.valve)
    axes = {"near_far": near_far, "slew": slew}
    shared = dataclasses.replace(deployment, axes=axes)
    first, second = shared.routing.valves[near_far.valve.message.sender.key]
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
