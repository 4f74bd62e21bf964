"""CANopen on the buses of a deployment: our nodes, and the valves of CiA 408.

We bring a valve step by step into the state in which it follows its setpoint. The control word goes
through init, disabled, hold and active, as a maker's own driver does: at least 50 ms apart, each
once the status word shows the state before. The setpoint stays 0 until active, because the axis
stays neutral until then. An edge of the ready bit resets a fault of the valve; the axis stays
tripped until the operator resets it.
"""

from collections.abc import Iterator, Mapping

from canshaper.codec.frame import (
    READY_BIT,
    RESET_FAULT,
    STATE_BITS,
    Frame,
    FrameFault,
    MessageKey,
    NodeState,
    ValveState,
    service_of,
)
from canshaper.codec.message import Sender
from canshaper.config.schema import StatusWord
from canshaper.inputs.input import GOOD, Input, MessageInput, Part, PartKey, Raw
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import Bound, BoundInput
from canshaper.protocols.canopen.nodes import CanopenBus, NodeEvent, RemoteNode
from canshaper.protocols.interface import BusProtocol, DrivenAxis
from canshaper.shaping.states import Reason

STEPS = (ValveState.INIT, ValveState.DISABLED, ValveState.HOLD, ValveState.ACTIVE)
HOLD = STEPS.index(ValveState.HOLD)
STEP_NS = 50_000_000
# Time for a state to be reached; then the sequence starts again. A valve that boots is not ready
# for more than a second, and no fault is reset before this time.
GIVE_UP_NS = 2_000_000_000
RESET_AGAIN_NS = 500_000_000
STATE_MASK = (1 << STATE_BITS) - 1


