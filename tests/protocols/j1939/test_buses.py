"""J1939 on two buses: whose axes, whose inputs and whose faults are those of a bus."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from canshaper.codec.frame import Frame, FrameFault, name_bytes
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.protocols.j1939.network import J1939Network
from canshaper.shaping.states import Reason
from tests.rigs.files import machine_file
from tests.rigs.j1939 import TICK_NS

CRANE, BOOM = ("socketcan", "vcan0"), ("socketcan", "vcan1")
PLACES = {"crane": CRANE, "boom": BOOM}
FIRST_SPN, CRANE_ADDRESS, BOOM_ADDRESS = 520192, 0x9C, 0x9D
BJM1 = 0x00FDD600
ABNORMAL_RATE = 9


class Received:
    """An input: what it receives, and how often it is invalidated."""

    def __init__(self) -> None:
        self.data: list[bytes] = []
        self.invalidated = 0

    def receive(self, data: bytes, _arrived_ns: int) -> FrameFault:
        self.data.append(data)
        return FrameFault.NONE

    def invalidate(self) -> None:
        self.invalidated += 1

    def copy_state(self, _before: "Received") -> None:
        """Nothing."""


def two_buses(folder: Path, *changes: tuple[str, str]) -> Deployment:
    """The shipped machine with its lift on a second bus of J1939, with pieces replaced."""
    boom = (
        "\n  boom:\n    interface: socketcan\n    channel: vcan1\n    bitrate: 250000\n"
        "    j1939: { address: 0x9D, name: { identity_number: 2, manufacturer_code: 2047 } }\n"
        "\ndbc:"
    )
    moved = [
        (f"bus: crane{end}", f"bus: boom{end}")
        for end in ("\n      message: AVC2", ", message: AVEF2")
    ]
    changes = (("\ndbc:", boom), *moved, *changes)
    return load_deployment(machine_file(folder, "j1939-forwarder", *changes))


def axes_of(deployment: Deployment, **reasons: Reason) -> dict[str, Any]:
    """Axes as the network sees them, with their interlocks and a reason."""
    axes: dict[str, Any] = {}
    for name, bound in deployment.axes.items():
        gates: list[Callable[..., Any]] = []
        axis = SimpleNamespace(reason=reasons.get(name, Reason.START))
        axes[name] = SimpleNamespace(
            bound=bound, axis=axis, feedback=None, gates=gates, add_interlock=gates.append
        )
    return axes


def inputs_of(deployment: Deployment) -> tuple[list[tuple[BoundInput, Any]], dict[str, Received]]:
    """Every joystick with an input of its own; those by the name of the joystick."""
    received = {name: Received() for name in deployment.joysticks}
    return [(deployment.joysticks[name], one) for name, one in received.items()], received


def test_an_axis_asks_the_node_on_the_bus_of_its_valve_and_no_other(tmp_path: Path) -> None:
    deployment = two_buses(tmp_path)
    axes = axes_of(deployment)
    nodes = J1939Network(deployment, axes, []).nodes
    assert {name: axis.gates for name, axis in axes.items()} == {
        "slew": [nodes["crane"].gate],
        "near_far": [nodes["crane"].gate],
        "lift": [nodes["boom"].gate],
    }


@pytest.mark.parametrize("sources", [(0x34, 0x35), (0x35, 0x34), (0x00, 0xFD)])
def test_two_inputs_of_one_group_each_receive_from_their_own_address(
    tmp_path: Path, sources: tuple[int, int]
) -> None:
    left, right = sources
    deployment = two_buses(
        tmp_path,
        ("    message: BJM1\n", f"    message: BJM1\n    source: {left}\n"),
        ("    message: BJM2\n", f"    message: BJM1\n    source: {right}\n"),
    )
    inputs, received = inputs_of(deployment)
    network = J1939Network(deployment, axes_of(deployment), inputs)
    for source in (left, right, 0x33):
        frame = Frame("crane", 0x0C000000 | BJM1 | source, True, bytes((source,)))
        handler = network.handler(frame)
        assert handler is not None
        assert handler.receive(frame, 0) is FrameFault.NONE
    assert {name: one.data for name, one in received.items()} == {
        "left": [bytes((left,))],
        "right": [bytes((right,))],
    }


@pytest.mark.parametrize(
    ("bus", "left", "right"), [(None, 1, 1), ("crane", 1, 0), ("boom", 0, 1), ("other", 0, 0)]
)
def test_inputs_of_a_bus_are_invalidated_with_it(
    tmp_path: Path, bus: str | None, left: int, right: int
) -> None:
    deployment = two_buses(
        tmp_path, ("bus: crane\n    message: BJM2", "bus: boom\n    message: BJM2")
    )
    inputs, received = inputs_of(deployment)
    J1939Network(deployment, axes_of(deployment), inputs).invalidate(bus)
    assert {name: one.invalidated for name, one in received.items()} == {
        "left": left,
        "right": right,
    }


def test_a_part_is_known_by_what_it_is_on_the_machine(tmp_path: Path) -> None:
    deployment = two_buses(tmp_path, ("    message: BJM2\n", "    message: BJM2\n    source: 7\n"))
    inputs, received = inputs_of(deployment)
    network = J1939Network(deployment, axes_of(deployment), inputs)
    parts = dict(network.parts(PLACES))
    crane, boom = (deployment.config.buses[bus].j1939 for bus in ("crane", "boom"))
    assert crane is not None
    assert boom is not None
    here = (*CRANE, CRANE_ADDRESS, name_bytes(crane.name))
    there = (*BOOM, BOOM_ADDRESS, name_bytes(boom.name))
    axes = ("slew", "near_far", "lift")
    source = parts.pop(("source", *CRANE, BJM1))
    assert parts == {
        ("input", *CRANE, BJM1): received["left"],
        ("node", *here): network.nodes["crane"],
        ("faults", *here, FIRST_SPN, *axes, "slew", "near_far"): network.nodes["crane"].faults,
        ("node", *there): network.nodes["boom"],
        ("faults", *there, FIRST_SPN, *axes, "lift"): network.nodes["boom"].faults,
    }
    handler = network.handler(Frame("crane", 0x0C000000 | BJM1 | 0x33, True, b""))
    assert source is getattr(handler, "rest", None)


@pytest.mark.parametrize("axis", ["slew", "near_far", "lift"])
def test_a_bus_reports_the_faults_of_its_own_axes(tmp_path: Path, axis: str) -> None:
    """An axis of another bus does not hide those that follow it, and keeps its number."""
    deployment = two_buses(tmp_path)
    axes = axes_of(deployment, **{axis: Reason.JOYSTICK_TIMEOUT})
    network = J1939Network(deployment, axes, [])
    sent = [frame for tick in range(20) for frame in network.frames(tick * TICK_NS)]
    reports = {f.bus: f.data for f in sent if f.can_id & 0x03FFFF00 == 0x00FECA00}
    number = FIRST_SPN + 2 * list(axes).index(axis)
    low = (number & 0xFFFF).to_bytes(2, "little")
    fault = b"\x04\xff" + low + bytes((number >> 16 << 5 | ABNORMAL_RATE, 1, 0xFF, 0xFF))
    nothing = b"\0\xff\0\0\0\0\xff\xff"
    lifts = axis == "lift"
    assert reports == {"crane": nothing if lifts else fault, "boom": fault if lifts else nothing}
