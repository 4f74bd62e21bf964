"""One random sequence of faults on a shipped deployment: the real daemon, judged by the rules.

Everything random comes from the seed. Faults come at random times, and often one right behind
another: a reload in a trip, an emergency in a standstill.
"""

import random
import signal
from collections import Counter
from collections.abc import Callable
from typing import Any

from tests.faults import inject, later
from tests.faults.bench import Bench, Loader
from tests.faults.fault import Fault
from tests.faults.judge import Violation
from tests.faults.machine import Key, Machine
from tests.faults.rules import Rules
from tests.faults.shipped import shipped
from tests.faults.world import World

# A sensor is trusted after some motion; with one they are longer.
BODY_TICKS, SENSOR_TICKS = (80, 200), (120, 320)
# Bringing a valve of CiA 408 to work takes longer than claiming an address.
SETTLE_S, SETTLE_CANOPEN_S = 1.3, 5.0
MOVES_WITHIN_S = 1.6
# Where the loop may stand still.
HOLDS = ("asleep", "between reading and sending", "between two frames", "in a reload")

Act = Callable[["Sequence", Fault], None]
Trace = Callable[[str], None] | None


def _hold(where: str) -> Act:
    def act(sequence: "Sequence", fault: Fault) -> None:
        machine = sequence.machine
        shortest_ns, tick_ns = machine.shortest_timeout_ns, machine.tick_ns
        held_ns = fault.rng.choice(
            (
                shortest_ns - tick_ns,
                fault.rng.randint(shortest_ns - tick_ns, shortest_ns + 4 * tick_ns),
                fault.rng.randint(shortest_ns, 3 * shortest_ns),
            )
        )
        sequence.bench.holds.append((sequence.world.now_ns, where, held_ns))
        if where == "in a reload":
            sequence.reload("same")

    return act


def _reload(what: str) -> Act:
    return lambda sequence, _fault: sequence.reload(what)


def _set(sequence: "Sequence", fault: Fault) -> None:
    ranges = sequence.shipped.ranges
    keys = fault.rng.sample(list(ranges), min(fault.rng.randint(1, 2), len(ranges)))
    sequence.bench.requests.append({key: fault.rng.uniform(*ranges[key]) for key in keys})


def _claim(difference: int) -> Act:
    def act(sequence: "Sequence", _fault: Fault) -> None:
        for claimant in sequence.world.claimants:
            if frame := claimant.claim(difference):
                sequence.world.put(frame)

    return act


def _commands(sequence: "Sequence", fault: Fault) -> None:
    for claimant in sequence.world.claimants:
        data = fault.rng.randbytes(8)
        sequence.world.put(claimant.command(fault.axis.valve_key, data))


def _node(name: str, *arguments: Any) -> Act:
    def act(sequence: "Sequence", fault: Fault) -> None:
        nodes = list(sequence.world.nodes.values())
        node = nodes[fault.memory.setdefault("node", fault.rng.randrange(len(nodes)))]
        if isinstance(getattr(node, name), bool):
            setattr(node, name, *arguments)
        else:
            getattr(node, name)(*arguments)

    return act


def _moved_to(*radii: int) -> Act:
    return lambda sequence, fault: setattr(sequence.world, "radius", fault.rng.choice(radii))


def _none(_sequence: "Sequence", _fault: Fault) -> None:
    """Nothing: it is over by itself."""


