"""A deployment, checked: what its files say, with the codecs of its messages."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from cantools.database.can import Message

from canshaper.codec.canopen import EMERGENCY, HEARTBEAT, NMT
from canshaper.codec.codecs import AxisStatusCodec, IdentityCodec, Sender, ServiceStatusCodec
from canshaper.codec.j1939 import (
    CLAIMED,
    NULL,
    REQUEST,
    claims_of,
    group_of,
    identifier,
    sent_by,
)
from canshaper.codec.layout import is_j1939
from canshaper.codec.rewrite import RewrittenMessage
from canshaper.codec.valve import ValveCodec
from canshaper.config.schema import (
    AxisConfig,
    DeploymentConfig,
    RadialConfig,
)
from canshaper.config.source import Source
from canshaper.machine.bus_load import BusLoad, bus_load
from canshaper.machine.database import Messages
from canshaper.machine.identity import Identity
from canshaper.machine.ids import Ids
from canshaper.machine.inputs import (
    BoundFeedback,
    BoundInput,
    BoundJoystick,
    BoundRadius,
    BoundStatusWord,
    BoundStop,
    BoundSwitch,
)


@dataclass(frozen=True)
class BoundRadial:
    """Radial compensation with the message of its radius, where that is measured."""

    config: RadialConfig
    radius: BoundRadius | None

    @property
    def key(self) -> tuple[str, int, bool] | None:
        """Where the frames of the radius are found."""
        return self.radius.key if self.radius else None


@dataclass(frozen=True)
class BoundAxis:
    """An axis with its valve message and, where it has one, its status message."""

    name: str
    config: AxisConfig
    valve_message: Message
    valve: ValveCodec
    period_ticks: int
    status: AxisStatusCodec | None
    status_ticks: int
    radial: BoundRadial | None = None
    feedback: BoundFeedback | None = None
    status_word: BoundStatusWord | None = None

    @property
    def rewrites(self) -> bool:
        """Whether its command leaves in the frames of its own joystick, through a gateway."""
        return isinstance(self.valve.message, RewrittenMessage)


@dataclass(frozen=True)
class Deployment:
    """Everything the controller needs, checked."""

    path: Path
    config: DeploymentConfig
    messages: Messages
    joysticks: dict[str, BoundJoystick]
    axes: dict[str, BoundAxis]
    emergency_stop: BoundStop | None
    status: ServiceStatusCodec | None
    status_ticks: int
    identity: Identity
    identity_status: IdentityCodec | None
    load_state: BoundSwitch | None
    profile: BoundSwitch | None
    on_bus: dict[str, list[Message]]
    source: Source = field(compare=False)
    """The file, for the lines of what is wrong with it on this machine."""
    listen_only: bool = False
    """Nothing is sent but status: another controller drives the machine, or nobody does."""

    def load(self, bus: str) -> BusLoad | None:
        """Load of a bus by the messages of the deployment; None where its bit rate is not given."""
        bitrate = self.config.buses[bus].bitrate
        return bus_load(self.on_bus.get(bus, []), bitrate) if bitrate else None

    def ids(self, bus: str) -> Ids:
        """Messages that matter on a bus."""
        radii = [a.radial.radius for a in self.axes.values() if a.radial and a.radial.radius]
        inputs = [i for i in (*self.inputs(), *radii) if i.key[0] == bus]
        taken = [key for i in inputs if not i.by_group for key in i.keys]
        valves = [a.valve.message.sender.key for a in self.axes.values()]
        if self.listen_only:  # they are those of another
            valves = []
        sent = valves + [s.sender.key for s in self._statuses()]
        canopen = self.config.buses[bus].canopen
        if canopen:
            nodes = [n.id for n in canopen.nodes.values()]
            taken += [(bus, base + n, False) for n in nodes for base in (HEARTBEAT, EMERGENCY)]
            if not self.listen_only:
                sent.append((bus, HEARTBEAT + canopen.node, False))
                sent += [(bus, NMT, False)] if canopen.master else []
        own = self.config.buses[bus].j1939
        claims: list[int] = []
        if own:
            claims = claims_of(own.address)
            if self.listen_only:
                claims.append(identifier(REQUEST, NULL))
            else:
                sent += [(bus, can_id, True) for can_id in sent_by(own.address)]
        groups = {group_of(i.key[1]) for i in inputs if i.by_group}
        return Ids(
            frozenset(key[1:] for key in taken if key[0] == bus),
            frozenset(key[1:] for key in sent if key[0] == bus),
            frozenset(key[1:] for key in valves if key[0] == bus),
            frozenset(self.messages.ids()),
            frozenset(groups | ({CLAIMED << 8, REQUEST << 8} if own else set())),
            frozenset(self.sent_groups(bus)),
            frozenset((can_id, True) for can_id in claims),
            self.is_j1939(bus),
            canopen is not None,
            self.in_line(bus),
        )

    def in_line(self, bus: str) -> bool:
        """Whether a bus is one of the gateway: what nobody knows there is what it passes on."""
        gateway = self.config.gateway
        return gateway is not None and bus in gateway.between

    def is_j1939(self, bus: str) -> bool:
        """Whether a bus is one of J1939: we have an address there, or know a message of it."""
        has_node = self.config.buses[bus].j1939 is not None
        return has_node or any(is_j1939(message) for message in self.on_bus.get(bus, ()))

    def inputs(self) -> list[BoundInput]:
        """Joysticks, switches, feedback and status words of the valves."""
        axes = self.axes.values()
        told = [i for axis in axes for i in (axis.feedback, axis.status_word)]
        others = (self.emergency_stop, self.load_state, self.profile, *told)
        return [*self.joysticks.values(), *(i for i in others if i)]

    def senders(self) -> list[Sender]:
        """Every message of the DBC files that we send, each once."""
        valves = [axis.valve.message.sender for axis in self.axes.values()]
        statuses = [status.sender for status in self._statuses()]
        return list({sender.key: sender for sender in (*valves, *statuses)}.values())

    def sent_groups(self, bus: str) -> set[int]:
        """Groups of J1939 that command a valve of ours, from whatever address they come.

        Not those of joysticks whose frames we pass on: others send the same group.
        """
        return {
            group_of(axis.valve.message.sender.key[1])
            for axis in self.axes.values()
            if axis.config.valve.bus == bus and is_j1939(axis.valve_message)
            if not axis.rewrites and not self.listen_only
        }

    def listening(self) -> "Deployment":
        """The same machine for one who only listens, and tells what it would do.

        What valves say of themselves answers another controller's commands, so it is not compared
        with ours. A node of ours on J1939 stays where a status message needs its address, which it
        gives up to whoever has it.
        """
        told = {s.sender.key[0] for s in self._statuses()}
        buses = {
            name: bus if name in told else bus.model_copy(update={"j1939": None})
            for name, bus in self.config.buses.items()
        }
        axes = {n: replace(a, feedback=None, status_word=None) for n, a in self.axes.items()}
        config = self.config.model_copy(update={"buses": buses})
        return replace(self, config=config, axes=axes, listen_only=True)

    def _statuses(self) -> list[AxisStatusCodec | IdentityCodec | ServiceStatusCodec]:
        """Every status message that is sent."""
        of_axes = [axis.status for axis in self.axes.values()]
        return [s for s in (self.status, self.identity_status, *of_axes) if s]
