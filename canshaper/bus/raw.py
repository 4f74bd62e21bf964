"""A bus on raw SocketCAN sockets, made for a control loop.

A frame is sent now or not at all. The port notices frames that do not get onto the bus, and queues
no more behind them. It uses an interface again that comes back.
"""

import socket
import time
from collections.abc import Callable, Iterable, Iterator

from canshaper.bus.interface import PROBE_NS, Interface
from canshaper.bus.packet import (
    ANCILLARY_BYTES,
    BRS,
    CAN_FRAME,
    FD_SIZE,
    FDF,
    SIZE,
    WORD,
    frame_of,
    kernel_ids,
    pack,
)
from canshaper.bus.socketcan import ERROR_CLASSES, dropped_frames, set_filters
from canshaper.codec.frame import EFF_FLAG, BusState, Frame, FrameFault
from canshaper.config.bus import Bus
from canshaper.machine.routing import BusRoutes

# Most frames read in one tick. At 1 Mbit/s a bus carries 180 frames in 20 ms; ten times as many
# empty any backlog, and still end the read.
MOST_FRAMES = 2000
# Most frames of unknown ids read in one tick; others are dropped: their count is a lower bound.
MOST_UNKNOWN = 20
# States that end once a frame of ours gets onto the bus.
SILENT = frozenset((BusState.BUS_OFF, BusState.NOT_CONFIRMED, BusState.DOWN, BusState.FAILED))
# States that end once a frame is received, or sent on a bus that confirms none.
LOST = frozenset((BusState.DOWN, BusState.FAILED))
_EACH_FRAME = range(MOST_FRAMES)  # made once: it takes as long as a poll


