"""Time that a gateway in the line adds to a frame, next to other gateways, in virtual time.

A joystick on vcan0 sends both joystick messages every 20 ms, an ECU listens on vcan1, and frames of
somebody else pass too. The joystick's period is a little longer than the daemon's tick, so that its
frames come at every phase of it. Times are the kernel's, from the frame on one interface to the
same message on the other.

The other gateways pass every frame as it is; canshaper puts its velocities into the joystick's.
Gateways have FIFO priority 40, everything else none, but the client 45: as from a wire, its frames
come while a gateway is at work too. Its way back to sleep counts as well.

    python benchmarks/gateway.py
    python benchmarks/gateway.py --load same      and foreign frames that fill 250 kbit/s on vcan0
"""

import argparse
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import cantools
from measure import Figure, Row, conditions, in_lane, print_table, progress, publish, quantile
from rig import (
    DBC,
    LOADS,
    ROOT,
    START_S,
    as_client,
    cpu_ns,
    daemon,
    load,
    run_in_lane,
    running,
    wait_for_text,
)
from wire import (
    FRAME,
    JOYSTICK_LEFT,
    JOYSTICK_RIGHT,
    receive_stamped,
    sleep_until,
    stamped_port,
)

NEAR, FAR = "vcan0", "vcan1"
CONFIG = ROOT / "config" / "gateway-forwarder.yaml"
TICK_NS = 20_000_000
FOREIGN = 0x7E0
FRAME_TIME_US = 640.0  # the longest frame of 8 bytes with 29 bits, stuffed, at 250 kbit/s
WARM_UP = 100
CLIENT_FIFO = 45
BRIDGE, OURS = "python-can bridge", "canshaper, passing: kernel"
FIGURES = (
    Figure("gateway, joystick frame, median, virtual us", BRIDGE),
    Figure("gateway, other frames, p99.9, virtual us", BRIDGE),
)


class Line:
    """Joystick and somebody else on one side, who listens on the other."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._hand = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._hand.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"")
        self._hand.bind((NEAR,))
        self._in = {i: stamped_port(NEAR, i) for i in (JOYSTICK_LEFT, FOREIGN)}
        self._out = {i: stamped_port(FAR, i) for i in (JOYSTICK_LEFT, FOREIGN)}
        database = cantools.database.load_file(DBC)
        self._left, self._right = (
            database.get_message_by_frame_id(i) for i in (JOYSTICK_LEFT, JOYSTICK_RIGHT)
        )
        self._number = 0

    def drive(self, count: int, pct: float) -> dict[int, list[float]]:
        """So many cycles; us from interface to interface, of the joystick and of the others."""
        step = TICK_NS + TICK_NS // self._count
        at = time.monotonic_ns() + step
        times: dict[int, list[float]] = {JOYSTICK_LEFT: [], FOREIGN: []}
        for port in (*self._in.values(), *self._out.values()):
            _empty(port)
        for _ in range(count):
            self._number = (self._number + 1) % 256
            on = {"Enable": 1, "AntiSwayOff": 0, "Reset": 0, "AliveCounter": self._number}
            # a hand is never quite still
            joysticks = {"Slew": pct + 0.1 * (self._number % 2), "NearFar": 0}
            left = self._left.encode(on | joysticks)
            right = self._right.encode(on | {"Lift": 0, "Rotate": 0})
            sleep_until(at)
            self._hand.send(FRAME.pack(JOYSTICK_LEFT, 8, left))
            sleep_until(at + step // 4)
            self._hand.send(FRAME.pack(JOYSTICK_RIGHT, 8, right))
            sleep_until(at + step // 2)
            self._hand.send(FRAME.pack(FOREIGN, 8, bytes(8)))
            sleep_until(at + step * 3 // 4)  # all have passed; nothing of this delays a gateway
            at += step
            for can_id, delays_us in times.items():
                _, in_ns = receive_stamped(self._in[can_id])
                _, out_ns = receive_stamped(self._out[can_id])
                delays_us.append((out_ns - in_ns) / 1e3)
        return times

    def measure(self, at_work: Callable[[], bool]) -> dict[int, list[float]]:
        """In motion, once the load is at work."""
        self.drive(WARM_UP, 0.0)
        while not at_work():
            self.drive(1, 0.0)
        self.drive(WARM_UP, 50.0)
        return self.drive(self._count, 50.0)


def _empty(port: socket.socket) -> None:
    """Drop what waits, of an earlier gateway or drive."""
    port.setblocking(False)
    with suppress(BlockingIOError):
        while True:
            port.recv(FRAME.size)
    port.settimeout(START_S)


@contextmanager
def rules(*commands: list[str]) -> Iterator[None]:
    """Rules of the kernel's gateway, removed when the block is left."""
    for command in commands:
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    yield
    subprocess.run(["cangw", "-F"], check=True)


