"""CANopen on the buses of a deployment: our nodes, and the valves of CiA 408."""

from collections.abc import Iterator, Mapping

from canshaper.codec.frame import Frame, FrameFault, service_of
from canshaper.inputs.input import Key, MessageInput, Part
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.protocols.canopen.cia408 import ValveControl
from canshaper.protocols.canopen.nodes import CanopenBus, NodeEvent, NodeGate
from canshaper.protocols.interface import BusProtocol, DrivenAxis, MessageKey
from canshaper.shaping.states import Reason


class CanopenNetwork(BusProtocol):
    """Our nodes, those of others, and the state machines of valves, on all buses.

    Args:
        deployment: the machine.
        axes: its axes, whose interlocks are the nodes of joystick and valve, and the valve itself;
            their sway sensors measure while their nodes work.

    Attributes:
        nodes: our node on each bus of CANopen.
        controls: the state machine of a valve of CiA 408, by the name of its axis.
        bound: the same with their messages.
    """

    def __init__(self, deployment: Deployment, axes: Mapping[str, DrivenAxis]) -> None:
        buses = deployment.config.buses
        self.nodes = {n: CanopenBus(n, b.canopen) for n, b in buses.items() if b.canopen}
        self.controls: dict[str, ValveControl] = {}
        self.bound: list[tuple[BoundInput, MessageInput]] = []
        for name, runner in axes.items():
            self._interlock(deployment, name, runner)
        self.inputs: dict[MessageKey, MessageInput] = {
            key: control
            for bound, control in self.bound
            if not bound.any_source
            for key in bound.keys
        } | {
            (bus, can_id, False): one
            for bus, nodes in self.nodes.items()
            for can_id, one in nodes.inputs.items()
        }

    def _interlock(self, deployment: Deployment, name: str, runner: DrivenAxis) -> None:
        config, bound = runner.bound.config, runner.bound.status_word
        joystick, valve = deployment.config.joysticks[config.command.joystick], config.valve
        control = None
        if bound and valve.cia408:
            control = ValveControl(bound, valve.cia408.control, runner.valve)
            self.controls[name] = control
            self.bound.append((bound, control))
        if own := valve.cia408.node if valve.cia408 else valve.node:
            node = self.nodes[valve.bus].nodes[own]
            runner.add_interlock(NodeGate(node, Reason.VALVE_FAULT, control))
        if joystick.node:
            node = self.nodes[joystick.bus].nodes[joystick.node]
            runner.add_interlock(NodeGate(node, Reason.NODE_FAULT))
        if control is not None:
            runner.add_interlock(control.gate)
        if (sensor := runner.bound.sway_sensor) and sensor.config.node:
            runner.measured_by(self.nodes[sensor.config.bus].nodes[sensor.config.node])

    def usual(self, frame: Frame) -> bool:
        """Whether the frame is of a service that other nodes use and no DBC file has."""
        return (
            not frame.extended and frame.bus in self.nodes and service_of(frame.can_id) is not None
        )

    def silence(self, now_ns: int) -> FrameFault:
        """Return a fault if a node has just fallen silent."""
        lost = sum(nodes.lost(now_ns) for nodes in self.nodes.values())
        return FrameFault.HEARTBEAT_LOST if lost else FrameFault.NONE

    def frames(self, now_ns: int) -> Iterator[Frame]:
        """Yield our boot-up messages and heartbeats, and commands to start others."""
        for nodes in self.nodes.values():
            yield from nodes.frames(now_ns)

    def changes(self) -> Iterator[NodeEvent]:
        """Yield events of other nodes that have changed since the last call."""
        for nodes in self.nodes.values():
            yield from nodes.changes()

    def leave(self) -> None:
        """Let active valves hold."""
        for control in self.controls.values():
            control.hold()

    def parts(self, places: Mapping[str, Key]) -> Iterator[tuple[Key, Part]]:
        """Yield the parts that a reload carries over: our heartbeats."""
        for bus, nodes in self.nodes.items():
            yield ("canopen", *places[bus], nodes.own), nodes
