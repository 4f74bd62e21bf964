"""Joystick frame in to valve frame out, next to other gateways, in virtual time.

The daemon has a tick: a joystick frame waits for the next one. "from outside" has that wait, with
joystick frames at every phase of the tick. "processing" has not: from the last moment at which a
tick still takes a frame to the valve frame, which is wake-up, read, decode, filter, encode, send.
The other gateways answer every frame at once.

Times are the kernel's, from the gateway's interface to the valve's. "CPU" is that of the gateway's
process for a frame or a tick. Gateways have FIFO priority 40, the client 30, everything else none.

    python benchmarks/frames.py                            vcan0
    python benchmarks/frames.py --bus can --kernel rt      two controllers on a bus, PREEMPT_RT
    python benchmarks/frames.py --load flood busy disk     again with that load next to it

"ticks that follow" is the daemon with ``tick: { follow: left }``: from outside, with both joysticks
at their cycle; and how far its valve frames are apart.
"""

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from measure import Figure, Row, conditions, in_lane, print_table, progress, publish, quantile
from rig import (
    DBC,
    LOADS,
    PEERS,
    as_client,
    cpu_ns,
    daemon,
    load,
    run_in_lane,
    running,
    shipped,
    slew_only,
    wait_for_text,
)
from wire import HIGH_PCT, LOW_PCT, Exchange, Wire, wait_for_frames

WARM_UP = 100
ECHO_PERIOD_NS = 5_000_000
JOYSTICK_NS = 20_000_000
RIGHT_NS = 5_000_000  # the right joystick comes before the left
AHEAD_NS = 100_000  # what the client needs from one exchange to the next
PYTHON_ECHO, NOTIFIER = "Python echo", "Notifier + cantools"
ONE_AXIS, THREE_AXES = "canshaper, 1 axis, 1 ms", "canshaper, 3 axes, 20 ms"
FOLLOWS = "ticks that follow, 3 axes, 20 ms"
FIGURES = (
    Figure("joystick frame to valve frame, 1 axis, virtual us", NOTIFIER, most_ratio=0.5),
    Figure("joystick frame to valve frame, 3 axes, virtual us", NOTIFIER),
    Figure("as the first, next to an echo, virtual us", PYTHON_ECHO, most_ratio=2.5),
    Figure("with `follow` and the wait, median, virtual ms", "fixed ticks", most=1.6),
    Figure("with `follow` and the wait, longest, virtual ms", "fixed ticks", most=2.0),
    Figure("with `follow`, cycle of valve frames off by, virtual ms", most=0.3),
)


@dataclass
class Result:
    """Latencies of one gateway, us."""

    title: str
    times: list[float]
    cpu: float | None = None  # of the gateway's process, per frame or per tick


class Answering:
    """A gateway that answers every joystick frame at once."""

    def __init__(self, title: str, wire: Wire, pid: int, count: int) -> None:
        self.title, self.wire, self.pid, self.count = title, wire, pid, count

    def find_phase(self) -> None:
        """It has none."""

    def measure(self, at_work: Callable[[], bool]) -> list[Result]:
        """Frames at a steady rate, once the load is at work."""
        self._exchanges(WARM_UP)
        while not at_work():
            self._exchanges(1)
        before = cpu_ns(self.pid)
        seen = self._exchanges(self.count)
        cpu = (cpu_ns(self.pid) - before) / 1e3 / self.count
        return [Result(self.title, [e.gateway_us for e in seen], cpu)]

    def _exchanges(self, count: int) -> list[Exchange]:
        at = time.monotonic_ns()
        pcts = (HIGH_PCT, LOW_PCT)
        return [
            self.wire.exchange(at + i * ECHO_PERIOD_NS, pcts[i % 2], jump=False)
            for i in range(1, count + 1)
        ]


