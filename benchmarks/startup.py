"""From starting the daemon to its first valve frame, next to the least a gateway could need.

The peer imports python-can and cantools, loads the same DBC and sends one frame. Both are separate
processes on a multicast group of python-can, started in turn. Processor time until then as well:
other work on the machine changes it less.

    python benchmarks/startup.py [--runs 7]
"""

import argparse
import os
import select
import signal
import statistics
import subprocess
import sys
import time
from pathlib import Path

from measure import Figure, publish

from canshaper.bus.port import Port, open_port
from canshaper.config.bus import Bus
from canshaper.shipped import data_directory

PEER_TITLE = "python-can + cantools"
FIGURES = (Figure("first frame after the start, s", PEER_TITLE, most_ratio=1.5),)
PEER = """
import sys, can, cantools
from canshaper.bus.multicast import LocalMulticastBus
database = cantools.database.load_file(sys.argv[1])
message = database.get_message_by_name("SlewCommand")
data = message.encode({"Velocity": 0, "AliveCounter": 0})
with LocalMulticastBus(sys.argv[2]) as bus:
    bus.send(can.Message(arbitration_id=message.frame_id, is_extended_id=False, data=data))
"""


def first_frame_s(command: list[str], port: Port) -> tuple[float, float]:
    """Seconds from starting the command to the first valve frame on the bus; of a processor too."""
    for _ in port.frames():
        pass
    start = time.monotonic()
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        while True:
            if not select.select([port.fileno()], [], [], 30.0)[0]:
                raise SystemExit(f"no frame from {' '.join(command)}")
            if any(frame.can_id == 512 for frame in port.frames()):
                after_s = time.monotonic() - start
                running = Path(f"/proc/{process.pid}/schedstat").read_text().split()
                return after_s, int(running[0]) / 1e9
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=7)
    runs = parser.parse_args().runs
    group = f"239.77.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
    port = open_port("crane", Bus(interface="udp_multicast", channel=group), lambda _fault: None)
    options = ["--interface", "udp_multicast", "--channel", group]
    commands = {
        "canshaper run": [sys.executable, "-m", "canshaper", "run", "forwarder.yaml", *options],
        PEER_TITLE: [
            *(sys.executable, "-c", PEER),
            *(str(data_directory() / "dbc" / "forwarder.dbc"), group),
        ],
    }
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in commands}
    for _ in range(runs):
        for name, command in commands.items():
            times[name].append(first_frame_s(command, port))
    port.close()
    for k, what in enumerate(("by the clock", "of a processor")):
        rows = {name: [one[k] for one in both] for name, both in times.items()}
        for name, row in rows.items():
            median_s = statistics.median(row)
            print(f"{name:24} median {median_s:.3f} s   max {max(row):.3f} s   {what}")
        ours, peer = (statistics.median(row) for row in rows.values())
        print(f"canshaper run / bare start: {ours / peer:.2f}")
    publish(FIGURES, [(ours, peer)])


if __name__ == "__main__":
    main()
