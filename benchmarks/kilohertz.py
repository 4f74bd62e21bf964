"""Eight axes at 1 kHz on one core: of this machine by its own clock, or in virtual time.

The daemon runs as ``canshaper run`` does, on a multicast group of python-can, or with ``--vcan`` on
SocketCAN in virtual time; joystick frames come every 20 ms and keep all axes moving. Next to it, on
the same core at the same time, one priority above it, a loop in C that only sleeps until its next
deadline: what that one misses, the machine has done. "own" are deadlines that the daemon missed
while the C loop was never late by more than a tenth of a tick. Where real-time priorities may not
be had, both run without.

    python benchmarks/kilohertz.py
    python benchmarks/kilohertz.py --vcan
    python benchmarks/kilohertz.py --axes 4 --tick-ms 2 --seconds 30
"""

import argparse
import itertools
import os
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import yaml
from rig import (
    GATEWAY_FIFO,
    PEERS,
    ROOT,
    Row,
    as_client,
    compiled,
    cpu_ns,
    in_lane,
    machine,
    print_table,
    quantile,
    run_in_lane,
    running,
    wait_for_text,
)

from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import Frame
from canshaper.config.schema import Bus
from canshaper.machine.binding import load_deployment

JOYSTICK_MS = 20
JOYSTICK, VALVE = 0x110, 0x200
JOYSTICK_TEXT = """
BO_ {id} Joystick{n}: 8 JOYSTICKS
 SG_ Joystick : 0|16@1- (0.1,0) [-100|100] "%" SHAPER
 SG_ Enable : 32|2@1+ (1,0) [0|1] "" SHAPER
 SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER
"""
VALVE_TEXT = """
BO_ {id} Valve{n}: 2 SHAPER
 SG_ Velocity : 0|8@1- (0.8,0) [-100|100] "%" VALVES
 SG_ AliveCounter : 8|8@1+ (1,0) [0|255] "" VALVES
"""
CYCLES = """
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
"""


def deployment(directory: Path, axes: int, tick_ms: int, bus: Bus) -> Path:
    """A machine with a joystick, a valve and G_FF for each axis; every valve in every tick."""
    dbc = 'VERSION "1"\n\nNS_ :\n\nBS_:\n\nBU_: JOYSTICKS SHAPER VALVES\n'
    cycles = CYCLES
    buses = {"crane": {"interface": bus.interface, "channel": bus.channel}}
    config: dict[str, Any] = {"version": 1, "tick_ms": tick_ms, "buses": buses, "dbc": ["many.dbc"]}
    config |= {"joysticks": {}, "axes": {}}
    for n in range(axes):
        dbc += JOYSTICK_TEXT.format(id=JOYSTICK + n, n=n) + VALVE_TEXT.format(id=VALVE + n, n=n)
        cycles += f'BA_ "GenMsgCycleTime" BO_ {JOYSTICK + n} {JOYSTICK_MS};\n'
        cycles += f'BA_ "GenMsgCycleTime" BO_ {VALVE + n} {tick_ms};\n'
        config["joysticks"][f"joystick{n}"] = {
            **{"bus": "crane", "message": f"Joystick{n}", "timeout_ms": 1000},
            **{"enable": "Enable", "alive_counter": "AliveCounter"},
        }
        valve = {"bus": "crane", "message": f"Valve{n}", "signal": "Velocity", "timeout_ms": 200}
        config["axes"][f"axis{n}"] = {
            "command": {"joystick": f"joystick{n}", "signal": "Joystick"},
            "valve": {**valve, "alive_counter": "AliveCounter"},
            "sway": {"period_s": 2.0 + 0.1 * n, "damping_ratio": 0.05, "full_speed_m_s": 1.0},
            "filter": {"kind": "gff", "a1": 0.708, "a2": 0.12},
        }
    (directory / "many.dbc").write_text(dbc + cycles)
    file = directory / "many.yaml"
    file.write_text(yaml.safe_dump(config, sort_keys=False))
    return file


class Hands:
    """All joysticks, enabled, moved slowly to and fro after a second in neutral."""

    def __init__(self, file: Path, port: Port) -> None:
        self._port = port
        self._joysticks = [
            joystick.message for joystick in load_deployment(file).joysticks.values()
        ]
        self._count = 0

    def drive(self, duration_s: float, *, neutral: bool = False) -> tuple[int, int]:
        """Send for so long; monotonic begin and end, ns."""
        begin = time.monotonic_ns()
        frames = round(duration_s * 1000 / JOYSTICK_MS)
        for i in range(frames):
            self._count += 1
            phase = i / 100 % 2  # there and back in four seconds
            joystick = 0.0 if neutral else 20.0 + 60.0 * min(phase, 2 - phase)
            values = {"Joystick": joystick, "Enable": 1, "AliveCounter": self._count % 256}
            for message in self._joysticks:
                data = message.encode(values)
                self._port.send(Frame("crane", message.frame_id, False, data))
            for _ in self._port.frames():  # or its queue would fill
                pass
            left = begin + (i + 1) * JOYSTICK_MS * 1_000_000 - time.monotonic_ns()
            time.sleep(max(0, left) / 1e9)
        return begin, time.monotonic_ns()


