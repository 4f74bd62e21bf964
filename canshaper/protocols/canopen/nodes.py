"""CANopen nodes of a bus (CiA 301): our heartbeat; others' heartbeats, emergencies, start."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Self

from canshaper.codec.frame import (
    EMERGENCY,
    GENERIC_ERROR,
    HEARTBEAT,
    NMT,
    NO_EMERGENCY,
    START,
    STATE_MASK,
    Frame,
    FrameFault,
    NodeState,
)
from canshaper.config.bus import Canopen, CanopenNode

# Time between two commands to start one node: it needs as long to answer with a heartbeat.
START_AGAIN_NS = 500_000_000
BOOT_UP, OPERATIONAL = bytes((NodeState.BOOT_UP,)), bytes((NodeState.OPERATIONAL,))


@dataclass(frozen=True, slots=True)
class NodeEvent:
    """Another node changed its state or emergency code: ``status`` says to what."""

    bus: str
    node: str
    status: str

    @property
    def text(self) -> str:
        """Line for the log."""
        return f"bus={self.bus} node={self.node} {self.status}"


class RemoteNode:
    """Another node, as its heartbeats and emergency messages show it.

    Attributes:
        state: state in its last heartbeat; None before it, after silence, or once invalidated.
        emergency: last error code that it has not reported as over, 0 for none.
        stops: how often it reported a state other than OPERATIONAL, or fell silent.
        alarms: how often it reported an error.
    """

    def __init__(self, config: CanopenNode) -> None:
        self.id = config.id
        self.state: int | None = None
        self.emergency = NO_EMERGENCY
        self.stops = self.alarms = 0
        self._timeout_ns = config.heartbeat_ms * 1_000_000
        self._last_frame_ns = 0
        self._start_ns = 0

    def heartbeat(self, data: bytes, arrived_ns: int) -> FrameFault:
        """Receive a heartbeat; a boot-up clears the emergency of the node."""
        if len(data) != 1:
            return FrameFault.WRONG_LENGTH
        if self.state is not None and arrived_ns - self._last_frame_ns > self._timeout_ns:
            self.stops += 1  # it was lost, though no tick has seen that
        self.state = data[0] & STATE_MASK
        self._last_frame_ns = arrived_ns
        if self.state != NodeState.OPERATIONAL:
            self.stops += 1
        if self.state == NodeState.BOOT_UP:
            self.emergency = NO_EMERGENCY
            self._start_ns = arrived_ns
        return FrameFault.NONE

    def alarm(self, data: bytes, _arrived_ns: int) -> FrameFault:
        """Receive an emergency message; a new error is a fault.

        Error code 0 says that one error is over; all are over only if the error register is 0 too.
        """
        if len(data) != 8:
            return FrameFault.WRONG_LENGTH
        code, register = int.from_bytes(data[:2], "little"), data[2]
        if code == NO_EMERGENCY and register:
            self.emergency = self.emergency or GENERIC_ERROR
            return FrameFault.NONE
        self.emergency = code
        if code == NO_EMERGENCY:
            return FrameFault.NONE
        self.alarms += 1
        return FrameFault.NODE_EMERGENCY

    def lost(self, now_ns: int) -> bool:
        """Return whether the node has just fallen silent; its state is then unknown."""
        if self.state is None or now_ns - self._last_frame_ns <= self._timeout_ns:
            return False
        self.state = None
        self.stops += 1  # an axis with a slow valve may not be asked before it is back
        return True

    def invalidate(self) -> None:
        """Forget the state; a reported error stays until the node reports its end."""
        self.state = None

    def copy_state(self, before: Self) -> None:
        """Copy state, emergency and times of the same node; ``stops`` and ``alarms`` begin at 0."""
        self.state, self.emergency = before.state, before.emergency
        self._last_frame_ns, self._start_ns = before._last_frame_ns, before._start_ns

    def to_start(self, now_ns: int) -> bool:
        """Return whether to command the node to start now; the next command waits 0.5 s."""
        if self.state in (NodeState.OPERATIONAL, None) or now_ns < self._start_ns:
            return False
        self._start_ns = now_ns + START_AGAIN_NS
        return True

    @property
    def works(self) -> bool:
        """Return whether the node is operational without an emergency, so that its data count."""
        return self.state == NodeState.OPERATIONAL and self.emergency == NO_EMERGENCY


class _NodeMessage:
    """Input for one kind of message of another node: its heartbeat or its emergency message."""

    def __init__(self, node: RemoteNode, receive: Callable[[bytes, int], FrameFault]) -> None:
        self._node = node
        self.receive = receive

    def invalidate(self) -> None:
        """Forget the state of the node; its errors stay."""
        self._node.invalidate()

    def copy_state(self, before: Self) -> None:
        """Continue with the state of the same node."""
        self._node.copy_state(before._node)


class CanopenBus:
    """Our node and the other nodes on one bus of CANopen.

    Attributes:
        own: our node id.
        nodes: the other nodes, by name.
        inputs: receivers of the other nodes' heartbeats and emergency messages, by CAN id.
    """

    def __init__(self, bus: str, config: Canopen) -> None:
        self._bus = bus
        self.own = config.node
        self._cycle_ns = config.heartbeat_ms * 1_000_000
        self._due_ns: int | None = None  # of the next heartbeat; None before our boot-up message
        self._master = config.master
        self.nodes = {name: RemoteNode(node) for name, node in config.nodes.items()}
        self._reported: dict[str, str] = {}
        self.inputs: dict[int, _NodeMessage] = {}
        for node in self.nodes.values():
            self.inputs[HEARTBEAT + node.id] = _NodeMessage(node, node.heartbeat)
            self.inputs[EMERGENCY + node.id] = _NodeMessage(node, node.alarm)

    def copy_state(self, before: Self) -> None:
        """Continue our heartbeat: a reload is no start of our node."""
        self._due_ns = before._due_ns

    def frames(self, now_ns: int) -> Iterator[Frame]:
        """Yield the frames due now: our boot-up message or heartbeat, and commands to start."""
        if self._due_ns is None:
            self._due_ns = now_ns + self._cycle_ns
            yield Frame(self._bus, HEARTBEAT + self.own, False, BOOT_UP)
        elif now_ns >= self._due_ns:
            # From the time it was due, so that lateness does not add up; but never in a burst.
            self._due_ns = max(self._due_ns + self._cycle_ns, now_ns)
            yield Frame(self._bus, HEARTBEAT + self.own, False, OPERATIONAL)
        if self._master:
            for node in self.nodes.values():
                if node.to_start(now_ns):
                    yield Frame(self._bus, NMT, False, bytes((START, node.id)))

    def lost(self, now_ns: int) -> int:
        """Return how many nodes have just fallen silent."""
        return sum(node.lost(now_ns) for node in self.nodes.values())

    def changes(self) -> Iterator[NodeEvent]:
        """Yield events of nodes whose state or emergency has changed since the last call."""
        for name, node in self.nodes.items():
            state = "lost" if node.state is None else _name(node.state)
            status = f"state={state} emergency={node.emergency:#06x}"
            if self._reported.get(name) != status:
                self._reported[name] = status
                yield NodeEvent(self._bus, name, status)


def _name(state: int) -> str:
    known = {s.value: s.name for s in NodeState}
    return known.get(state, f"unknown ({state})")
