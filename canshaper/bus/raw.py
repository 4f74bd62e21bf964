"""A bus on raw sockets that carry the kernel's frames, made for a control loop.

What a valve needs: a frame goes out now or not at all; frames that do not get onto the bus are seen
and no more are queued behind them; an interface that comes back is used again by itself.
"""

import errno
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import Any

from canshaper.bus.device import FD_MTU
from canshaper.bus.packet import (
    ANCILLARY_BYTES,
    BRS,
    CAN_FRAME,
    CLASS_RESTARTED,
    FD_FRAME,
    FD_SIZE,
    FDF,
    SIZE,
    SO_TIMESTAMPNS,
    WORD,
    Arrivals,
    frame_of,
    kernel_ids,
    read_error,
)
from canshaper.bus.socketcan import (
    ERROR_CLASSES,
    STATE_CLASSES,
    UnderWay,
    carrier,
    dropped_frames,
    readable,
    receive_errors,
    renamed,
    set_filters,
)
from canshaper.codec.frame import EFF_FLAG, ERR_FLAG, BusState, Frame, FrameFault
from canshaper.errors import WrongDeviceError
from canshaper.machine.routing import BusRoutes

# Frames read in one tick at most: at 1 Mbit/s a bus carries 180 frames in 20 ms; ten times that
# empties any backlog and still cannot hold up the tick for ever.
MOST_FRAMES = 2000
# Frames of unknown ids read in one tick at most; the rest is dropped, so their count is a minimum.
MOST_UNKNOWN = 20
# With so many error frames in one tick, the kernel keeps those without a state to itself for a
# while; so their count is a minimum.
MOST_ERRORS = 50
QUIET_NS = 1_000_000_000
# How often a bus that took no frames is tried again, with one frame, neutral by then.
PROBE_NS = 500_000_000
# How often an interface that has gone is looked for; it shall work again within a second.
REOPEN_NS = 200_000_000
# States in which a frame of ours that gets onto the bus is news.
SILENT = frozenset((BusState.BUS_OFF, BusState.NOT_CONFIRMED, BusState.DOWN, BusState.FAILED))
# The device is gone; the socket would have to be bound to a new one.
GONE = frozenset((errno.ENODEV, errno.ENXIO, errno.EBADF))
LOST = frozenset((BusState.DOWN, BusState.FAILED))
# States in which the sockets are closed, to be opened again.
AWAY = frozenset((BusState.GONE, BusState.DOWN, BusState.WRONG_DEVICE, BusState.UNFIT))
# Sending or opening failed for what the interface of that name is.
NOT_FIT = frozenset((errno.EINVAL, errno.EOPNOTSUPP))
NO_FD = f"expected an interface with CAN FD, which has the MTU {FD_MTU}, got one without"
UP = BusState.UP
_EACH_FRAME = range(MOST_FRAMES)  # made once: it takes as long as a poll


