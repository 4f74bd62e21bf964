"""J1939 on the buses of a deployment: our nodes, and messages known by their group."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from canshaper.codec.frame import CLAIMED, Frame, group_of, name_bytes, pgn_of
from canshaper.config.bus import J1939
from canshaper.inputs.input import Key, MessageInput, Part
from canshaper.inputs.value import Following
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.machine.joysticks import BoundJoystick
from canshaper.protocols.interface import BusProtocol, DrivenAxis, FrameHandler
from canshaper.protocols.j1939.claim import ClaimState, Node
from canshaper.protocols.j1939.dm1 import FMI_OF, FMI_OF_FOLLOWING
from canshaper.protocols.j1939.groups import (
    AnySource,
    CommandedByOthers,
    ReceivedGroup,
    SourceEvent,
)


@dataclass(frozen=True, slots=True)
class AddressEvent:
    """Our address on a bus is claimed, or lost."""

    bus: str
    address: int
    state: ClaimState

    @property
    def text(self) -> str:
        """Line for the log."""
        return f"bus={self.bus} address={self.address:#04x} state={self.state.value}"


class J1939Network(BusProtocol):
    """Nodes and groups of all buses.

    Args:
        deployment: the machine.
        axes: its axes, whose interlock is the node on the bus of their valve.
        inputs: its inputs with their messages.

    Attributes:
        nodes: our node on each bus of J1939.
    """

    def __init__(
        self,
        deployment: Deployment,
        axes: Mapping[str, DrivenAxis],
        inputs: Sequence[tuple[BoundInput, MessageInput]],
    ) -> None:
        buses = deployment.config.buses
        self._configs: dict[str, J1939] = {n: b.j1939 for n, b in buses.items() if b.j1939}
        self._axes = axes
        self.nodes = {
            name: Node(
                name, config, frozenset(_cyclic(deployment, name)), guest=deployment.listen_only
            )
            for name, config in self._configs.items()
        }
        self._reported = dict.fromkeys(self.nodes, ClaimState.WAITING)
        routing = deployment.routing
        self._buses = {bus for bus, routes in routing.buses.items() if routes.j1939}
        self._groups: dict[tuple[str, int], FrameHandler] = {}
        self._any: dict[tuple[str, int], tuple[AnySource, Part]] = {}
        for bus, node in self.nodes.items():
            for runner in () if deployment.listen_only else axes.values():
                if runner.bound.config.valve.bus == bus and not runner.bound.rewrites:
                    runner.stops.interlocks.append(node.gate)
        for (bus, group), route in routing.groups.items():
            if route.axes:
                commanded = [axes[name] for name in route.axes]
                self._groups[bus, group] = CommandedByOthers(commanded)
            elif route.claims:
                self._groups[bus, group] = self.nodes[bus]
        for bound, one in inputs:
            if bound.by_group:
                self._add_input(bound, one)

    def _add_input(self, bound: BoundInput, one: MessageInput) -> None:
        bus, can_id = bound.config.bus, bound.key[1]
        entry = self._groups.get((bus, group_of(can_id)))
        if not isinstance(entry, ReceivedGroup):
            config = self._configs.get(bus)
            entry = ReceivedGroup(config.address if config else None)
            self._groups[bus, group_of(can_id)] = entry
        if not bound.any_source:
            entry.of[can_id & 0xFF] = one
            return
        name = bound.name if isinstance(bound, BoundJoystick) else None
        moved = [r for r in self._axes.values() if r.bound.config.command.joystick == name]
        timeout_ns = bound.config.timeout_ms * 1_000_000
        entry.rest = AnySource(bus, bound.message.name, one, timeout_ns, moved)
        self._any[bus, group_of(can_id)] = entry.rest, one

    def handler(self, frame: Frame) -> FrameHandler | None:
        """Return the handler of the group of a frame."""
        if not frame.extended:
            return None
        return self._groups.get((frame.bus, group_of(frame.can_id)))

    def usual(self, frame: Frame) -> bool:
        """Whether the frame can be of a group that other nodes send and no DBC file has."""
        return frame.extended and frame.bus in self._buses

    @property
    def silent(self) -> frozenset[str]:
        """Buses on which our address is not ours: only the node itself may send there."""
        claimed = ClaimState.CLAIMED
        return frozenset(n for n, node in self.nodes.items() if node.state is not claimed)

    def frames(self, now_ns: int) -> Iterator[Frame]:
        """Yield the frames that the nodes have to send now."""
        for bus, node in self.nodes.items():
            yield from node.frames(self._active_faults(bus), now_ns)

    def changes(self) -> Iterator[AddressEvent | SourceEvent]:
        """Yield changes of our addresses since the last call, and new addresses of others."""
        for bus, node in self.nodes.items():
            if node.state is not self._reported[bus]:
                self._reported[bus] = node.state
                yield AddressEvent(bus, self._configs[bus].address, node.state)
        for one, _ in self._any.values():
            yield from one.events
            one.events.clear()

    def send_failed(self, frame: Frame) -> None:
        """Let our node claim again where a frame did not reach its bus."""
        if node := self.nodes.get(frame.bus):
            node.send_failed(claim=frame.extended and pgn_of(frame.can_id) == CLAIMED)

    def on_bus_off(self, bus: str) -> None:
        """Claim again before anything else, because claims of others were missed on this bus."""
        if node := self.nodes.get(bus):
            node.on_bus_off()

    def stalled(self) -> None:
        """Claim again on all buses, because claims of others were missed."""
        for node in self.nodes.values():
            node.on_bus_off()

    def invalidate(self, bus: str | None = None) -> None:
        """Invalidate inputs from any address, of one bus or of all."""
        for (where, _), (one, _) in self._any.items():
            if bus in (None, where):
                one.invalidate()

    def parts(self, places: Mapping[str, Key]) -> Iterator[tuple[Key, Part]]:
        """Yield parts that a reload carries over, see ``parts``; ``places``: keys of buses."""
        for (bus, group), (source, received) in self._any.items():
            yield ("source", *places[bus], group), source
            yield ("input", *places[bus], group), received
        for bus, node in self.nodes.items():
            config = self._configs[bus]
            key = (*places[bus], config.address, name_bytes(config.name))
            yield ("node", *key), node
            axes = [n for n, r in self._axes.items() if r.bound.config.valve.bus == bus]
            # By their place among the axes; with others a number would be that of another fault.
            yield ("faults", *key, config.first_spn, *self._axes, *axes), node.faults

    def _active_faults(self, bus: str) -> list[tuple[int, int]]:
        """(SPN, FMI): axes that cannot move as they are asked, valves that do not follow."""
        first, active = self._configs[bus].first_spn, []
        for i, runner in enumerate(self._axes.values()):
            if runner.bound.config.valve.bus != bus:
                continue
            if (fmi := FMI_OF.get(runner.axis.reason)) is not None:
                active.append((first + 2 * i, fmi))
            following = runner.feedback.following if runner.feedback else Following.UNKNOWN
            if (fmi := FMI_OF_FOLLOWING.get(following)) is not None:
                active.append((first + 2 * i + 1, fmi))
        return active


def _cyclic(deployment: Deployment, bus: str) -> Iterator[int]:
    """Groups that we send again and again under our address, by their number."""
    return (pgn_of(can_id) for can_id, extended in deployment.routing.buses[bus].sent if extended)
