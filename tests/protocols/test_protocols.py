"""Which protocols a machine speaks, and what each of them has to define."""

from pathlib import Path

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment
from canshaper.protocols.canopen.network import CanopenNetwork
from canshaper.protocols.interface import BusProtocol
from canshaper.protocols.j1939.network import J1939Network
from canshaper.protocols.registry import protocols
from tests.rigs.canopen import ACTIVE, INIT, CanopenRig, write_variant
from tests.rigs.files import Machine
from tests.rigs.j1939 import Rig

PLAIN_BUS = "  crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }"
NODES = ("left", "right", "slew", "near_far", "lift")


def spoken(deployment: Deployment) -> list[type[BusProtocol]]:
    """Protocols of a machine, with the axes of a controller of its own."""
    axes = Controller(deployment).axes
    return [type(one) for one in protocols(deployment, axes, {}, [])]


def test_a_plain_machine_speaks_none(machine: Machine) -> None:
    assert spoken(machine.load()) == []


def test_a_machine_speaks_the_protocol_of_its_bus() -> None:
    assert spoken(CanopenRig().deployment) == [CanopenNetwork]
    assert spoken(Rig().deployment) == [J1939Network]


def test_our_node_speaks_canopen_where_it_watches_no_other(machine: Machine) -> None:
    machine.in_yaml(PLAIN_BUS, PLAIN_BUS.replace(" }", ", canopen: { node: 0x7E } }"))
    assert spoken(machine.load()) == [CanopenNetwork]


def test_valves_of_cia_408_are_canopen_without_a_node_of_ours(tmp_path: Path) -> None:
    changes = [(f"        node: {name}\n", "") for name in NODES[2:]]
    changes += [(f"    node: {name}\n", "") for name in NODES[:2]]
    file = write_variant(tmp_path, *changes)
    before, _, rest = file.read_text().partition("    canopen:\n")
    file.write_text(before + "\ndbc:" + rest.partition("\ndbc:")[2])
    rig = CanopenRig(file)
    assert spoken(rig.deployment) == [CanopenNetwork]
    assert rig.run()["slew"]["ControlWord"] == INIT
    rig.ready()
    assert {valve.state for valve in rig.valves.values()} == {ACTIVE}


def test_a_protocol_says_itself_what_is_usual() -> None:
    with pytest.raises(NotImplementedError):
        BusProtocol().usual(Frame("crane", 0x123, False, b""))
