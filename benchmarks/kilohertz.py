"""Four axes at 1 kHz on one core, in virtual time; eight need ticks of 2 ms.

The daemon runs as ``canshaper run`` does, on SocketCAN; joystick frames come every 20 ms and keep
all axes moving. What the machine itself holds up is not in it: ``canshaper doctor`` shows that.

    python benchmarks/kilohertz.py
    python benchmarks/kilohertz.py --axes 8 --tick-ms 2
"""

import argparse
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import yaml
from measure import Figure, Row, conditions, in_lane, print_table, publish, quantile
from rig import ROOT, as_client, cpu_ns, run_in_lane, running, wait_for_text

from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import Frame
from canshaper.config.schema import Bus
from canshaper.machine.binding import load_deployment

FIGURES = (Figure("4 axes at 1 kHz, deadlines missed, %", most=0),)
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
            "limits": {"stop_distance_m": 3.1},
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


def run(file: Path, bus: Bus, seconds: float) -> tuple[list[list[int]], float, str]:
    """Notes of the daemon's ticks in motion, its share of the core, its log."""
    notes, log = file.parent / "ticks", file.parent / "log"
    program = ROOT / "benchmarks" / "observed.py"
    with closing(open_port("crane", bus, lambda _fault: None)) as port:
        hands = Hands(file, port)  # before: at our priority it keeps the kernel from its frames
        with running([sys.executable, program, "ticks", notes, file], log) as ours:
            wait_for_text(ours, log, "started")
            hands.drive(1.0, neutral=True)
            hands.drive(1.0)
            before = cpu_ns(ours.pid)
            begin, end = hands.drive(seconds)
            share = (cpu_ns(ours.pid) - before) / (end - begin)
    rows = [[*map(int, line.split())] for line in notes.read_text().splitlines()]
    return [row for row in rows if begin <= row[0] < end], share, log.read_text()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--axes", type=int, default=4)
    parser.add_argument("--tick-ms", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=3)
    options = parser.parse_args()
    if not in_lane():
        raise SystemExit(run_in_lane("std"))
    as_client()
    bus = Bus(interface="socketcan", channel="vcan0")
    with tempfile.TemporaryDirectory() as name:
        file = deployment(Path(name), options.axes, options.tick_ms, bus)
        ticks, share, log = run(file, bus, options.seconds)
    _, late, work, missed = ([*column] for column in zip(*ticks, strict=True))
    print(f"{options.axes} axes, tick {options.tick_ms} ms; us; {conditions()}")
    cells = [str(len(late)), *(f"{quantile(late, q) / 1e3:.0f}" for q in (0.5, 0.99, 0.999, 1.0))]
    cells += [f"{quantile(work, q) / 1e3:.0f}" for q in (0.5, 0.99)]
    heads = ["ticks", "late p50", "p99", "p99.9", "max", "work p50", "p99", "missed", "CPU %"]
    print_table(heads, [Row("canshaper run", [*cells, str(sum(missed)), f"{100 * share:.0f}"])])
    for line in log.splitlines():
        if "fault=" in line or "STOPPING" in line or "TRIPPED" in line:
            print(line)
    if (options.axes, options.tick_ms) == (4, 1):
        publish(FIGURES, [(100 * sum(missed) / len(ticks),)])


if __name__ == "__main__":
    main()