# What is done when a fault begins, and when it ends.
ACTS: dict[str, tuple[Act, Act]] = {
    **{f"standstill {where}": (_hold(where), _none) for where in HOLDS},
    **{f"reload {what}": (_reload(what), _none) for what in ("same", "changed", "broken")},
    "set": (_set, _none),
    "claim lower": (_claim(-5), _none),
    "claim same": (_claim(0), _none),
    "claim higher": (_claim(5), _none),
    "others: our valve, another address": (_commands, _none),
    "emergency": (_node("emergency", 0x8003, 0x81), _node("emergency", 0, 0)),
    "emergency, short": (_node("short_emergency"), _none),
    "emergency, partly over": (_node("emergency", 0x8003, 0x81), _node("emergency", 0, 0x01)),
    "heartbeat lost": (_node("silent", True), _node("silent", False)),
    "heartbeat of another state": (_node("stop"), _none),
    "boot-up": (_node("boot"), _none),
    "valve leaves active": (_node("leave_active"), _none),
    "valve leaves active, short": (_node("blink"), _none),
    "status word lost": (_node("mute", True), _node("mute", False)),
}
LATER: dict[str, tuple[Act, Act]] = {
    later.REFILTERED: (_reload("refiltered"), _none),
    later.AT_ITS_END: (_moved_to(1000, 9000), _moved_to(5000)),
}
SENDING = "loop: valve not sent"
LONG = {"heartbeat lost", "status word lost", "emergency"}


def kinds_for(machine: Machine) -> list[str]:
    """Every kind of fault that a shipped machine can have."""
    loop = {*inject.LOOP, *inject.STOP} - {SENDING}
    own = [k for k in inject.kinds_for(machine) if k not in loop]
    impossible = set()
    if not machine.nodes:
        impossible |= {
            k for k in ACTS if k.startswith(("emerg", "heart", "boot", "valve", "status"))
        }
    if not machine.addresses:
        impossible |= {k for k in ACTS if k.startswith("claim")}
    if not (machine.addresses and all(axis.valve_key[2] for axis in machine.axes.values())):
        impossible |= {k for k in ACTS if k.startswith("others")}
    return own + [k for k in ACTS if k not in impossible]


