"""What is on the buses of a machine besides the daemon: joysticks, valves, nodes, other senders.

It runs on a clock of the test's. Every frame has the time at which it is on its bus.
"""

import heapq
import itertools
import random
from collections.abc import Callable, Iterator

from canshaper.codec.frame import Frame
from tests.faults import inject
from tests.faults.hand import path
from tests.faults.inject import Fault
from tests.faults.inputs import Joystick
from tests.faults.machine import Machine
from tests.faults.nodes import CanopenNode, Claimant
from tests.faults.senders import Sender, radius_frames

RADIUS_CYCLE_NS = 100_000_000
MS = 1_000_000


class World:
    """Everything but the daemon.

    Args:
        machine: the deployment.
        rng: source of randomness.
        ticks: how long faults act and joysticks are moved; after that all is as ``healthy`` says.
        faults: what goes wrong.
        put: takes every frame as it comes onto its bus.

    Attributes:
        now_ns: the time.
        healthy: enable, reset and deflection (-1 to 1) of every joystick once the faults are over.
    """

    def __init__(
        self,
        machine: Machine,
        rng: random.Random,
        ticks: int,
        faults: list[Fault],
        put: Callable[[Frame, int], None],
    ) -> None:
        self.machine, self.rng, self.ticks, self.faults = machine, rng, ticks, faults
        self.now_ns = 0
        self.healthy = (1, 0, 0.0)
        self._put = put
        self._events: list[tuple[int, int, Callable[[], None]]] = []
        self._number = itertools.count()
        self._joysticks = {
            v.name: Sender(v, machine.tick_ms, rng) for v in machine.joysticks.values()
        }
        self._paths = {
            name: path(rng, ticks, axis.signal.full, int(axis.band * axis.signal.full))
            for name, axis in machine.axes.items()
        }
        self._toggles = {
            name: sorted((rng.randrange(ticks), rng.randrange(ticks))) for name in self._joysticks
        }
        self._toggled = rng.random() < 0.2
        self._radius = rng.randint(2000, 8000)
        self.nodes = {
            node.number: CanopenNode(self, node, machine, rng) for node in machine.nodes.values()
        }
        self.claimants = [Claimant(bus, own) for bus, own in machine.addresses.items()]
        for joystick in machine.joysticks.values():
            cycle_ns = joystick.cycle_ms * MS
            self.every(
                cycle_ns,
                rng.randrange(cycle_ns),
                lambda joystick=joystick: self._joystick(joystick),
            )
        if machine.radius:
            self.every(RADIUS_CYCLE_NS, rng.randrange(RADIUS_CYCLE_NS), self._radius_now)
        self.every(machine.tick_ns, rng.randrange(machine.tick_ns), self._others)

    # -- time -------------------------------------------------------------------------------------

    def at(self, time_ns: int, act: Callable[[], None]) -> None:
        """Do something at that time."""
        heapq.heappush(self._events, (time_ns, next(self._number), act))

    def every(self, cycle_ns: int, first_ns: int, act: Callable[[], None]) -> None:
        """Do something again and again."""

        def once() -> None:
            act()
            self.at(self.now_ns + cycle_ns, once)

        self.at(first_ns, once)

    def advance(self, passed_ns: int) -> None:
        """Let so much time pass."""
        end_ns = self.now_ns + passed_ns
        while self._events[0][0] <= end_ns:
            time_ns, _, act = heapq.heappop(self._events)
            self.now_ns = max(self.now_ns, time_ns)
            act()
        self.now_ns = max(self.now_ns, end_ns)

    @property
    def next_ns(self) -> int:
        """When something happens next."""
        return self._events[0][0]

    @property
    def tick(self) -> int:
        """The tick of the machine's cycle, from the start."""
        return self.now_ns // self.machine.tick_ns

    def active(self) -> Iterator[Fault]:
        """The faults that act now."""
        tick = self.tick
        return (f for f in self.faults if f.start <= tick < f.stop)

    # -- what is sent -----------------------------------------------------------------------------

    def put(self, frame: Frame) -> None:
        """A frame is on its bus."""
        self._put(frame, self.now_ns)

    def _joystick(self, joystick: Joystick) -> None:
        node = self.machine.joystick_nodes.get(joystick.name)
        if node and not self.nodes[node.number].operational:
            return
        sender = self._joysticks[joystick.name]
        mine = [f for f in self.active() if f.joystick is joystick]
        raw = sender.counted(self._hand(joystick))
        for fault in mine:
            if act := inject.RAW.get(fault.kind):
                act(fault, raw)
        sent = [joystick.data(raw)]
        for fault in mine:
            if spoil := inject.WIRE.get(fault.kind):
                sent = spoil(fault, sent)
        for data in sender.passed(sent):
            self.put(Frame(*joystick.key, data))

    def _hand(self, joystick: Joystick) -> dict[str, int]:
        """Raw values of joysticks and switches as the operator has them now."""
        tick = self.tick
        if tick >= self.ticks:
            enable, reset, deflection = self.healthy
            raw = {joystick.enable.name: enable}
            if joystick.reset:
                raw[joystick.reset.name] = reset
            for axis in joystick.axes:
                raw |= axis.raw(round(deflection * axis.signal.full))
            return raw
        raw = {joystick.enable.name: 1}
        first, second = self._toggles[joystick.name]
        if self._toggled and joystick.off and first <= tick < second:
            raw[joystick.off.name] = 1
        for axis in joystick.axes:
            raw |= axis.raw(self._paths[axis.name][tick])
        return raw

    def _radius_now(self) -> None:
        for frame in radius_frames(self.machine, self._radius, self.active()):
            self.put(frame)

    def _others(self) -> None:
        """What somebody else sends in each tick of a fault."""
        for fault in self.active():
            if extra := inject.EXTRA.get(fault.kind):
                for frame in extra(fault):
                    self.put(frame)

    # -- what the daemon sends --------------------------------------------------------------------

    def sent(self, frame: Frame) -> None:
        """A frame of the daemon is on its bus."""
        for node in self.nodes.values():
            node.command(frame)
        for claimant in self.claimants:
            claimant.sent(frame)
