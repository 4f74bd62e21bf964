"""A port on raw sockets and the far end of its bus, without CAN.

Socket pairs carry the kernel's ``struct can_frame``; python-can makes the frames. Where this kernel
cannot do it, a thin wrapper of the socket does: it sets the flag MSG_CONFIRM on frames that are
marked, and raises the errors of a network device.
"""

import socket
from collections.abc import Callable
from typing import Any

import can
from can.interfaces.socketcan.socketcan import build_can_frame

from canshaper.bus.packet import FD_SIZE
from canshaper.bus.raw import RawPort
from canshaper.codec.frame import Frame, FrameFault
from canshaper.config.bus import Bus, Match
from canshaper.errors import WrongDeviceError
from canshaper.machine.routing import BusRoutes

TICK_NS = 20_000_000
MARK_AT = 5  # a byte of the structure that is padding
MARK = 0x80  # of CAN FD these are flags, of which this is none

VALVE = Frame("crane", 0x200, False, b"\x05\x01")
OTHER = Frame("crane", 0x201, False, b"\x00\x01")
STATUS = Frame("crane", 0x300, False, bytes(8))
SENT = frozenset((f.can_id, f.extended) for f in (VALVE, OTHER, STATUS))
IDS = BusRoutes(frozenset(), SENT, SENT - {(STATUS.can_id, STATUS.extended)}, frozenset())
# The sockets of a port that has its ids, by what they receive.
RECEIVED, SENT_BACK, UNKNOWN = range(3)


class Near(socket.socket):
    """The port's end of a pair."""

    fail: OSError | None = None

    def recvmsg(self, *arguments: int) -> Any:
        self._fail()
        data, ancillary, flags, sender = super().recvmsg(*arguments)
        if data[MARK_AT : MARK_AT + 1] >= bytes((MARK,)):
            flags |= socket.MSG_CONFIRM
        return data, ancillary, flags, sender

    def recv(self, *arguments: int) -> bytes:
        self._fail()
        return super().recv(*arguments)

    def send(self, *arguments: Any) -> int:
        self._fail()
        return super().send(*arguments)

    def _fail(self) -> None:
        if self.fail:
            raise self.fail


def port_on(
    open_sockets: Callable[[BusRoutes | None], list[socket.socket]],
    ids: BusRoutes | None,
    on_fault: Callable[[FrameFault], None],
    *,
    echo: bool = True,
    **options: Any,
) -> RawPort:
    """A port on these sockets; ``options`` are those of the bus."""
    return RawPort(
        "crane",
        Bus(interface="socketcan", channel="can0", **options),
        on_fault,
        ids,
        (ids.fd if ids else {(0x200, False)}) if options.get("fd") else (),
        open_sockets=lambda _bus, routes: open_sockets(routes),
        has_echo=lambda channel: echo and channel == "can0",
    )


class Line:
    """A bus and the port on it.

    Args:
        ids: the messages of the port, which then has three sockets; without, it has one.
        matched: the deployment names the device of the bus.
        fd: the bus is one of CAN FD.
        brs: its data have a bit rate of their own.
        echo: its interface hands our frames back once they are on the bus.
    """

    def __init__(
        self,
        ids: BusRoutes | None = IDS,
        *,
        matched: bool = False,
        fd: bool = False,
        brs: bool = False,
        echo: bool = True,
    ) -> None:
        self.faults: list[FrameFault] = []
        self.opened_with: list[BusRoutes | None] = []
        self.refuse: OSError | WrongDeviceError | None = None
        self.near: list[Near] = []
        self.far: list[socket.socket] = []
        self.now_ns = 10**12
        options: dict[str, Any] = {"match": Match(serial="1")} if matched else {}
        if brs:
            options["data_bitrate"] = 2_000_000
        self.port = port_on(self._open, ids, self.faults.append, echo=echo, fd=fd, **options)

    def _open(self, ids: BusRoutes | None) -> list[socket.socket]:
        self.opened_with.append(ids)
        if self.refuse:
            raise self.refuse
        self.end()
        for _ in range(3 if ids else 1):
            near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
            self.near.append(Near(fileno=near.detach()))
            self.far.append(far)
        for one in (*self.near, *self.far):
            one.setblocking(False)
        return [*self.near]

    def monotonic_ns(self) -> int:
        return self.now_ns

    def put(self, message: can.Message, number: int = RECEIVED) -> None:
        """A frame comes from the bus."""
        self.far[number].send(build_can_frame(message))

    def error(self, kind: int, controller: int = 0) -> None:
        data = bytes([0, controller, 0, 0, 0, 0, 0, 0])
        message = can.Message(arbitration_id=kind, is_error_frame=True, dlc=8, data=data)
        self.put(message, len(self.far) // 2)

    def confirm(self, frame: Frame | can.Message, size: int = FD_SIZE) -> None:
        """One of our own frames comes back, or no more of it than ``size`` bytes."""
        if isinstance(frame, Frame):
            frame = can.Message(
                arbitration_id=frame.can_id, is_extended_id=frame.extended, data=frame.data
            )
        data = bytearray(build_can_frame(frame))
        data[MARK_AT] |= MARK
        self.far[SENT_BACK].send(data[:size])

    def received(self) -> list[Frame]:
        """Frames that the port hands out in a tick."""
        return [*self.port.frames(), *self.port.background()]

    def sent(self) -> list[bytes]:
        """Frames that left since the last call."""
        frames = []
        while True:
            try:
                frames.append(self.far[len(self.far) // 2].recv(100))
            except BlockingIOError:
                return frames

    def unconfirmed(self, frame: Frame = VALVE, most: int = 10) -> int:
        """Send it every 20 ms until it is refused; how many were sent."""
        for count in range(most):
            self.now_ns += TICK_NS
            if not self.port.send(frame):
                return count
            self.sent()
        return most

    def end(self) -> None:
        for one in (*self.near, *self.far):
            one.close()
        self.near, self.far = [], []


def message(can_id: int, data: bytes = b"", *, extended: bool = False) -> can.Message:
    return can.Message(arbitration_id=can_id, is_extended_id=extended, data=data)