def may_fifo(core: int) -> bool:
    """Whether this user may have the priority."""
    command = ["taskset", "-c", str(core), "chrt", "-f", str(GATEWAY_FIFO), "true"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--axes", type=int, default=8)
    parser.add_argument("--tick-ms", type=int, default=1)
    parser.add_argument("--seconds", type=int, default=10)
    parser.add_argument("--vcan", action="store_true", help="SocketCAN, in virtual time")
    options = parser.parse_args()
    if options.vcan and not in_lane():
        raise SystemExit(run_in_lane("std"))
    core = max(os.sched_getaffinity(0))
    fifo = GATEWAY_FIFO if may_fifo(core) else None
    group = f"239.78.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
    bus = Bus(interface="udp_multicast", channel=group)
    if options.vcan:
        as_client()
        bus = Bus(interface="socketcan", channel="vcan0")
    period_ns = options.tick_ms * 1_000_000
    with tempfile.TemporaryDirectory() as name:
        file = deployment(Path(name), options.axes, options.tick_ms, bus)
        count = options.seconds * 1000 // options.tick_ms
        with closing(open_port("crane", bus, lambda _fault: None)) as port:
            run = Run.of(file, port, core=core, fifo=fifo, period_ns=period_ns, count=count)
    rows = [run.row(period_ns)]
    if run.peers:
        late = [p[1] for p in run.peers]
        rows.append(row("C, sleeps only", late, [], sum(n >= period_ns for n in late), None))
    policy = f"FIFO {fifo}" if fifo else "no real-time priority"
    print(f"{options.axes} axes, tick {options.tick_ms} ms, core {core}, {policy}; us")
    if options.vcan:
        print(machine())
    heads = ["ticks", "late p50", "p99", "p99.9", "max", "work p50", "p99", "missed", "own"]
    print_table(heads, rows)
    print(f"CPU of the daemon: {100 * run.share:.0f} % of the core")
    for line in run.log.splitlines():
        if "fault=" in line or "STOPPING" in line or "TRIPPED" in line:
            print(line)


@dataclass
class Run:
    """What both loops wrote while both ran: daemon's ticks, the C loop's deadlines, a log."""

    ticks: list[list[int]]
    peers: list[list[int]]
    share: float
    log: str

    @classmethod
    def of(
        cls, file: Path, port: Port, *, core: int, fifo: int | None, period_ns: int, count: int
    ) -> Self:
        """Run both on one core."""
        directory = file.parent
        sleeper = compiled(PEERS / "sleeper.c", directory)
        notes, log, late = directory / "ticks", directory / "log", directory / "late"
        hands = Hands(file, port)  # before: at our priority it keeps the kernel from its frames
        on_core = ["taskset", "-c", str(core)]
        program = ROOT / "benchmarks" / "observed.py"
        with running([*on_core, sys.executable, program, "ticks", notes, file], log, fifo) as ours:
            wait_for_text(ours, log, "started")
            hands.drive(1.0, neutral=True)
            hands.drive(1.0)
            peer = [*on_core, sleeper, str(period_ns), str(count)] if sleeper else ["true"]
            before = cpu_ns(ours.pid)
            with running(peer, late, fifo and fifo + 1) as sleeping:
                begin, end = hands.drive(period_ns * count / 1e9)
                share = (cpu_ns(ours.pid) - before) / (end - begin)
                sleeping.wait()
        peers = numbers(late)
        if peers:  # the time in which both ran
            begin, end = peers[0][0], peers[-1][0]
        ticks = [tick for tick in numbers(notes) if begin <= tick[0] < end]
        return cls(ticks, peers, share, log.read_text())

    def row(self, period_ns: int) -> Row:
        """The daemon's row of the table."""
        late, work, missed = ([tick[i] for tick in self.ticks] for i in (1, 2, 3))
        return row("canshaper run", late, work, sum(missed), self.own(period_ns))

    def own(self, period_ns: int) -> int:
        """Deadlines that the daemon missed while the machine let the C loop run in time.

        A missed deadline lies between the begin of one tick and that of the next.
        """
        late = [(at, at + by) for at, by in self.peers if by > period_ns // 10]
        count = 0
        for before, tick in itertools.pairwise(self.ticks):
            if tick[3] and not any(begin < tick[0] and end > before[0] for begin, end in late):
                count += tick[3]
        return count


def numbers(file: Path) -> list[list[int]]:
    """Lines of whole numbers."""
    return [list(map(int, line.split())) for line in file.read_text().splitlines()]


def row(title: str, late: list[int], work: list[int], missed: int, ours: int | None) -> Row:
    """A row of the table."""
    cells = [str(len(late)), *(f"{quantile(late, q) / 1e3:.0f}" for q in (0.5, 0.99, 0.999, 1.0))]
    cells += [f"{quantile(work, q) / 1e3:.0f}" if work else "" for q in (0.5, 0.99)]
    return Row(title, [*cells, str(missed), "" if ours is None else str(ours)])


if __name__ == "__main__":
    main()
