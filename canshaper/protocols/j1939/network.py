"""J1939 on the buses of a deployment: our nodes, and messages known by their group."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from canshaper.codec.frame import CLAIMED, Frame, group_of, name_bytes, pgn_of
from canshaper.config.bus import J1939
from canshaper.inputs.input import MessageInput, Part, PartKey
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
    """The state of our address on a bus changed to ``state``."""

    bus: str
    address: int
    state: ClaimState

    @property
    def text(self) -> str:
        """Line for the log."""
        return f"bus={self.bus} address={self.address:#04x} state={self.state.value}"


class J1939Network(BusProtocol):
    """J1939 as a protocol: our nodes, and the groups that we receive, on all buses.

    Args:
        deployment: the machine.
        axes: axes of the machine; our node on the bus of its valve becomes an interlock of each,
            unless it only listens or its frames are a joystick's that we forward.
        inputs: (bound message, receiver of its frames) of each input of the machine.

    Attributes:
        nodes: our node on each bus of J1939, by bus.
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
            for control in () if deployment.listen_only else axes.values():
                if control.bound.config.valve.bus == bus and not control.bound.rewrites:
                    control.stops.interlocks.append(node.gate)
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
        """Return the handler of the J1939 group of a frame; None where we receive no such group."""
        if not frame.extended:
            return None
        return self._groups.get((frame.bus, group_of(frame.can_id)))

    def usual(self, frame: Frame) -> bool:
        """Return whether the frame has 29 bits on a J1939 bus, where unknown groups are normal."""
        return frame.extended and frame.bus in self._buses

    @property
    def silent(self) -> frozenset[str]:
        """Buses on which our address is not claimed: only the node itself may send there."""
        claimed = ClaimState.CLAIMED
        return frozenset(n for n, node in self.nodes.items() if node.state is not claimed)

    def frames(self, now_ns: int) -> Iterator[Frame]:
        """Yield the frames that the nodes have to send now."""
        for bus, node in self.nodes.items():
            yield from node.frames(self._active_faults(bus), now_ns)

    def changes(self) -> Iterator[AddressEvent | SourceEvent]:
        """Yield events since the last call: changes of our addresses, new addresses of others."""
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
        """Invalidate the inputs that are received from any address, on one bus or on all."""
        for (where, _), (one, _) in self._any.items():
            if bus in (None, where):
                one.invalidate()

    def parts(self, places: Mapping[str, PartKey]) -> Iterator[tuple[PartKey, Part]]:
        """Yield (key, part) of inputs from any address, nodes and faults, for a reload."""
        for (bus, group), (source, received) in self._any.items():
            yield ("source", *places[bus], group), source
            yield ("input", *places[bus], group), received
        for bus, node in self.nodes.items():
            config = self._configs[bus]
            key = (*places[bus], config.address, name_bytes(config.name))
            yield ("node", *key), node
            axes = [n for n, r in self._axes.items() if r.bound.config.valve.bus == bus]
            # An SPN counts axes: with other axes in the file the same SPN would be another fault.
            yield ("faults", *key, config.first_spn, *self._axes, *axes), node.faults

    def _active_faults(self, bus: str) -> list[tuple[int, int]]:
        """Return (SPN, FMI) of a bus's axes that cannot move as demanded, valves not following."""
        first, active = self._configs[bus].first_spn, []
        for i, control in enumerate(self._axes.values()):
            if control.bound.config.valve.bus != bus:
                continue
            if (fmi := FMI_OF.get(control.axis.reason)) is not None:
                active.append((first + 2 * i, fmi))
            following = control.feedback.following if control.feedback else Following.UNKNOWN
            if (fmi := FMI_OF_FOLLOWING.get(following)) is not None:
                active.append((first + 2 * i + 1, fmi))
        return active


def _cyclic(deployment: Deployment, bus: str) -> Iterator[int]:
    """Yield the PGNs of all that we send under our address, of which we refuse no request."""
    return (pgn_of(can_id) for can_id, extended in deployment.routing.buses[bus].sent if extended)
