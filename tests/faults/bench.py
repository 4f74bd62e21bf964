"""The real daemon, loop and all, on a clock and on buses of the test's: it runs in no time.

Only what is outside of it is replaced: time, sockets, signals, the process that reads the files.
"""

import logging
import pickle
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, ClassVar
from unittest.mock import patch

from canshaper.codec.frame import BusState, Frame
from canshaper.config.bus import Bus
from canshaper.daemon import control as control_module
from canshaper.daemon import daemon as module
from canshaper.daemon import gateway as gateway_module
from canshaper.daemon import ports as ports_module
from canshaper.daemon import reloads, reporter
from canshaper.errors import ConfigError, GatewayError
from canshaper.gate import cycle as cycle_module
from canshaper.gate import cycle as io_cycle_module
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.daemon.bench import Uncollected
from tests.faults.gated import Unrefused
from tests.faults.machine import Key
from tests.faults.rules import Rules
from tests.faults.world import World

# A clock that has run for long: 0 is no special time.
BEGIN_NS = 10**12


class BenchPort:
    """One bus: what comes waits until it is read, and its time of arrival stays known."""

    state = BusState.UP
    waited = 0
    why = ""
    confirmed = True

    def __init__(self, name: str, channel: str, bench: "Bench") -> None:
        self.name, self.channel = name, channel
        self.waiting: deque[tuple[Frame, int]] = deque()
        self.late: deque[tuple[Frame, int]] = deque()  # of our own ids: read behind the tick
        self.arrived_ns = 0
        self._bench = bench

    def frames(self) -> Iterator[Frame]:
        self._bench.reads(self)
        yield from self._read(self.waiting)
        self._bench.has_read(self)

    def background(self) -> Iterator[Frame]:
        yield from self._read(self.late)

    def _read(self, waiting: deque[tuple[Frame, int]]) -> Iterator[Frame]:
        while waiting:
            frame, arrived_ns = waiting.popleft()
            self._bench.note(f"  in {frame} of {arrived_ns / 1e6:.2f} ms")
            self._bench.rules.receive(frame, min(arrived_ns, self._bench.world.now_ns))
            self.arrived_ns = BEGIN_NS + arrived_ns  # by the clock of the daemon
            if (seen := self._bench.incoming(frame)) is not None:
                yield seen

    def send(self, frame: Frame) -> bool:
        return self._bench.sends(frame)

    def look(self) -> str:
        return ""

    def watch(self, name: str, ids: object) -> None:
        self.name = name
        self._bench.applies()

    def fileno(self) -> int:
        return -1

    def close(self) -> None: ...


class Loader:
    """Deployments by their files, each read once: a copy every time, as from the reader's process.

    Attributes:
        file: which of them is there now; None is one that cannot be read.
    """

    _read: ClassVar[dict[Path, bytes]] = {}

    def __init__(self, file: Path) -> None:
        self.file: Path | None = file

    def __call__(self) -> Deployment:
        if self.file is None:
            raise ConfigError("machine.yaml:1: this is no deployment")
        if self.file not in self._read:
            self._read[self.file] = pickle.dumps(load_deployment(self.file))
        deployment = pickle.loads(self._read[self.file])
        assert isinstance(deployment, Deployment)
        return deployment


