"""Memory of the daemon over time, with joysticks that move and faults now and then.

The daemon runs the shipped deployment as ``canshaper run`` does: on a multicast group of
python-can, or with ``--vcan`` on SocketCAN in virtual time, where an hour takes a quarter. A
random operator moves all axes; each minute brings a frame too short, an unknown id and half a
second without joysticks, every fifth a reload. Printed are resident memory, its peak, the memory
blocks that Python has handed out and open files, and how they grow after the first quarter.

    python benchmarks/memory.py --minutes 2 --every 10
    python benchmarks/memory.py --minutes 60
    python benchmarks/memory.py --minutes 60 --vcan
"""

import argparse
import os
import re
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from measure import Figure, Row, conditions, in_lane, print_table, progress, publish
from rig import (
    GATEWAY_FIFO,
    ROOT,
    as_client,
    cpu_ns,
    on_channel,
    run_in_lane,
    running,
    wait_for_text,
)

from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import Frame
from canshaper.config.schema import Bus
from canshaper.machine.binding import load_deployment
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import random_script

FIGURES = (Figure("resident memory after an hour, MB", "after a quarter", most_ratio=1.01),)
TICK_MS = 20
MINUTE_MS = 60_000
RELOAD_MS = 5 * MINUTE_MS
SILENCE_MS = 500
HEADS = ("resident kB", "peak kB", "blocks", "open files")
TOO_SHORT = Frame("crane", 0x110, False, b"\x01")
UNKNOWN = Frame("crane", 0x7F0, False, b"\x01")


def sample(pid: int, log: Path) -> list[int]:
    """VmRSS and VmHWM in kB, blocks in use, open files."""
    status = Path(f"/proc/{pid}/status").read_text()
    rss, peak = (int(re.search(rf"{n}:\s+(\d+)", status)[1]) for n in ("VmRSS", "VmHWM"))  # type: ignore[index]
    blocks = re.findall(r"blocks=(\d+)", log.read_text())
    return [rss, peak, int(blocks[-1]), sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())]


def drive(
    port: Port, joysticks: JoystickNode, duration_ms: int, each_tick: Callable[[int], None]
) -> None:
    """Move the joysticks and make the faults; ``each_tick`` gets the time, ms."""
    begin = time.monotonic_ns()
    for at_ms in range(0, duration_ms + 1, TICK_MS):
        frames = joysticks.frames(at_ms) if at_ms % MINUTE_MS >= SILENCE_MS or not at_ms else []
        if at_ms % MINUTE_MS == SILENCE_MS:
            frames = [*frames, TOO_SHORT, UNKNOWN]
        for frame in frames:
            port.send(frame)
        for _ in port.frames():  # or its queue would fill
            pass
        each_tick(at_ms)
        left = begin + (at_ms + TICK_MS) * 1_000_000 - time.monotonic_ns()
        time.sleep(max(0, left) / 1e9)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=2)
    parser.add_argument("--every", type=int, default=10, help="seconds between two samples")
    parser.add_argument("--vcan", action="store_true", help="SocketCAN, in virtual time")
    options = parser.parse_args()
    if options.vcan and not in_lane():
        raise SystemExit(run_in_lane("std"))
    duration_ms = round(options.minutes * MINUTE_MS)
    samples: list[tuple[float, list[int]]] = []
    config = Bus(interface="socketcan", channel="vcan0")
    if options.vcan:
        as_client()
    else:
        group = f"239.79.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
        config = Bus(interface="udp_multicast", channel=group)
    program = ROOT / "benchmarks" / "observed.py"
    with tempfile.TemporaryDirectory() as name:
        log, file = Path(name) / "log", on_channel(Path(name), config)
        command = [sys.executable, program, "blocks", str(options.every / 2), file]
        port = open_port("crane", config, lambda _fault: None)
        with running(command, log, GATEWAY_FIFO if options.vcan else None) as process:
            wait_for_text(process, log, "started")
            before, begin = cpu_ns(process.pid), time.monotonic_ns()

            def each_tick(at_ms: int) -> None:
                if at_ms and at_ms % RELOAD_MS == 0:
                    process.send_signal(signal.SIGHUP)
                if at_ms and at_ms % (options.every * 1000) == 0:
                    samples.append((at_ms / MINUTE_MS, sample(process.pid, log)))
                if at_ms and at_ms % RELOAD_MS == 0:
                    progress(f"{at_ms // MINUTE_MS} of {options.minutes:g} minutes")

            joysticks = JoystickNode(
                load_deployment(file), random_script(1, duration_ms / 1000 + 1.0)
            )
            drive(port, joysticks, duration_ms, each_tick)
            share = (cpu_ns(process.pid) - before) / (time.monotonic_ns() - begin)
        port.close()
        text = log.read_text()
    print(conditions())
    shown = samples[:: max(1, len(samples) // 20)]
    rows = [Row(f"{minute:6.1f} min", [f"{n}" for n in figures]) for minute, figures in shown]
    print_table(HEADS, rows)
    settled = samples[len(samples) // 4 :]
    hours = [minute / 60 for minute, _ in settled]
    for i, title in enumerate(HEADS):
        line = statistics.linear_regression(hours, [figures[i] for _, figures in settled])
        print(f"{title}: {line.slope:+.0f} an hour, after the first quarter")
    moved = len(re.findall("state=ACTIVE", text))
    reloads = len(re.findall("reload=applied", text))
    print(f"axes were set in motion {moved} times, reloads {reloads}")
    print(f"CPU of the daemon: {100 * share:.2f} % of a core")
    if options.minutes == 60:
        publish(FIGURES, [(samples[-1][1][0] / 1e3, settled[0][1][0] / 1e3)])


if __name__ == "__main__":
    main()
