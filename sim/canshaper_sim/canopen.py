"""The other nodes of a CANopen bus: their heartbeats, and the state machines of CiA 408 valves."""

from collections.abc import Iterator
from typing import Any

from canshaper.codec.frame import HEARTBEAT, NMT, START, Frame, NodeState, ValveState
from canshaper.codec.message import SentMessage
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis

# Heartbeats are sent three times as often as they are asked for.
HEARTBEATS_IN_TIME = 3
STEPS = (ValveState.INIT, ValveState.DISABLED, ValveState.HOLD, ValveState.ACTIVE)


class _Node:
    """A node that is operational once started by NMT, or at once if canshaper is not the master."""

    def __init__(self, bus: str, number: int, timeout_ms: int, *, waits: bool) -> None:
        self._key = bus, HEARTBEAT + number
        self._cycle_s = timeout_ms / 1000.0 / HEARTBEATS_IN_TIME
        self._left_s = 0.0
        self.number = number
        self.state = NodeState.PRE_OPERATIONAL if waits else NodeState.OPERATIONAL

    def frames(self, passed_s: float) -> Iterator[Frame]:
        self._left_s -= passed_s
        if self._left_s <= 1e-9:
            self._left_s += self._cycle_s
            yield Frame(*self._key, False, bytes((self.state,)))


class _ValveStates:
    """A CiA 408 valve: a frame moves it one state up, or any number down, to the commanded state.

    It takes frames and sends its status word only while its node is operational.
    """

    def __init__(self, axis: BoundAxis, node: _Node | None) -> None:
        assert axis.status_word
        assert axis.config.valve.cia408
        self.key = axis.valve.message.key
        self._node = node
        self._message: Any = axis.valve_message
        self._control = axis.config.valve.cia408.control
        config = axis.status_word.config
        self._signal = config.signal
        self._sender = SentMessage(
            config.bus, axis.status_word.message, None, axis.status_word.protection
        ).sender()
        self._cycle_s = (axis.status_word.message.cycle_time or 100) / 1000.0
        self._left_s = 0.0
        self._step = 0

    @property
    def _operational(self) -> bool:
        return self._node is None or self._node.state is NodeState.OPERATIONAL

    @property
    def active(self) -> bool:
        """True while the valve is ACTIVE, and so follows its setpoint."""
        return self._operational and STEPS[self._step] is ValveState.ACTIVE

    def receive(self, data: bytes) -> None:
        if self._operational and len(data) == self._message.length:
            raw = self._message.decode(data, decode_choices=False, scaling=False)
            word = int(raw[self._control])
            commanded = STEPS.index(ValveState(word)) if word in STEPS else self._step
            self._step = min(commanded, self._step + 1)

    def frames(self, passed_s: float) -> Iterator[Frame]:
        self._left_s -= passed_s
        if self._left_s <= 1e-9:
            self._left_s += self._cycle_s
            if self._operational:
                yield self._sender.frame({self._signal: STEPS[self._step]})


class CanopenSide:
    """Every CANopen node that the deployment watches, and every CiA 408 valve.

    Attributes:
        present: True if there is such a node or valve.
    """

    def __init__(self, deployment: Deployment) -> None:
        self._nodes = {
            (bus, name): _Node(bus, node.id, node.heartbeat_ms, waits=config.canopen.master)
            for bus, config in deployment.config.buses.items()
            if config.canopen
            for name, node in config.canopen.nodes.items()
        }
        self._valves = {
            name: _ValveStates(axis, self._node_of(axis))
            for name, axis in deployment.axes.items()
            if axis.status_word
        }
        self.present = bool(self._nodes or self._valves)

    def _node_of(self, axis: BoundAxis) -> _Node | None:
        valve = axis.config.valve
        name = valve.cia408.node if valve.cia408 else None
        return self._nodes[valve.bus, name] if name else None

    def works(self, bus: str, node: str | None) -> bool:
        """Return whether this node sends its PDOs; always True for None, a node nobody watches."""
        return node is None or self._nodes[bus, node].state is NodeState.OPERATIONAL

    def closed(self, axis: str) -> bool:
        """Return whether a valve's state ignores its setpoint; False for one without CiA 408."""
        valve = self._valves.get(axis)
        return valve is not None and not valve.active

    def receive(self, frame: Frame) -> None:
        """Take a frame: the control word of a valve, the start of a node; others are ignored."""
        for valve in self._valves.values():
            if valve.key == frame[:3]:
                valve.receive(frame.data)
        if frame.can_id == NMT and not frame.extended and frame.data[:1] == bytes((START,)):
            for (bus, _), node in self._nodes.items():
                if bus == frame.bus and frame.data[1:2] in (b"\0", bytes((node.number,))):
                    node.state = NodeState.OPERATIONAL

    def frames(self, passed_s: float) -> Iterator[Frame]:
        """Let passed_s seconds pass; yield each heartbeat and status word that is due, once."""
        parts: list[_Node | _ValveStates] = [*self._nodes.values(), *self._valves.values()]
        for part in parts:
            yield from part.frames(passed_s)