class Ticking:
    """The daemon. Its deadlines are measured by which frames just miss them."""

    def __init__(self, title: str, wire: Wire, pid: int, count: int, tick_ms: int) -> None:
        self.title, self.wire, self.pid, self.count = title, wire, pid, count
        self.tick_ns = tick_ms * 1_000_000
        # the shipped deployment listens to both joysticks
        self.right_ns = self.tick_ns // 4 if tick_ms == 20 else 0
        self._at = time.monotonic_ns()
        self._high = False
        self._slack_ns = 0  # from the moment asked for to the frame on the bus
        self._grid_ns = 0  # one of the valve frames
        self._latest_ns = 0  # from the last moment at which a tick takes a frame to its valve frame

    def find_phase(self) -> None:
        """Bring the axis into steady motion; find the last moment at which a tick takes a frame.

        Without load. With load, deadlines are where they were.
        """
        for _ in range(50):
            self._move(0.0)
        for _ in range(200):  # until the filter has settled about the middle
            self._move(self._joystick())
        seen = self._sweep(self._at, self.tick_ns, 50)
        self._grid_ns = seen[0].out_ns
        for width_ns in (self.tick_ns // 10, self.tick_ns // 100 + 20_000, 8_000):
            self._latest_ns = min(map(self._before, seen))
            last = self._grid_ns - self._latest_ns
            seen += self._sweep(last - width_ns * 2 // 3 - self._slack_ns, width_ns, 80)
        self._latest_ns = min(map(self._before, seen))

    def measure(self, at_work: Callable[[], bool]) -> list[Result]:
        """Frames at every phase, once the load is at work."""
        while not at_work():  # without frames the axis would stop
            self._move(self._joystick())
        before, begin = cpu_ns(self.pid), time.monotonic_ns()
        seen = self._sweep(self._at, self.tick_ns, self.count)
        ticks = (time.monotonic_ns() - begin) / self.tick_ns
        cpu = (cpu_ns(self.pid) - before) / 1e3 / ticks
        processing = [(self._latest_ns + self._late(e)) / 1e3 for e in seen]
        return [
            Result(f"{self.title}: processing", processing, cpu),
            Result(f"{self.title}: from outside", [e.gateway_us for e in seen]),
        ]

    def _late(self, exchange: Exchange) -> int:
        """A valve frame against the grid, ns."""
        away = exchange.out_ns - self._grid_ns + self.tick_ns // 2
        return away % self.tick_ns - self.tick_ns // 2

    def _before(self, exchange: Exchange) -> int:
        """From a joystick frame to the place of its answer on the grid, ns."""
        return exchange.out_ns - self._late(exchange) - exchange.in_ns

    def _move(self, pct: float) -> None:
        """Send a joystick frame a joystick's cycle after the last."""
        self._at = max(self._at + JOYSTICK_NS, time.monotonic_ns())
        self.wire.send(self._at, pct, self.right_ns)

    def _joystick(self) -> float:
        self._high = not self._high
        return HIGH_PCT if self._high else LOW_PCT

    def _sweep(self, start: int, width_ns: int, count: int) -> list[Exchange]:
        """One frame in every tick, each a step later in it."""
        at, soonest = start, self._at
        seen, slack = [], []
        for _ in range(count):
            soonest = max(soonest, time.monotonic_ns() + AHEAD_NS)
            at += max(0, -(-(soonest - at) // self.tick_ns)) * self.tick_ns
            seen.append(self.wire.exchange(at, self._joystick(), self.right_ns, jump=True))
            slack.append(seen[-1].in_ns - at)
            at += self.tick_ns + width_ns // count
        self._at = at
        self._slack_ns = round(statistics.median(slack))
        return seen


class Following:
    """The daemon whose ticks follow the joystick, which keeps its cycle."""

    def __init__(self, title: str, wire: Wire, pid: int, count: int) -> None:
        self.title, self.wire, self.pid, self.count = title, wire, pid, count
        self._at = time.monotonic_ns()

    def find_phase(self) -> None:
        """Wait until it follows the joystick's."""
        for _ in range(200):
            self._move(0.0)

    def measure(self, at_work: Callable[[], bool]) -> list[Result]:
        """Frames at the joystick's cycle, once the load is at work."""
        while not at_work():
            self._move(HIGH_PCT)
        for _ in range(200):
            self._move(HIGH_PCT)
        seen = []
        for _ in range(self.count):
            self._at += JOYSTICK_NS
            seen.append(self.wire.exchange(self._at, HIGH_PCT, RIGHT_NS, jump=False))
        apart = [(two.out_ns - one.out_ns) / 1e3 for one, two in pairwise(seen)]
        return [
            Result(f"{self.title}: from outside", [e.gateway_us for e in seen]),
            Result(f"{self.title}: valve frames apart", apart),
        ]

    def _move(self, pct: float) -> None:
        self._at += JOYSTICK_NS
        self.wire.send(self._at, pct, RIGHT_NS)


def each_gateway(
    directory: Path, wire: Wire, count: int
) -> Iterator[Answering | Ticking | Following]:
    """Every gateway, each running while it is yielded."""
    near, log = wire.near, directory / "log"
    peers: dict[str, list[str | Path]] = {
        PYTHON_ECHO: [sys.executable, PEERS / "echo.py", near],
        NOTIFIER: [sys.executable, PEERS / "notifier.py", near, DBC],
    }
    for title, command in peers.items():
        with running(command, log) as process:
            wait_for_text(process, log, "ready")
            yield Answering(title, wire, process.pid, count)
    deployments = {
        THREE_AXES: (shipped(directory, near), 20),
        ONE_AXIS: (slew_only(directory, near, 1), 1),
    }
    for title, (file, tick_ms) in deployments.items():
        with running(daemon(file), log) as process:
            wait_for_frames(wire, process, log)
            yield Ticking(title, wire, process.pid, count, tick_ms)
    file = shipped(directory, near)
    file.write_text("tick: { follow: left }\n" + file.read_text("utf-8"), "utf-8")
    with running(daemon(file), log) as process:
        wait_for_frames(wire, process, log)
        yield Following(FOLLOWS, wire, process.pid, count)


def print_results(results: list[Result]) -> None:
    """Print figures, and their ratios to the two peers in Python."""
    median = {r.title: statistics.median(r.times) for r in results}
    rows = []
    for r in results:
        figures = [min(r.times), median[r.title], quantile(r.times, 0.99), max(r.times)]
        cells = [f"{f:.1f}" for f in figures]
        cells += [f"{median[r.title] / median[peer]:.2f}" for peer in (PYTHON_ECHO, NOTIFIER)]
        cells.append("" if r.cpu is None else f"{r.cpu:.0f}")
        rows.append(Row(r.title, cells))
    print_table(["least", "median", "p99", "max", "/ echo", "/ Notifier", "CPU"], rows)


def publish_results(results: list[Result]) -> None:
    """Print the figures of the page."""
    by_title = {r.title: r for r in results}
    median = {title: statistics.median(r.times) for title, r in by_title.items()}
    one, three = (f"{title}: processing" for title in (ONE_AXIS, THREE_AXES))
    follows, fixed = (by_title[f"{t}: from outside"].times for t in (FOLLOWS, THREE_AXES))
    apart = by_title[f"{FOLLOWS}: valve frames apart"].times
    values = [
        (median[one], median[NOTIFIER]),
        (median[three], median[NOTIFIER]),
        (median[one], median[PYTHON_ECHO]),
        (statistics.median(follows) / 1e3, statistics.median(fixed) / 1e3),
        (max(follows) / 1e3, max(fixed) / 1e3),
        (max(abs(us / 1e3 - JOYSTICK_NS / 1e6) for us in apart),),
    ]
    publish(FIGURES, values)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bus", choices=("vcan", "can"), default="vcan")
    parser.add_argument("--kernel", choices=("std", "rt"), default="std")
    parser.add_argument("--load", nargs="*", choices=LOADS, default=[], help="kinds of load")
    parser.add_argument("--count", type=int, default=300, help="joystick frames")
    options = parser.parse_args()
    if not in_lane():
        raise SystemExit(run_in_lane(options.kernel))
    near, far = ("vcan0", "vcan0") if options.bus == "vcan" else ("can0", "can1")
    as_client()
    idle: list[Result] = []
    loaded: list[Result] = []
    with tempfile.TemporaryDirectory() as name:
        wire = Wire(near, far)
        for gateway in each_gateway(Path(name), wire, options.count):
            gateway.find_phase()
            idle += gateway.measure(lambda: True)
            if options.load:
                with load(Path(name), options.load) as at_work:
                    loaded += gateway.measure(at_work)
            progress(f"{gateway.title}: done")
    print(f"joystick frame to valve frame, us; {near} and {far}; {conditions()}")
    print_results(idle)
    if loaded:
        print(f"\nwith {', '.join(options.load)}")
        print_results(loaded)
    publish_results(idle)


if __name__ == "__main__":
    main()
