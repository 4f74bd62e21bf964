"""Joystick frames at chosen moments, and the valve frames that answer them.

The joystick jumps between two deflections with every frame, so that a valve frame shows which
joystick frame it answers: the valve jumps the same way.
"""

import socket
import struct
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import cantools
from rig import DBC, START_S

FRAME = struct.Struct("=IB3x8s")
TIMESPEC = struct.Struct("=qq")
ROOM = socket.CMSG_SPACE(TIMESPEC.size)
SO_TIMESTAMPNS = 35
JOYSTICK_LEFT, JOYSTICK_RIGHT, SLEW_COMMAND = 0x110, 0x111, 0x200
HIGH_PCT, LOW_PCT = 52.0, 48.0
# A filter passes a jump of 4 % on as 3 to 5 %: four steps of the valve frame or more. Less is its
# own motion.
LEAST_STEPS = 2
MOST_UNMOVED = 50  # an axis that has stopped answers no more
# The kernel stamps frames by the wall clock, which no one sets in a machine of its own.
WALL_NS = time.time_ns() - time.monotonic_ns()


@dataclass(frozen=True)
class Exchange:
    """One joystick frame and its answer, monotonic ns.

    Attributes:
        in_ns: the frame has arrived at the gateway's interface, by the kernel.
        out_ns: the valve frame has arrived at the valve's interface, by the kernel.
    """

    in_ns: int
    out_ns: int

    @property
    def gateway_us(self) -> float:
        """From frame to frame."""
        return (self.out_ns - self.in_ns) / 1e3


class Wire:
    """The joystick's and the valve's end of a gateway.

    Args:
        near: channel that the gateway has.
        far: channel of joystick and valve; the same where one virtual bus serves all.
    """

    def __init__(self, near: str, far: str) -> None:
        self.near, self.far = near, far
        self._hand = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._hand.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"")
        self._hand.bind((far,))
        self._in = stamped_port(near, JOYSTICK_LEFT)
        self._out = stamped_port(far, SLEW_COMMAND)
        database = cantools.database.load_file(DBC)
        left, right = (database.get_message_by_frame_id(i) for i in (JOYSTICK_LEFT, JOYSTICK_RIGHT))
        on = {"Enable": 1, "AntiSwayOff": 0, "Reset": 0}
        counts = [on | {"AliveCounter": i} for i in range(256)]
        self._left = {
            pct: [left.encode(c | {"Slew": pct, "NearFar": 0}) for c in counts]
            for pct in (0.0, LOW_PCT, HIGH_PCT)
        }
        self._right = [right.encode(c | {"Lift": 0, "Rotate": 0}) for c in counts]
        self._count = 0
        self._steps = 0  # of the last valve frame

    def send(self, at_ns: int, pct: float, right_before_ns: int = 0) -> None:
        """Send the left joystick at this moment, the right one before if asked."""
        self._count = (self._count + 1) % 256
        if right_before_ns:
            sleep_until(at_ns - right_before_ns)
            self._hand.send(FRAME.pack(JOYSTICK_RIGHT, 8, self._right[self._count]))
        frame = FRAME.pack(JOYSTICK_LEFT, 8, self._left[pct][self._count])
        sleep_until(at_ns)
        self._hand.send(frame)

    def exchange(self, at_ns: int, pct: float, right_before_ns: int = 0, *, jump: bool) -> Exchange:
        """Send, and wait for the answer: the next valve frame, or the next that jumps as asked."""
        self.drain()
        self.send(at_ns, pct, right_before_ns)
        for _ in range(MOST_UNMOVED):
            out_ns, rise = self._valve()
            if not jump or (abs(rise) >= LEAST_STEPS and (rise > 0) is (pct == HIGH_PCT)):
                break
        else:
            raise SystemExit(f"the valve does not follow the joystick: it stays at {self._steps}")
        _, in_ns = receive_stamped(self._in)
        return Exchange(in_ns, out_ns)

    def drain(self) -> int:
        """Drop what waits; how many of it were valve frames."""
        dropped = 0
        for port in (self._in, self._out):
            port.setblocking(False)
            while True:
                try:
                    self._valve() if port is self._out else receive_stamped(port)
                except BlockingIOError:
                    break
                dropped += port is self._out
            port.settimeout(START_S)
        return dropped

    def _valve(self) -> tuple[int, int]:
        """Take a valve frame: when it came, its steps against the one before."""
        data, at_ns = receive_stamped(self._out)
        steps = int.from_bytes(data[8:9], signed=True)
        rise, self._steps = steps - self._steps, steps
        return at_ns, rise


def stamped_port(channel: str, can_id: int) -> socket.socket:
    """A socket that receives one message, with the kernel's stamps."""
    port = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    filters = struct.pack("=II", can_id, 0xC00007FF)
    port.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, filters)
    port.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    port.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    port.bind((channel,))
    return port


def receive_stamped(port: socket.socket) -> tuple[bytes, int]:
    """A frame, and when it arrived."""
    data, extra, _, _ = port.recvmsg(16, ROOM)
    seconds, ns = TIMESPEC.unpack(next(d for _, kind, d in extra if kind == SO_TIMESTAMPNS))
    return data, seconds * 1_000_000_000 + ns - WALL_NS


def sleep_until(at_ns: int) -> None:
    """Sleep until a moment of the monotonic clock."""
    left = at_ns - time.monotonic_ns()
    if left > 0:
        time.sleep(left / 1e9)


def wait_for_frames(wire: Wire, process: subprocess.Popen[bytes], log: Path) -> None:
    """Wait until a gateway sends valve frames."""
    until = time.monotonic() + START_S
    wire.drain()
    while not wire.drain():
        if process.poll() is not None or time.monotonic() > until:
            raise SystemExit(f"no valve frame from {process.args}:\n{log.read_text()}")
        time.sleep(0.05)
