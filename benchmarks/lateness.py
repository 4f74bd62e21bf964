"""How late ticks begin and how long they take, idle and under load, in virtual time.

Next to the daemon, a loop in Python that only sleeps until its next deadline. Load is cangen
without a gap on another interface, candump reading it, two busy loops, a process that writes and
syncs; with "same", a bus full of foreign frames for the daemon too. Loops have FIFO priority 40,
the joystick 30, everything else none.

    python benchmarks/lateness.py
    python benchmarks/lateness.py --kernel rt
    python benchmarks/lateness.py --ticks 10000 --load flood same busy disk
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

from measure import Figure, Row, conditions, in_lane, print_table, progress, publish, quantile
from rig import (
    GATEWAY_FIFO,
    LOADS,
    PEERS,
    ROOT,
    as_client,
    load,
    run_in_lane,
    running,
    shipped,
    slew_only,
)
from wire import HIGH_PCT, LOW_PCT, Wire, wait_for_frames

MS = 1_000_000
JOYSTICK_NS = 20 * MS
CHANNEL = "vcan0"
# Of ticks of 20 ms a tenth as many: a second under load takes twenty.
SHORTER = 10
PEER, ONE_AXIS = "Python, sleeps only, 1 ms", "canshaper, 1 axis, 1 ms"
# At most a tenth of the tick.
FIGURES = (Figure("lateness under load, p99.9, tick of 1 ms, virtual us", PEER, most=100),)


@dataclass
class Ticks:
    """Lateness of a loop in one condition, ns."""

    title: str
    late: list[int] = field(default_factory=list)
    work: list[int] = field(default_factory=list)
    missed: int = 0


class Bench:
    """Loops, each measured idle and, where load is asked for, under load."""

    def __init__(self, directory: Path, count: int, kinds: list[str]) -> None:
        self.directory, self.count, self.kinds = directory, count, kinds
        self.results: dict[bool, list[Ticks]] = {False: [], True: []}
        self._wire = Wire(CHANNEL, CHANNEL)
        self._high = False

    def sleeper(self, title: str, command: list[str | Path]) -> None:
        """A loop that only sleeps, at 1 ms."""
        log = self.directory / "lateness"
        for loaded in self._conditions():
            with self._load(loaded) as at_work:
                while not at_work():
                    time.sleep(0.1)
                with running([*command, str(MS), str(self.count)], log) as process:
                    process.wait()
            late = [int(line.split()[1]) for line in log.read_text().splitlines()]
            self.results[loaded].append(Ticks(title, late))
        progress(f"{title}: done")

    def daemon(self, title: str, file: Path, tick_ms: int, fifo: int | None) -> None:
        """The daemon with a joystick that moves all the time."""
        notes, log = self.directory / "ticks", self.directory / "log"
        command = [sys.executable, ROOT / "benchmarks" / "observed.py", "ticks", notes, file]
        count = self.count if tick_ms == 1 else self.count // SHORTER
        windows = {}
        with running(command, log, fifo) as process:
            wait_for_frames(self._wire, process, log)
            self._drive(10**9, neutral=True)
            for loaded in self._conditions():
                with self._load(loaded) as at_work:
                    self._drive(10**9)  # whatever happens for the first time
                    while not at_work():
                        self._drive(JOYSTICK_NS)
                    windows[loaded] = self._drive(count * tick_ms * MS)
        for loaded, (begin, end) in windows.items():
            ticks = Ticks(title)
            for line in notes.read_text().splitlines():
                at, late, work, missed = map(int, line.split())
                if begin <= at < end:
                    ticks.late.append(late)
                    ticks.work.append(work)
                    ticks.missed += missed
            self.results[loaded].append(ticks)
        progress(f"{title}: done")

    def _drive(self, duration_ns: int, *, neutral: bool = False) -> tuple[int, int]:
        """Move the joystick for so long; begin and end.

        What waits is read before: ours is the higher priority than that of a loop without any.
        """
        self._wire.drain()
        begin = at = time.monotonic_ns() + JOYSTICK_NS
        while at < begin + duration_ns:
            at += JOYSTICK_NS
            self._high = not self._high
            moved = HIGH_PCT if self._high else LOW_PCT
            self._wire.send(at, 0.0 if neutral else moved, JOYSTICK_NS // 4)
        return begin, at

    def _conditions(self) -> list[bool]:
        return [False, True] if self.kinds else [False]

    def _load(self, loaded: bool) -> AbstractContextManager[Callable[[], bool]]:
        return load(self.directory, self.kinds if loaded else [])


def print_ticks(all_ticks: list[Ticks]) -> None:
    """Print figures in us."""
    rows = []
    for t in all_ticks:
        cells = [str(len(t.late))]
        cells += [f"{quantile(t.late, q) / 1e3:.1f}" for q in (0.5, 0.99, 0.999, 1.0)]
        if t.work:
            cells += [f"{quantile(t.work, q) / 1e3:.0f}" for q in (0.5, 0.99, 1.0)]
            cells += [str(t.missed)]
        else:
            cells += [""] * 4
        rows.append(Row(t.title, cells))
    heads = ["ticks", "late p50", "p99", "p99.9", "max", "work p50", "p99", "max", "missed"]
    print_table(heads, rows)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kernel", choices=("std", "rt"), default="std")
    parser.add_argument("--ticks", type=int, default=2000, help="of 1 ms; of 20 ms a tenth of it")
    parser.add_argument("--load", nargs="*", choices=LOADS, default=["flood", "busy", "disk"])
    options = parser.parse_args()
    if not in_lane():
        raise SystemExit(run_in_lane(options.kernel))
    as_client()
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)
        bench = Bench(directory, options.ticks, options.load)
        bench.sleeper(PEER, [sys.executable, PEERS / "sleeper.py"])
        one, three = slew_only(directory, CHANNEL, 1), shipped(directory, CHANNEL)
        bench.daemon(ONE_AXIS, one, 1, GATEWAY_FIFO)
        bench.daemon("canshaper, 3 axes, 20 ms", three, 20, GATEWAY_FIFO)
        bench.daemon(f"{ONE_AXIS}, no FIFO", one, 1, None)
    print(f"lateness and work of ticks, us; {conditions()}")
    print_ticks(bench.results[False])
    if options.load:
        print(f"\nwith {', '.join(options.load)}")
        print_ticks(bench.results[True])
        us = {t.title: quantile(t.late, 0.999) / 1e3 for t in bench.results[True]}
        publish(FIGURES, [(us[ONE_AXIS], us[PEER])])


if __name__ == "__main__":
    main()