class RawPort:
    """One bus on raw sockets.

    Args:
        name: name of the bus in the deployment file.
        open_sockets: opens, non-blocking, a socket for the messages that are received and perhaps
            two for what else is to be seen, see ``socketcan.open_sockets``; called again after
            the interface was gone.
        ids: the messages that matter, handed to it.
        on_fault: called with every fault of the bus.
        confirms: whether our own frames come back, with MSG_CONFIRM.
        echo: asks of the interface just opened whether they come back from the bus itself.
        channel: name of the interface in the deployment file.
        matched: whether ``open_sockets`` looks at the device: then an interface that was down is
            opened again too, because name and bit rate may be others when it is back.
        fd: what is sent in frames of CAN FD; None on a bus of classical CAN.
        brs: whether their data are sent at a bit rate of their own.

    Attributes:
        state: of the bus, as far as seen.
        why: cause of a state that does not say it; empty for the others.
        arrived_ns: when the frame arrived that ``frames`` has just handed out, by
            ``boottime_ns``.

    Raises:
        OSError: the sockets cannot be opened.
        WrongDeviceError: the interface is another device.
    """

    def __init__(
        self,
        name: str,
        open_sockets: Callable[[BusRoutes | None], list[socket.socket]],
        ids: BusRoutes | None,
        on_fault: Callable[[FrameFault], None],
        *,
        confirms: bool,
        echo: Callable[[], bool] = lambda: True,
        channel: str = "",
        matched: bool = False,
        fd: Iterable[tuple[int, bool]] | None = None,
        brs: bool = False,
    ) -> None:
        self.name = name
        self.why = ""
        self.arrived_ns = self.waited = 0
        self._open = open_sockets
        self._on_fault = on_fault
        self._own = confirms
        self._echo = echo
        self._channel, self._renamed = channel, ""
        self._matched = matched
        self._under_way = UnderWay()
        self._unconfirmed = self._under_way.counts
        self._dropped = 0
        self._ids = ids
        self._size = SIZE if fd is None else FD_SIZE
        self._fd = kernel_ids(fd or ())
        self._fd_flags = FDF | BRS if brs else FDF
        self._valves = kernel_ids(ids.valves if ids else ())
        self._claims = kernel_ids(ids.claims if ids else ())
        self._claimed = self._under_way.claims
        self._use()
        self.state = self._good

    # -- receiving -----------------------------------------------------------------------------

    def frames(self) -> Iterator[Frame]:
        """Yield every frame that waits, in order; end when there is none or the bus fails."""
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
            if self._claimed and len(data) == SIZE and self._seen_back(CAN_FRAME.unpack(data)):
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
        """Take our own frames, seen back; yield frames that can wait until the valves have theirs.

        Frames of other senders with our ids, and of ids that no one knows, are handed out.
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

    def _no_frame(self, data: bytes) -> None:
        """Take the state of the bus from an error frame; anything else is of wrong length."""
        word, _length, payload = CAN_FRAME.unpack(data) if len(data) == SIZE else (0, 0, b"")
        if not word & ERR_FLAG:
            self._on_fault(FrameFault.WRONG_LENGTH)
            return
        fault, state = read_error(word, payload)
        if state is BusState.BUS_OFF:
            self._no_carrier = False
            self._block(state)
        elif state is UP:
            # Without an echo nothing else says so, and what is sent before that is dropped.
            if self._confirms or self.state is not BusState.BUS_OFF or word & CLASS_RESTARTED:
                self._up()
        elif state is not None and self.state is self._good:
            self.state = state
        self._on_fault(fault)
        self._errors += 1
        if self._errors == MOST_ERRORS:
            self._receive_errors(STATE_CLASSES, time.monotonic_ns() + QUIET_NS)

    def _receive_errors(self, classes: int, until_ns: int) -> None:
        """Let the kernel hand out error frames of these classes; others wait until a time."""
        self._quiet_until_ns = until_ns
        with suppress(OSError, IndexError):  # it is gone, and opened again with all of them
            receive_errors(self._sockets[min(1, len(self._sockets) - 1)], classes)

    # -- sending -------------------------------------------------------------------------------

    def send(self, frame: Frame) -> bool:
        """Send now or not at all; False when the frame did not go out."""
        if not self._sockets or (self._not_before_ns and self._blocked()):
            return False
        _bus, word, extended, data = frame
        if extended:
            word |= EFF_FLAG
        under_way = self._unconfirmed.get(word, 0)
        if under_way:
            if self._stuck(word):
                return False
            # The last one may have its confirmation behind this tick, but the one before it?
            self.waited += under_way > 1 and word in self._valves
        if word in self._fd:
            packed = FD_FRAME.pack(word, len(data), self._fd_flags, data)
        else:
            packed = CAN_FRAME.pack(word, len(data), data)
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

    def _seen_back(self, content: Any) -> bool:
        """Whether this is a claim of ours; no other kind of ours comes to the first socket."""
        if not self._under_way.is_claim(content):
            return False
        self._confirmed(content[0])
        return True

    def _stuck(self, word: int) -> bool:
        """Whether frames of this id have been under way for too long to queue another one."""
        waited_ns = self._under_way.waited_ns(word, time.monotonic_ns())
        if not waited_ns:
            return False
        self._on_fault(FrameFault.NOT_CONFIRMED)
        if word in self._valves:
            self._block(BusState.NOT_CONFIRMED)
        elif waited_ns > PROBE_NS:  # a status message may starve where valves get through
            self._under_way.restart(word)
        return True

    def _block(self, state: BusState) -> None:
        """Queue nothing more for a while."""
        self.state = state
        self._not_before_ns = time.monotonic_ns() + PROBE_NS
        self._under_way.clear()

    def _blocked(self) -> bool:
        """Whether this frame must wait; one at a time may try whether it gets through."""
        now_ns = time.monotonic_ns()
        if now_ns < self._not_before_ns:
            return True
        if self.state is BusState.BUS_OFF and not self._confirms:
            return True  # what is sent now looks as if it had left
        self._not_before_ns = now_ns + PROBE_NS
        self._under_way.clear()
        return False

    # -- the interface -------------------------------------------------------------------------

    def _up(self) -> None:
        self.state = self._good
        self._not_before_ns = 0

    @property
    def confirmed(self) -> bool | None:
        """Whether every valve frame that was sent is on the bus; None where nothing says so."""
        if not self._confirms:
            return None
        return not any(self._unconfirmed.get(word) for word in self._valves)

    def look(self) -> str:
        """Look after carrier and name of the interface, now and then; what to say of its name."""
        if not self._sockets:
            return ""
        one = self._sockets[0]
        try:
            has_carrier = carrier(one)
            text = renamed(one, self._channel)
        except OSError:  # it goes: seen by the next frame
            return ""
        if not self._confirms and has_carrier is not None:
            if has_carrier and self._no_carrier:
                self._up()
            elif not has_carrier and self.state is not BusState.BUS_OFF:
                self._block(BusState.BUS_OFF)
                self._on_fault(FrameFault.BUS_OFF)
            self._no_carrier = not has_carrier and self.state is BusState.BUS_OFF
        before, self._renamed = self._renamed, text
        return text if text != before else ""

    def _failed(self, error: OSError) -> None:
        if error.errno in GONE:
            self._away(BusState.GONE, FrameFault.BUS_GONE)
        elif error.errno == errno.ENETDOWN:
            if self._matched:
                self._away(BusState.DOWN, FrameFault.BUS_DOWN)
                return
            if self.state is not BusState.DOWN:
                self._on_fault(FrameFault.BUS_DOWN)
            self.state = BusState.DOWN
            self._under_way.clear()  # the queue is emptied with the interface
            self._claimed.clear()
        elif error.errno == errno.EINVAL and self._size == FD_SIZE:
            self._away(BusState.UNFIT, FrameFault.BUS_ERROR, NO_FD)
        elif error.errno not in (errno.ENOBUFS, errno.EAGAIN):  # full queues: the send has failed
            self.state = BusState.FAILED
            self._on_fault(FrameFault.BUS_ERROR)

    def _away(self, state: BusState, fault: FrameFault, why: str = "") -> None:
        """Stop sending and receiving until the interface is opened again; report a fault once."""
        self.close()
        self._not_before_ns = time.monotonic_ns() + REOPEN_NS
        if self.state is not state:
            self.state, self.why = state, why
            self._on_fault(fault)

    def _use(self) -> None:
        """Begin with new sockets, of which nothing is known yet."""
        arrivals = Arrivals()  # before a frame can arrive
        self._sockets = sockets = self._open(self._ids)
        self._confirms = self._own and self._echo()
        self._good = BusState.UNCONFIRMED if self._own and not self._confirms else UP
        self._errors = self._quiet_until_ns = 0
        self._no_carrier = False
        self._arrivals = arrivals
        sockets[0].setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._waiting = [readable(one) for one in sockets]
        self._receive = sockets[0].recvmsg
        self._send = sockets[1].send if len(sockets) > 1 else sockets[0].send
        self._under_way.clear()
        self._claimed.clear()
        self._dropped = 0
        self._not_before_ns = 0

    def _reopened(self) -> bool:
        """Look for an interface that has gone, was down, or was another device."""
        if self.state not in AWAY or time.monotonic_ns() < self._not_before_ns:
            return False
        try:
            self._use()
        except WrongDeviceError:
            self._away(BusState.WRONG_DEVICE, FrameFault.BUS_WRONG_DEVICE)
            return False
        except OSError as error:
            if error.errno in GONE:
                self._away(BusState.GONE, FrameFault.BUS_GONE)
            elif error.errno in NOT_FIT:
                self._away(BusState.UNFIT, FrameFault.BUS_ERROR, error.strerror or "")
            self._not_before_ns = time.monotonic_ns() + REOPEN_NS
            return False
        self.why = ""
        if self.state is not BusState.DOWN:  # which is over with the first frame
            self.state = self._good
        return True

    def watch(self, name: str, ids: BusRoutes) -> None:
        """Serve another deployment: its name of the bus, its messages."""
        self.name, self._ids = name, ids
        self._valves, self._claims = kernel_ids(ids.valves), kernel_ids(ids.claims)
        self._fd = kernel_ids(ids.fd)
        self._under_way.clear()
        if self._sockets:
            try:
                set_filters(self._sockets, ids)
            except OSError as error:
                self._failed(error)

    def fileno(self) -> int:
        """File descriptor to wait on; -1 while the interface is gone."""
        return self._sockets[0].fileno() if self._sockets else -1

    def close(self) -> None:
        """Close the sockets."""
        for one in self._sockets:
            one.close()
        self._sockets = []
