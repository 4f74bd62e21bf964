"""Memory of the daemon over time, with levers that move and faults now and then.

The daemon runs the shipped deployment as ``canshaper run`` does, on a multicast group of
python-can. A random operator moves all axes; each minute brings a frame too short, an unknown id
and half a second without joysticks, every fifth a reload. Printed are resident memory, its peak
and the memory blocks that Python has handed out, and how they grow after the first quarter.

    python benchmarks/memory.py --minutes 2 --every 10
    python benchmarks/memory.py --minutes 60
"""

import argparse
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import can
from rig import CONFIG, ROOT, Row, print_table, running, wait_for_text

from canshaper.can.binding import load_deployment
from canshaper.can.frame import Frame
from canshaper_sim.levers import LeverNode
from canshaper_sim.operator import random_script

TICK_MS = 20
MINUTE_MS = 60_000
RELOAD_MS = 5 * MINUTE_MS
SILENCE_MS = 500
TOO_SHORT = Frame("crane", 0x110, False, b"\x01")
UNKNOWN = Frame("crane", 0x7F0, False, b"\x01")


def sample(pid: int, log: Path) -> list[int]:
    """VmRSS and VmHWM in kB, blocks in use."""
    status = Path(f"/proc/{pid}/status").read_text()
    rss, peak = (int(re.search(rf"{n}:\s+(\d+)", status)[1]) for n in ("VmRSS", "VmHWM"))  # type: ignore[index]
    blocks = re.findall(r"blocks=(\d+)", log.read_text())
    return [rss, peak, int(blocks[-1])]


def drive(
    bus: can.BusABC, process: subprocess.Popen[bytes], duration_ms: int, every_ms: int, log: Path
) -> list[tuple[float, list[int]]]:
    """Move the levers, make the faults, take the samples: minutes and figures."""
    levers = LeverNode(load_deployment(CONFIG), random_script(1, duration_ms / 1000 + 1.0))
    begin = time.monotonic_ns()
    samples = []
    for at_ms in range(0, duration_ms + 1, TICK_MS):
        frames = levers.frames(at_ms) if at_ms % MINUTE_MS >= SILENCE_MS or not at_ms else []
        if at_ms % MINUTE_MS == SILENCE_MS:
            frames = [*frames, TOO_SHORT, UNKNOWN]
        if at_ms and at_ms % RELOAD_MS == 0:
            process.send_signal(signal.SIGHUP)
        for f in frames:
            bus.send(can.Message(arbitration_id=f.can_id, is_extended_id=False, data=f.data))
        if at_ms and at_ms % every_ms == 0:
            samples.append((at_ms / MINUTE_MS, sample(process.pid, log)))
        left = begin + (at_ms + TICK_MS) * 1_000_000 - time.monotonic_ns()
        time.sleep(max(0, left) / 1e9)
    return samples


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=2)
    parser.add_argument("--every", type=int, default=10, help="seconds between two samples")
    options = parser.parse_args()
    duration_ms = round(options.minutes * MINUTE_MS)
    group = f"239.79.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
    program = ROOT / "benchmarks" / "observed.py"
    command = [sys.executable, program, "blocks", str(options.every / 2), CONFIG]
    command += ["--interface", "udp_multicast", "--channel", group]
    with tempfile.TemporaryDirectory() as name:
        log = Path(name) / "log"
        bus = can.Bus(interface="udp_multicast", channel=group, ignore_config=True)
        with bus, running(command, log, None) as process:
            wait_for_text(process, log, "started")
            samples = drive(bus, process, duration_ms, options.every * 1000, log)
        text = log.read_text()
    shown = samples[:: max(1, len(samples) // 20)]
    rows = [Row(f"{minute:6.1f} min", [f"{n}" for n in figures]) for minute, figures in shown]
    print_table(["resident kB", "peak kB", "blocks"], rows)
    settled = samples[len(samples) // 4 :]
    hours = [minute / 60 for minute, _ in settled]
    for i, title in ((0, "resident kB"), (2, "blocks")):
        line = statistics.linear_regression(hours, [figures[i] for _, figures in settled])
        print(f"{title}: {line.slope:+.0f} an hour, after the first quarter")
    moved = len(re.findall("state=ACTIVE", text))
    reloads = len(re.findall("reload=applied", text))
    print(f"axes were set in motion {moved} times, reloads {reloads}")


if __name__ == "__main__":
    main()
