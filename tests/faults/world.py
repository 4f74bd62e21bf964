"""Other senders on the buses of a machine: joysticks, valves, nodes, a second sender.

It runs on a clock of the test's. Every frame has the time at which it is on its bus.
"""

import heapq
import itertools
import random
from collections import Counter
from collections.abc import Callable, Iterator

from canshaper.codec.frame import Frame
from tests.faults import inject, later
from tests.faults.fault import Fault
from tests.faults.hand import path
from tests.faults.inputs import Joystick
from tests.faults.joystick_faults import joystick_frames
from tests.faults.machine import Machine
from tests.faults.nodes import CanopenNode, Claimant
from tests.faults.senders import Sender, radius_frames
from tests.faults.sensor import SensorMessage, sensor_frame
from tests.faults.swing import Swing

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
        sensed: status frames by what they say of a sway sensor.
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
        self.sensed: Counter[str] = Counter()
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
        self.radius = rng.randint(2000, 8000)
        if machine.ends and rng.random() < 0.5:  # at an end stop
            self.radius = rng.choice((1000, 9000))
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
        for switches in machine.switches:
            cycle_ns = switches.cycle_ms * MS
            sender = Sender(switches, machine.tick_ms, rng)
            self.every(cycle_ns, rng.randrange(cycle_ns), lambda one=sender: self._switches(one))
        if machine.stop:
            cycle_ns = machine.stop.cycle_ms * MS
            stop = Sender(machine.stop, machine.tick_ms, rng)
            self.every(cycle_ns, rng.randrange(cycle_ns), lambda: self._stop(stop))
        if machine.radius:
            self.every(RADIUS_CYCLE_NS, rng.randrange(RADIUS_CYCLE_NS), self._radius_now)
        self._swings = {n: Swing(a, rng) for n, a in machine.axes.items() if a.period_s}
        self._by_valve = {one.axis.valve_key: one for one in self._swings.values()}
        for sensor in machine.sensors.values():
            cycle_ns = sensor.cycle_ms * MS
            self.every(cycle_ns, rng.randrange(cycle_ns), lambda one=sensor: self._sensor(one))
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

    def _put_input(self, frame: Frame) -> None:
        """Put a frame on its bus by whose age the daemon stops in the same tick."""
        self._put(frame, later.stamp(self.now_ns, self.active()))

    def _joystick(self, joystick: Joystick) -> None:
        node = self.machine.joystick_nodes.get(joystick.name)
        if node and not self.nodes[node.number].operational:
            return
        sender = self._joysticks[joystick.name]
        raw = sender.counted(later.hand(joystick, self._hand(joystick), self.active()))
        sent = joystick_frames(joystick, [raw], self.active())
        for data in sender.passed(later.paired(joystick, sent, self.active())):
            self._put_input(Frame(*joystick.key, data))

    def _switches(self, sender: Sender) -> None:
        switches = sender.source
        raw = sender.counted(dict(switches.codes))
        sent = inject.input_frames(switches, raw, self.active(), inject.SWITCHES)
        for data in sender.passed(sent):
            self._put_input(Frame(*switches.key, data))

    def _stop(self, sender: Sender) -> None:
        raw = sender.counted({self.machine.stop_field.name: 0})
        sent = inject.input_frames(sender.source, raw, self.active(), inject.STOP)
        for data in sender.passed(sent):
            self.put(Frame(*sender.source.key, data))

    def _hand(self, joystick: Joystick) -> dict[str, int]:
        """Raw values of joysticks and switches as the operator has them now."""
        tick = self.tick
        if tick >= self.ticks:
            enable, reset, deflection = self.healthy
            raw = joystick.pressed(enable)
            if joystick.reset:
                raw[joystick.reset.name] = reset
            for axis in joystick.axes:
                raw |= axis.raw(round(deflection * axis.signal.full))
            return raw
        raw = joystick.pressed()
        first, second = self._toggles[joystick.name]
        if self._toggled and joystick.off and first <= tick < second:
            raw[joystick.off.name] = 1
        for axis in joystick.axes:
            raw |= axis.raw(self._paths[axis.name][tick])
        return raw

    def _radius_now(self) -> None:
        for frame in radius_frames(self.machine, self.radius, self.active()):
            self.put(frame)

    def _sensor(self, sensor: SensorMessage) -> None:
        if sensor.node is not None and not self.nodes[sensor.node].operational:
            return
        for swing in self._swings.values():
            swing.advance(self.now_ns, self.active())
        values = sensor.values(self._swings, self.rng)
        if (data := sensor_frame(sensor, values, self.active())) is not None:
            self.put(Frame(*sensor.key, data))

    def _others(self) -> None:
        """Return the frames of another sender in a tick of a fault."""
        for fault in self.active():
            extra = inject.EXTRA.get(fault.kind, later.choices)
            for frame in extra(fault):
                self.put(frame)

    # -- what the daemon sends --------------------------------------------------------------------

    def sent(self, frame: Frame) -> None:
        """A frame of the daemon is on its bus."""
        if swing := self._by_valve.get(frame[:3]):
            swing.command(frame.data)
        status = self.machine.statuses.get(frame[:3])
        if status and status.period_s:
            self.sensed[status.sensor_state(frame.data)] += 1
        for node in self.nodes.values():
            node.command(frame)
        for claimant in self.claimants:
            claimant.sent(frame)