class Sequence:
    """One sequence of faults, from a seed."""

    def __init__(self, name: str, seed: int, trace: Trace = None, *, newer: bool = True) -> None:
        self.name, self.seed = name, seed
        self.shipped = shipped(name)
        self.machine = machine = self.shipped.machine
        self.rng = rng = random.Random(f"canshaper sequence {name} {seed}")
        # A machine of CANopen or J1939 takes its time before anything can move.
        self._first = 80 if machine.nodes else 20 if machine.addresses else 3
        self.ticks = self._first + rng.randint(*(SENSOR_TICKS if machine.sensors else BODY_TICKS))
        self.faults = self._plan()
        if newer:
            own = random.Random(f"canshaper later kinds {name} {seed}")
            self.faults += later.plan(machine, own, self.faults, self._first, self.ticks)
        self.world = World(machine, rng, self.ticks, self.faults, self._put)
        self.rules = Rules(machine)
        sets = any(f.kind == "set" for f in self.faults)
        self._file = self.shipped.adjustable if sets else self.shipped.file
        self._load = Loader(self._file)
        self.bench = Bench(self.world, self.rules, self._load, rng.randint(1, 12))
        self.bench.fails = self._fails
        self._trace = self.bench.trace = trace
        self.patient = rng.random() < 0.5
        self._moved: set[str] = set()

    def _plan(self) -> list[Fault]:
        rng, machine = self.rng, self.machine
        kinds = kinds_for(machine)
        acts = [k for k in kinds if k in ACTS]
        faults: list[Fault] = []
        for _ in range(rng.choice((1, 2, 2, 3, 3, 4, 6))):
            start = rng.randrange(self._first, self.ticks)
            if faults and rng.random() < 0.6:  # one fault in another, or right behind it
                start = faults[-1].start + rng.choice((0, 0, 1, 1, 2, 3, 5, 8, 15))
            kind = rng.choice(acts if rng.random() < 0.6 else kinds)
            if machine.sensors and rng.random() < 0.4:
                kind = rng.choice(inject.SENSOR)
            long = kind in LONG or kind in inject.SENSOR
            length = rng.choice((1, 1, 2, 3, 5, 7, 12, 30)) + (30 if long else 0)
            axis = rng.choice(list(machine.axes.values()))
            stop = min(start + length, self.ticks)
            if start < stop:
                faults.append(Fault(kind, start, stop, machine, rng, axis.joystick, axis))
        return faults

    def _put(self, frame: Any, now_ns: int) -> None:
        self.bench.put(frame, now_ns)

    def _fails(self, key: Key) -> bool:
        return any(f.kind == SENDING and f.axis.valve_key == key for f in self.world.active())

    def reload(self, what: str) -> None:
        """Ask the daemon to read its file again: the same, changed, or broken."""
        files = {"same": self._file, "broken": None}
        self._load.file = files[what] if what in files else getattr(self.shipped, what)
        self.bench.signal(signal.SIGHUP)

    # -- one run ----------------------------------------------------------------------------------

    def run(self) -> Counter[str]:
        """Run it; what was seen, counted.

        Raises:
            Violation: with seed, machine, time and what was allowed.
        """
        tick_ns, world = self.machine.tick_ns, self.world
        for fault in self.faults:
            if acts := (ACTS | LATER).get(fault.kind):
                for act, tick in zip(acts, (fault.start, fault.stop), strict=True):
                    at_ns = tick * tick_ns + self.rng.randrange(tick_ns)
                    world.at(at_ns, lambda act=act, fault=fault: self._act(act, fault))
        end_s = self.ticks * tick_ns / 1e9
        if self.patient:
            end_s = self._way_back(end_s)
        try:
            self.bench.run(end_s + 0.1)
            if self.patient and (missing := self.machine.axes.keys() - self._moved):
                raise Violation(f"{', '.join(sorted(missing))}: does not move again")
        except Violation as violation:
            faults = "; ".join(map(str, self.faults)) or "no faults"
            raise Violation(
                f"deployment {self.name}, seed {self.seed}, {world.now_ns / 1e6:.1f} ms:"
                f" {violation}\n  faults: {faults}\n"
                f"  again: python -m tests.faults {self.seed} --deployment {self.name} --trace"
            ) from None
        seen = Counter({f"fault {f.kind}": 1 for f in self.faults})
        seen.update(frames=self.rules.frames, moves=self.rules.moves, sequences=1)
        seen.update({f"deployment {self.name}": 1, "ways back": int(self.patient)})
        seen.update({f"sway sensor {state}": n for state, n in self.world.sensed.items()})
        seen.update({"reloads applied": self.bench.applied, "sets refused": self.bench.refused})
        return seen

    def _act(self, act: Act, fault: Fault) -> None:
        if self._trace:
            self._trace(f"{self.world.now_ns / 1e6:9.2f} ms  {fault}")
        act(self, fault)

    def _way_back(self, end_s: float) -> float:
        """All faults are over: a press with the joysticks in neutral, and every axis moves."""
        world, sign = self.world, self.rng.choice((-1.0, 1.0))
        world.at(round(end_s * 1e9), lambda: setattr(world, "radius", 5000))  # off its end stop
        settle_s = SETTLE_CANOPEN_S if self.machine.nodes else SETTLE_S
        if any(address for address in self.machine.addresses.values()):
            world.at(round(end_s * 1e9), lambda: self.reload("same"))
        for node in world.nodes.values():
            at_ns = round(end_s * 1e9) + 2 * self.machine.tick_ns
            world.at(at_ns, lambda node=node: node.emergency(0, 0))
        # Whatever runs on has come to rest, and no other node has sent our frames for a second.
        settle_s = max(settle_s, self.machine.rest_ticks * self.machine.tick_ns / 1e9)
        for after_s, healthy in (
            (settle_s, (0, 0, 0.0)),
            (settle_s + 0.2, (1, 0, 0.0)),
            (settle_s + 0.5, (1, 0, sign)),
        ):
            at_ns = round((end_s + after_s) * 1e9)
            world.at(at_ns, lambda healthy=healthy: setattr(world, "healthy", healthy))
        over_s = end_s + settle_s + 0.5
        world.every(self.machine.tick_ns, round(over_s * 1e9), lambda: self._moves(sign))
        # A swing that a stop has left is taken away by the next move: it may wait half a swing.
        rest_s = self.machine.rest_ticks * self.machine.tick_ns / 1e9
        return over_s + max(MOVES_WITHIN_S, 0.3 * rest_s)

    def _moves(self, sign: float) -> None:
        for name, axis in self.rules.axes.items():
            if axis.raw * sign > 0:
                self._moved.add(name)