class RawPort(Interface):
    """One bus on raw sockets.

    Args:
        name: name of the bus in the deployment file.
        config: section of the bus in the deployment file.
        on_fault, ids, open_sockets, has_echo: see ``Interface``.
        fd: messages to send as CAN FD frames, as (id, whether it has 29 bits).

    Attributes:
        arrived_ns: arrival of the last frame that ``frames`` yielded, by ``boottime_ns``.
        waited: number of valve frames that stayed in the kernel's queue beyond their cycle.
    """

    def __init__(
        self,
        name: str,
        config: Bus,
        on_fault: Callable[[FrameFault], None],
        ids: BusRoutes | None,
        fd: Iterable[tuple[int, bool]],
        *,
        open_sockets: Callable[[Bus, BusRoutes | None], list[socket.socket]],
        has_echo: Callable[[str], bool],
    ) -> None:
        super().__init__(config, on_fault, ids, open_sockets, has_echo)
        self.name = name
        self.arrived_ns = self.waited = 0
        self._size = FD_SIZE if config.fd else SIZE
        self._fd = kernel_ids(fd)
        self._fd_flags = FDF | BRS if config.data_bitrate is not None else FDF
        self._valves = kernel_ids(ids.valves if ids else ())
        self._claims = kernel_ids(ids.claims if ids else ())
        self._unconfirmed, self._claimed = self._under_way.counts, self._under_way.claims

    # -- receiving -----------------------------------------------------------------------------

    def frames(self) -> Iterator[Frame]:
        """Yield the waiting data frames in order, ``MOST_FRAMES`` at most; end if the bus fails.

        While the interface is gone, try to open it, and yield nothing until that succeeds.
        """
        if not self._sockets and not self._reopened():
            return
        waiting, receive, arrivals = self._waiting[0], self._receive, self._arrivals
        name, size = self.name, self._size
        arrivals.begin()
        for _ in _EACH_FRAME:
            if not waiting(0):  # cheaper than the exception of a socket with nothing to read
                arrivals.emptied()
                return
            try:
                data, ancillary, _flags, _sender = receive(size, ANCILLARY_BYTES)
            except OSError as error:
                self._failed(error)
                return
            if (
                self._claimed
                and len(data) == SIZE
                and (own := CAN_FRAME.unpack(data)) in self._claimed
            ):
                self._claimed.remove(own)  # of our frames, this socket receives claims only
                self._confirmed(own[0])
                continue
            frame = frame_of(name, data)
            if frame is None:
                self._no_frame(data)
                continue
            if self.state is not self._good and self.state in LOST:
                self._up()
            self.arrived_ns = arrivals.of(ancillary)
            yield frame

    def background(self) -> Iterator[Frame]:
        """Note which of our frames are on the bus; yield frames to read after the valve frames.

        These are frames of other senders with our ids, and ``MOST_UNKNOWN`` of unknown ids at most.
        """
        self._errors = 0
        if self._quiet_until_ns and time.monotonic_ns() >= self._quiet_until_ns:
            self._receive_errors(ERROR_CLASSES, 0)
        for number, most in ((1, MOST_FRAMES), (2, MOST_UNKNOWN)):
            yield from self._background(number, most)
        if self._sockets and (dropped := dropped_frames(self._sockets[:2])) != self._dropped:
            self._dropped = dropped
            self._under_way.clear()  # confirmations may be among them
            self._on_fault(FrameFault.FRAMES_LOST)

    def _background(self, number: int, most: int) -> Iterator[Frame]:
        if number >= len(self._sockets):
            return
        waiting, receive = self._waiting[number], self._sockets[number].recvmsg
        for _ in range(most):
            if not waiting(0):
                return
            try:
                data, _ancillary, flags, _sender = receive(self._size)
            except OSError as error:
                self._failed(error)
                return
            if flags & socket.MSG_CONFIRM and len(data) in (SIZE, FD_SIZE):
                self._confirmed(WORD.unpack_from(data)[0])
            elif (frame := frame_of(self.name, data)) is not None:
                yield frame
            else:
                self._no_frame(data)

    # -- sending -------------------------------------------------------------------------------

    def send(self, frame: Frame) -> bool:
        """Send now or not at all; return whether the kernel queued the frame."""
        if not self._sockets or (self._not_before_ns and self._blocked()):
            return False
        _bus, word, extended, data = frame
        if extended:
            word |= EFF_FLAG
        under_way = self._unconfirmed.get(word, 0)
        if under_way:
            if self._stuck(word):
                return False
            # The last frame may be confirmed after this tick; a frame before it has waited.
            self.waited += under_way > 1 and word in self._valves
        packed = pack(word, data, self._fd_flags if word in self._fd else None)
        try:
            self._send(packed)
        except OSError as error:
            self._failed(error)
            return False
        if not self._confirms and self.state in LOST:
            self._up()
        if word in self._claims:
            self._claimed.append(CAN_FRAME.unpack(packed))
        elif self._confirms:
            self._unconfirmed[word] = under_way + 1
        return True

    def _confirmed(self, word: int) -> None:
        if not self._confirms:
            return
        self._under_way.confirmed(word)
        if self.state in SILENT:
            self._up()

    def _stuck(self, word: int) -> bool:
        """Return whether frames of this id have waited too long to queue another one.

        If so, that is reported; a valve's frames then also block the port (``_block``).
        """
        waited_ns = self._under_way.waited_ns(word, time.monotonic_ns())
        if not waited_ns:
            return False
        self._on_fault(FrameFault.NOT_CONFIRMED)
        if word in self._valves:
            self._block(BusState.NOT_CONFIRMED)
        elif waited_ns > PROBE_NS:  # valve frames may get through where a status does not
            self._under_way.restart(word)
        return True

    @property
    def confirmed(self) -> bool | None:
        """Whether all valve frames sent are on the bus; None if the bus does not say."""
        if not self._confirms:
            return None
        counts, dropped = self._unconfirmed, self._under_way.dropped
        return not any(counts.get(word) or word in dropped for word in self._valves)

    def watch(self, name: str, ids: BusRoutes) -> None:
        """Serve another deployment, with its name of the bus and its messages."""
        self.name, self._ids = name, ids
        self._valves, self._claims = kernel_ids(ids.valves), kernel_ids(ids.claims)
        self._fd = kernel_ids(ids.fd)
        self._under_way.clear()
        if self._sockets:
            try:
                set_filters(self._sockets, ids)
            except OSError as error:
                self._failed(error)