class Bench:
    """A daemon, its world, and who watches both.

    Args:
        world: what is around the daemon.
        rules: who watches.
        load: reads the deployment.
        reading_polls: how many ticks it takes to read the files again.

    Attributes:
        requests: numbers to be set, as they come from the control socket.
        control: another control socket.
        refused: how often such a request was.
        holds: standstills to come: (time, where, for how long).
    """

    def __init__(self, world: World, rules: Rules, load: Loader, reading_polls: int = 2) -> None:
        self.world, self.rules = world, rules
        self.requests: list[dict[str, float]] = []
        self.control: Requests | None = None
        self.refused = self.applied = 0
        self.holds: list[tuple[int, str, int]] = []
        self.trace: Callable[[str], None] | None = None
        self.fails: Callable[[Key], bool] = lambda key: False
        # What a test changes between daemon and buses, behind the rules' back.
        self.incoming: Callable[[Frame], Frame | None] = lambda frame: frame
        self.outgoing: Callable[[Frame], Frame] = lambda frame: frame
        self._load = load
        self._polls = reading_polls
        self._ports: dict[str, BenchPort] = {}
        self._handlers: dict[int, Any] = {}
        self._until_ns = -1  # a gateway waits for its next tick until then

    # -- what the daemon asks ---------------------------------------------------------------------

    def now_ns(self) -> int:
        return BEGIN_NS + self.world.now_ns

    def sleep(self, seconds: float) -> None:
        """Sleep, a little too long, and now and then much too long."""
        self.world.advance(round(seconds * 1e9) + self.world.rng.randrange(200_000))
        self._hold("asleep")

    def select(self, *arguments: Any) -> tuple[list[int], list[int], list[int]]:
        """Wait for a frame, no longer than asked."""
        until_ns = self._until_ns = self.world.now_ns + round(arguments[-1] * 1e9)
        while not any(port.waiting for port in self._ports.values()):
            next_ns = min(self.world.next_ns, until_ns)
            self.world.advance(max(0, next_ns - self.world.now_ns))
            if next_ns >= until_ns:
                self._hold("asleep")
                return [], [], []
        self._hold("asleep")
        return [1], [], []

    def note(self, text: str) -> None:
        """A line of the trace."""
        if self.trace:
            self.trace(f"{self.world.now_ns / 1e6:9.2f} ms {text}")

    @property
    def _between(self) -> bool:
        """Whether a gateway reads what it passes on between two ticks."""
        return self.world.now_ns < self._until_ns

    def reads(self, port: BenchPort) -> None:
        """A tick begins with the first port; a gateway also reads between two of them."""
        if not self._between and port is next(iter(self._ports.values())):
            self.rules.reads(self.world.now_ns)

    def has_read(self, port: BenchPort) -> None:
        if not self._between and port is list(self._ports.values())[-1]:
            self.rules.decide()
            self._hold("between reading and sending")

    def sends(self, frame: Frame) -> bool:
        frame = self.outgoing(frame)
        if self.fails(frame[:3]):
            self.rules.failed(frame, self.world.now_ns)
            return False
        self.note(f"     out {frame} {self.rules.words()}")
        self.rules.sent(frame, self.world.now_ns)
        self.world.sent(frame)
        self._hold("between two frames")
        return True

    def applies(self) -> None:
        self.applied += 1
        for address in self.rules.addresses.values():
            address.reloaded = True
        for axis in self.rules.axes.values():
            axis.reloaded()
        self._hold("in a reload")

    def _hold(self, where: str) -> None:
        """Stand still, where that is due here."""
        for hold in self.holds:
            if hold[1] == where and hold[0] <= self.world.now_ns:
                self.holds.remove(hold)
                self.note(f"stands still {where} for {hold[2] / 1e6:.1f} ms")
                self.world.advance(hold[2])
                return

    # -- from outside -----------------------------------------------------------------------------

    def put(self, frame: Frame, now_ns: int) -> None:
        """A frame is on a bus."""
        if port := self._ports.get(frame.bus):
            machine = self.rules.machine
            late = frame[:3] in machine.valves or frame[:3] in machine.statuses
            (port.late if late else port.waiting).append((frame, now_ns))

    def signal(self, number: int) -> None:
        """Send the daemon a signal."""
        self._handlers[number](number, None)

    def run(self, seconds: float) -> None:
        """Run the daemon for so long."""
        self.world.at(round(seconds * 1e9), lambda: self.signal(module.signal.SIGTERM))
        with ExitStack() as stack:
            for target, name, new in self._replaced():
                stack.enter_context(patch.object(target, name, new))
            level = module.log.level
            module.log.setLevel(logging.CRITICAL)
            try:
                module.Daemon(self._load).run()
            finally:
                module.log.setLevel(level)
        self.rules.end(self.world.now_ns)

    def _replaced(self) -> Iterator[tuple[Any, str, Any]]:
        yield time, "monotonic_ns", self.now_ns
        for one in (module, reporter, cycle_module, io_cycle_module):
            yield one, "boottime_ns", self.now_ns
        yield time, "monotonic", lambda: self.now_ns() / 1e9
        yield time, "sleep", self.sleep
        yield module.signal, "signal", self._handlers.__setitem__
        yield ports_module, "open_port", self._open
        yield reloads, "ConfigReload", lambda load: Read(load, self._polls)
        yield module, "Controller", Unrefused
        yield module, "Collector", Uncollected
        yield control_module, "ControlServer", lambda *_: self.control or Requests(self)
        yield gateway_module, "select", self
        yield gateway_module, "rules", _no_rules
        yield module, "lock_memory", lambda: None
        yield module, "refuse_huge_pages", lambda: None

    def _open(self, name: str, bus: Bus, *_: object) -> BenchPort:
        self._ports[name] = BenchPort(name, bus.channel, self)
        return self._ports[name]


class Read:
    """A deployment that has been read after so many looks."""

    def __init__(self, load: Callable[[], Deployment], polls: int) -> None:
        try:
            self._found: Deployment | str = load()
        except ConfigError as error:
            self._found = str(error)
        self._polls = polls

    def result(self) -> Deployment | str | None:
        self._polls -= 1
        return None if self._polls > 0 else self._found

    def end(self) -> None: ...


class Requests:
    """The control socket: what the bench asks for."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def serve(self, answer: Callable[[Mapping[str, Any], str], Any], now_ns: int) -> None:
        for values in self._bench.requests:
            try:
                answer({"set": values}, "bench")
            except ValueError:
                self._bench.refused += 1
        self._bench.requests.clear()

    def close(self) -> None: ...


def _no_rules() -> None:
    raise GatewayError("no rules here")