def each_gateway(directory: Path) -> Iterator[tuple[str, int | None]]:
    """Title and process of every gateway, at work while it is yielded."""
    log = directory / "log"
    subprocess.run(["modprobe", "can-gw"], check=True)
    passes = [["cangw", "-A", "-s", NEAR, "-d", FAR, "-e", "-f", f"{i:X}:C00007FF"]
              for i in (JOYSTICK_LEFT, FOREIGN)]  # fmt: skip
    with rules(*passes):
        yield "cangw, in the kernel", None
    bridge = [sys.executable, "-u", "-m", "can.bridge"]
    for n, channel in ((1, NEAR), (2, FAR)):
        bridge += [f"--bus{n}-interface", "socketcan", f"--bus{n}-channel", channel]
    with running(bridge, log) as process:
        wait_for_text(process, log, "CAN Bridge (Started")
        yield BRIDGE, process.pid
    for passing in ("kernel", "daemon"):
        text = CONFIG.read_text().replace("../dbc", str(ROOT / "dbc"))
        if passing == "daemon":
            text = text.replace("forwarding: kernel", "forwarding: daemon")
            text = text.replace("fallback: neutral", "fallback: stop")
        file = directory / f"{passing}.yaml"
        file.write_text(text)
        sets = [sys.executable, "-m", "canshaper", "gateway", str(file), "running"]
        with rules(sets), running(daemon(file), log) as process:
            wait_for_text(process, log, "started")
            yield f"canshaper, passing: {passing}", process.pid


def print_results(results: dict[str, tuple[dict[int, list[float]], float | None]]) -> None:
    """Print the table."""
    rows = []
    for title, (times, cpu) in results.items():
        for can_id, of in ((JOYSTICK_LEFT, "joystick"), (FOREIGN, "others")):
            delays_us = times[can_id]
            figures = [
                statistics.median(delays_us),
                quantile(delays_us, 0.99),
                quantile(delays_us, 0.999),
            ]
            cells = [f"{f:.1f}" for f in (*figures, max(delays_us))]
            share = quantile(delays_us, 0.999) / FRAME_TIME_US
            cells += [f"{share:.2f}", "" if cpu is None else f"{cpu:.1f}"]
            rows.append(Row(f"{title}: {of}", cells))
    print_table(["median", "p99", "p99.9", "max", "p99.9 / frame time", "CPU %"], rows)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kernel", choices=("std", "rt"), default="std")
    parser.add_argument("--load", nargs="*", choices=LOADS, default=[], help="kinds of load")
    parser.add_argument("--count", type=int, default=2000, help="cycles of the joystick")
    options = parser.parse_args()
    if not in_lane():
        raise SystemExit(run_in_lane(options.kernel))
    as_client()
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(CLIENT_FIFO))
    results = {}
    with tempfile.TemporaryDirectory() as name:
        line = Line(options.count)
        for title, pid in each_gateway(Path(name)):
            with load(Path(name), options.load) as at_work:
                before, begin = cpu_ns(pid) if pid else 0, time.monotonic_ns()
                times = line.measure(at_work)
                used = (cpu_ns(pid) - before) / (time.monotonic_ns() - begin) if pid else None
            results[title] = times, None if used is None else 100 * used
            progress(f"{title}: done")
    loaded = f", with {', '.join(options.load)}" if options.load else ""
    print(f"us from {NEAR} to {FAR}, {options.count} cycles{loaded}; {conditions()}")
    print_results(results)
    ours, peer = (results[title][0] for title in (OURS, BRIDGE))
    joystick = [statistics.median(times[JOYSTICK_LEFT]) for times in (ours, peer)]
    others = [quantile(times[FOREIGN], 0.999) for times in (ours, peer)]
    publish(FIGURES, [joystick, others])


if __name__ == "__main__":
    main()