class ValveControl(Input):
    """State machine of one valve: reads its status word and writes its control word.

    Args:
        bound: message with the status word.
        control: name of the signal with the control word.
        message: sender of the valve's message, which carries the control word.
    """

    # Set by _go and _put.
    _step: int
    _reached: bool
    _word: int
    _since_ns: int | None  # when this word was first sent; None: the next tick sends it

    def __init__(self, bound: Bound[StatusWord], control: str, message: Sender) -> None:
        super().__init__(bound)
        self._signal = bound.config.signal
        self._status_timeout_ns = bound.config.timeout_ms * 1_000_000
        self._control = control
        self._message = message
        self._state: int | None = None
        self._state_ns = 0
        self._left = False  # the valve was in another state than ACTIVE since the last gate()
        self._reset_ns = 0
        self._go(0, None)

    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Store the valve's state (low four bits of the status word) if the frame is accepted.

        After another state than ACTIVE, even in a refused frame, ``gate`` once lets nothing move.
        """
        state = int(raw[self._signal]) & STATE_MASK
        self._left |= state != ValveState.ACTIVE
        if accepted:
            self._state, self._state_ns = state, arrived_ns
        return GOOD

    def gate(self, neutral: bool, now_ns: int) -> Reason | None:
        """Return why the axis may not move, or None; advance the control word when it is due."""
        if self._state is None or now_ns - self._state_ns > self._status_timeout_ns:
            self.resync()
        self._next(now_ns)
        works = self._state == self._word == ValveState.ACTIVE and not self._left
        self._left = False
        if works:
            return None
        return Reason.VALVE_NOT_READY if neutral else Reason.VALVE_FAULT

    def _next(self, now_ns: int) -> None:
        """Put the next control word if it is due: a step, INIT again, or a reset of a fault."""
        if self._since_ns is None:
            self._since_ns = now_ns
        passed_ns = now_ns - self._since_ns
        if self._state is None or passed_ns < STEP_NS:
            return
        boots = self._step == 0 and passed_ns <= GIVE_UP_NS
        if self._word == RESET_FAULT:  # what follows it is an edge of the ready bit
            self._go(HOLD, now_ns)
        elif not self._state & READY_BIT and not boots:
            if now_ns >= self._reset_ns:
                self._reset_ns = now_ns + RESET_AGAIN_NS
                self._put(RESET_FAULT, now_ns)
        elif self._state == self._word:
            self._reached = True
            if self._step + 1 < len(STEPS):
                self._go(self._step + 1, now_ns)
        elif self._reached or passed_ns > GIVE_UP_NS:
            self._go(0, now_ns)

    def resync(self) -> None:
        """Forget all that is known of the valve, and start from INIT."""
        self._state = None
        self._go(0, None)

    def _go(self, step: int, now_ns: int | None) -> None:
        self._step, self._reached = step, False
        self._put(int(STEPS[step]), now_ns)

    def _put(self, word: int, now_ns: int | None) -> None:
        self._word, self._since_ns = word, now_ns
        self._message.raw[self._control] = word

    def hold(self) -> None:
        """Command an active valve to hold, as the last command before we leave."""
        if self._word == ValveState.ACTIVE:
            self._message.raw[self._control] = int(ValveState.HOLD)

    def invalidate(self) -> None:
        """Invalidate everything received so far, and start from INIT."""
        super().invalidate()
        self.resync()


class CanopenNetwork(BusProtocol):
    """Our nodes, the nodes of others, and the state machines of valves, on all buses.

    Args:
        deployment: the machine.
        axes: axes of the machine. Nodes of joystick and valve, and the valve itself, become
            interlocks of each; its sway sensor counts only while the sensor's node works.

    Attributes:
        nodes: our node and the others on each bus of CANopen, by bus.
        controls: the state machine of a valve of CiA 408, by the name of its axis.
        bound: (status message, state machine) of the same valves.
    """

    def __init__(self, deployment: Deployment, axes: Mapping[str, DrivenAxis]) -> None:
        buses = deployment.config.buses
        self.nodes = {n: CanopenBus(n, b.canopen) for n, b in buses.items() if b.canopen}
        self.controls: dict[str, ValveControl] = {}
        self.bound: list[tuple[BoundInput, MessageInput]] = []
        for name, driven in axes.items():
            self._interlock(deployment, name, driven)
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

    def _interlock(self, deployment: Deployment, name: str, driven: DrivenAxis) -> None:
        config, bound = driven.bound.config, driven.bound.status_word
        joystick, valve = deployment.config.joysticks[config.command.joystick], config.valve
        control = None
        if bound and valve.cia408:
            control = ValveControl(bound, valve.cia408.control, driven.valve)
            self.controls[name] = control
            self.bound.append((bound, control))
        if own := valve.cia408.node if valve.cia408 else valve.node:
            node = self.nodes[valve.bus].nodes[own]
            driven.stops.interlocks.append(NodeGate(node, Reason.VALVE_FAULT, control))
        if joystick.node:
            node = self.nodes[joystick.bus].nodes[joystick.node]
            driven.stops.interlocks.append(NodeGate(node, Reason.NODE_FAULT))
        if control is not None:
            driven.stops.interlocks.append(control.gate)
        if (sensor := driven.bound.sway_sensor) and sensor.config.node:
            driven.measured_by(self.nodes[sensor.config.bus].nodes[sensor.config.node])

    def usual(self, frame: Frame) -> bool:
        """Return whether the frame is of a CANopen service, which DBC files do not list."""
        return (
            not frame.extended and frame.bus in self.nodes and service_of(frame.can_id) is not None
        )

    def silence(self, now_ns: int) -> FrameFault:
        """Return HEARTBEAT_LOST if a node has just fallen silent, else NONE."""
        lost = sum(nodes.lost(now_ns) for nodes in self.nodes.values())
        return FrameFault.HEARTBEAT_LOST if lost else FrameFault.NONE

    def frames(self, now_ns: int) -> Iterator[Frame]:
        """Yield our boot-up messages and heartbeats, and commands to start other nodes."""
        for nodes in self.nodes.values():
            yield from nodes.frames(now_ns)

    def changes(self) -> Iterator[NodeEvent]:
        """Yield events of other nodes that have changed since the last call."""
        for nodes in self.nodes.values():
            yield from nodes.changes()

    def leave(self) -> None:
        """Command active valves to hold."""
        for control in self.controls.values():
            control.hold()

    def parts(self, places: Mapping[str, PartKey]) -> Iterator[tuple[PartKey, Part]]:
        """Yield the parts that a reload carries over: our heartbeats."""
        for bus, nodes in self.nodes.items():
            yield ("canopen", *places[bus], nodes.own), nodes


class NodeGate:
    """Interlock of an axis on the CANopen node of its joystick or valve.

    Args:
        node: the node.
        in_motion: reason that stops an axis in motion when the node does not work.
        control: state machine of the valve, which starts again whenever the node was not
            operational.
    """

    def __init__(
        self, node: RemoteNode, in_motion: Reason, control: ValveControl | None = None
    ) -> None:
        self._node = node
        self._in_motion = in_motion
        self._control = control
        self._stops, self._alarms = node.stops, node.alarms

    def __call__(self, neutral: bool, _now_ns: int) -> Reason | None:
        """Return why the axis may not move, or None; a failure since the last call counts, too."""
        node = self._node
        stopped, alarmed = node.stops != self._stops, node.alarms != self._alarms
        self._stops, self._alarms = node.stops, node.alarms
        if self._control is not None and (stopped or node.state != NodeState.OPERATIONAL):
            self._control.resync()
        if node.works and not (stopped or alarmed):
            return None
        return Reason.NODE_FAULT if neutral else self._in_motion
