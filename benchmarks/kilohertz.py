"""Eight axes at 1 kHz on one core of this machine, by its own clock.

The daemon runs as ``canshaper run`` does, on a multicast group of python-can; joystick frames come
every 20 ms and keep all axes moving. Beside it, on the same core at the same time, one priority
above it, a loop in C that only sleeps until its next deadline: what that one misses, the machine
has done. Where real-time priorities may not be had, both run without.

    python benchmarks/kilohertz.py
    python benchmarks/kilohertz.py --axes 4 --tick-ms 2 --seconds 30
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import can
import yaml
from rig import (
    GATEWAY_FIFO,
    PEERS,
    ROOT,
    Row,
    compiled,
    print_table,
    quantile,
    running,
    wait_for_text,
)

from canshaper.can.binding import load_deployment

JOYSTICK_MS = 20
LEVER, VALVE = 0x110, 0x200
LEVER_TEXT = """
BO_ {id} Lever{n}: 8 LEVERS
 SG_ Stick : 0|16@1- (0.1,0) [-100|100] "%" SHAPER
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


def deployment(directory: Path, axes: int, tick_ms: int, buses: dict[str, Any]) -> Path:
    """A machine with a lever, a valve and G_FF for each axis; every valve in every tick."""
    dbc = 'VERSION "1"\n\nNS_ :\n\nBS_:\n\nBU_: LEVERS SHAPER VALVES\n'
    cycles = CYCLES
    config: dict[str, Any] = {"tick_ms": tick_ms, "buses": buses, "dbc": ["many.dbc"]}
    config |= {"levers": {}, "axes": {}}
    for n in range(axes):
        dbc += LEVER_TEXT.format(id=LEVER + n, n=n) + VALVE_TEXT.format(id=VALVE + n, n=n)
        cycles += f'BA_ "GenMsgCycleTime" BO_ {LEVER + n} {JOYSTICK_MS};\n'
        cycles += f'BA_ "GenMsgCycleTime" BO_ {VALVE + n} {tick_ms};\n'
        config["levers"][f"lever{n}"] = {
            **{"bus": "crane", "message": f"Lever{n}", "timeout_ms": 1000},
            **{"enable": "Enable", "alive_counter": "AliveCounter"},
        }
        valve = {"bus": "crane", "message": f"Valve{n}", "signal": "Velocity"}
        config["axes"][f"axis{n}"] = {
            "stick": {"lever": f"lever{n}", "signal": "Stick"},
            "valve": {**valve, "alive_counter": "AliveCounter"},
            "sway": {"period_s": 2.0 + 0.1 * n, "damping_ratio": 0.05, "full_speed_m_s": 1.0},
            "filter": {"kind": "gff", "a1": 0.708, "a2": 0.12},
        }
    (directory / "many.dbc").write_text(dbc + cycles)
    file = directory / "many.yaml"
    file.write_text(yaml.safe_dump(config, sort_keys=False))
    return file


class Hands:
    """All levers, enabled, moved slowly to and fro after a second in neutral."""

    def __init__(self, file: Path, bus: can.BusABC) -> None:
        self._bus = bus
        self._levers = [lever.message for lever in load_deployment(file).levers.values()]
        self._count = 0

    def drive(self, duration_s: float, *, neutral: bool = False) -> tuple[int, int]:
        """Send for so long; monotonic begin and end, ns."""
        begin = time.monotonic_ns()
        frames = round(duration_s * 1000 / JOYSTICK_MS)
        for i in range(frames):
            self._count += 1
            phase = i / 100 % 2  # there and back in four seconds
            stick = 0.0 if neutral else 20.0 + 60.0 * min(phase, 2 - phase)
            values = {"Stick": stick, "Enable": 1, "AliveCounter": self._count % 256}
            for message in self._levers:
                data = message.encode(values)
                self._bus.send(
                    can.Message(arbitration_id=message.frame_id, is_extended_id=False, data=data)
                )
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
    options = parser.parse_args()
    core = max(os.sched_getaffinity(0))
    fifo = GATEWAY_FIFO if may_fifo(core) else None
    group = f"239.78.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
    buses = {"crane": {"interface": "udp_multicast", "channel": group}}
    period_ns = options.tick_ms * 1_000_000
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)
        file = deployment(directory, options.axes, options.tick_ms, buses)
        sleeper = compiled(PEERS / "sleeper.c", directory)
        notes, log, late = directory / "ticks", directory / "log", directory / "late"
        on_core = ["taskset", "-c", str(core)]
        program = ROOT / "benchmarks" / "observed.py"
        command = [*on_core, sys.executable, program, "ticks", notes, file]
        bus = can.Bus(interface="udp_multicast", channel=group, ignore_config=True)
        with bus, running(command, log, fifo) as process:
            wait_for_text(process, log, "started")
            hands = Hands(file, bus)
            hands.drive(1.0, neutral=True)
            hands.drive(1.0)
            count = str(options.seconds * 1000 // options.tick_ms)
            peer = [*on_core, sleeper, str(period_ns), count] if sleeper else ["true"]
            before = cpu_s(process.pid)
            with running(peer, late, fifo and fifo + 1) as sleeping:
                begin, end = hands.drive(options.seconds)
                share = (cpu_s(process.pid) - before) / ((end - begin) / 1e9)
                sleeping.wait()
        ticks = [list(map(int, line.split())) for line in notes.read_text().splitlines()]
        ticks = [t for t in ticks if begin <= t[0] < end]
        peer_late = [int(line) for line in late.read_text().splitlines()]
        text = log.read_text()
    rows = [
        row("canshaper run", [t[1] for t in ticks], [t[2] for t in ticks], sum(t[3] for t in ticks))
    ]
    if peer_late:
        rows.append(row("C, sleeps only", peer_late, [], sum(n >= period_ns for n in peer_late)))
    policy = f"FIFO {fifo}" if fifo else "no real-time priority"
    print(f"{options.axes} axes, tick {options.tick_ms} ms, core {core}, {policy}; us")
    print_table(["ticks", "late p50", "p99", "p99.9", "max", "work p50", "p99", "missed"], rows)
    print(f"CPU of the daemon: {100 * share:.0f} % of the core")
    for line in text.splitlines():
        if "fault=" in line or "STOPPING" in line or "TRIPPED" in line:
            print(line)


def row(title: str, late: list[int], work: list[int], missed: int) -> Row:
    """A row of the table."""
    cells = [str(len(late)), *(f"{quantile(late, q) / 1e3:.0f}" for q in (0.5, 0.99, 0.999, 1.0))]
    cells += [f"{quantile(work, q) / 1e3:.0f}" if work else "" for q in (0.5, 0.99)]
    return Row(title, [*cells, str(missed)])


def cpu_s(pid: int) -> float:
    """CPU time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
