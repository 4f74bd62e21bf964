"""Where the way from joystick frame to valve frame goes: bytecodes by function.

One axis at 1 ms, in motion, a new joystick position in every tick. Counted are the bytecodes that
Python executes from begin of the tick's I/O cycle until the valve frame is handed to the kernel;
frames are the kernel's, on a pair of sockets. The same on every machine that has the same Python.

    python benchmarks/path.py
    python benchmarks/path.py --least 20       only functions with so many
"""

import argparse
import platform
import socket
import sys
import tempfile
from collections import Counter
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any

from measure import Row, print_table
from rig import slew_only

from canshaper.bus.packet import CAN_FRAME
from canshaper.bus.raw import RawPort
from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.gate.cycle import Standstill, io_cycle
from canshaper.machine.binding import load_deployment
from canshaper_sim.hand import Hand, Held

TICKS = 400  # enough for the axis to move and for the input to be trusted
TICK_NS = 1_000_000


class Counted:
    """Counts bytecodes while it traces."""

    def __init__(self) -> None:
        self.bytecodes: Counter[str] = Counter()
        self.calls: Counter[str] = Counter()
        self.files: set[str] = set()

    def trace(self, frame: FrameType, event: str, _argument: Any) -> Any:
        """As ``sys.settrace`` wants it."""
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        code = frame.f_code
        if code.co_filename == __file__:
            return None  # the stop watch is not of the way
        name = f"{Path(code.co_filename).stem}.{code.co_qualname}"
        if event == "opcode":
            self.bytecodes[name] += 1
        elif event == "call":
            self.calls[name] += 1
            self.files.add(code.co_filename)
        return self.trace


class Traced(RawPort):
    """A port that ends the count when a frame is with the kernel."""

    def send(self, frame: Frame) -> bool:
        sent = super().send(frame)
        sys.settrace(None)
        return sent


def count(*, gated: bool = False) -> Counted:
    """Drive the axis; count the last tick, without the gate or with it."""
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)
    with tempfile.TemporaryDirectory() as name:
        deployment = load_deployment(slew_only(Path(name), "vcan0", 1))
    controller, hand, counted = Controller(deployment), Hand(deployment), Counted()
    port = Traced(
        "crane",
        deployment.config.buses["crane"],
        lambda _fault: None,
        None,
        (),
        open_sockets=lambda _bus, _ids: [near],
        has_echo=bool,
    )
    processor = GatedController(controller) if gated else controller
    standstill = Standstill(deployment)
    standstill.clock = lambda: 0
    for tick in range(TICKS):
        speed = 0.0 if tick < 20 else 0.2 + 0.6 * (tick % 50) / 50  # neutral first
        for frame in hand.frames(tick, Held({"slew": speed}, enable=True)):
            far.send(CAN_FRAME.pack(frame.can_id, len(frame.data), frame.data))
        if tick == TICKS - 1:
            sys.settrace(counted.trace)
        io_cycle(processor, {"crane": port}, tick * TICK_NS, 0, standstill)
        with suppress(BlockingIOError):
            while True:
                far.recv(CAN_FRAME.size)
    assert not controller.axes["slew"].axis.neutral
    port.close()
    far.close()
    return counted


def main() -> None:
    """Count and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--least", type=int, default=0, help="fewest bytecodes that are shown")
    least = parser.parse_args().least
    counted = count()
    whole = sum(counted.bytecodes.values())
    rows = [
        Row(name, [str(counted.calls[name]), str(n), f"{100 * n / whole:.0f}"])
        for name, n in counted.bytecodes.most_common()
        if n >= least
    ]
    rows.append(Row("all", [str(sum(counted.calls.values())), str(whole), "100"]))
    print(f"one tick, {platform.python_implementation()} {platform.python_version()}")
    print_table(["calls", "bytecodes", "%"], rows)
    with_gate = count(gated=True)
    print(f"without the gate: {_size(counted)}")
    print(f"with it:          {_size(with_gate)}")


def _size(counted: Counted) -> str:
    rooms = {Path(name).parent for name in counted.files}
    whole = sum(counted.bytecodes.values())
    where = f"{len(counted.files)} files of {len(rooms)} packages"
    return f"{whole} bytecodes in {len(counted.calls)} functions, {where}"


if __name__ == "__main__":
    main()
