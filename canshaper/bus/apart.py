"""Two threads that call a blocking bus of python-can, so that the control loop never waits for it.

``send`` on a serial line or a TCP connection blocks until the line takes the bytes; if the line
takes none, it blocks for ever. ``recv(0)`` on a serial line blocks for the line's own timeout. At
most one frame of each id waits here to be sent, for ``LEAVE_NS`` at most.
"""

import array
import socket
import termios
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from fcntl import ioctl
from select import select

import can

from canshaper.gate.cycle import boottime_ns

# Longest time from ``send`` until a frame leaves, and longest time that an adapter may take for one
# frame: half a tick of the slowest loop, ten frames on a serial line of 115200 baud.
LEAVE_NS = 20_000_000
LEAVE_S = LEAVE_NS / 1e9
# Time between two attempts to send one frame (neutral by then) to an adapter that takes none.
PROBE_NS = 500_000_000
# Time that a read waits before the bus counts as empty again. A frame looks older by that time.
LOOK_S = 0.005
# Polling period of an adapter with nothing to wait on.
POLL_S = 0.002
# Frames that may wait to be read: the backlog of a long stall.
MOST_RECEIVED = 20_000
# Longest time that a close waits for the last frames and for the interface to shut down.
CLOSE_S = 0.2
# linux/sockios.h and asm/ioctls.h: bytes that a TCP connection or a tty has not sent yet.
SIOCOUTQNSD, TIOCOUTQ = 0x894B, 0x5411


class BusApart:
    """A bus of python-can whose methods never block; it has those that a port uses.

    Args:
        bus: the bus that may block; nothing else may call it from now on.
        receive: returns its next waiting frame, or None; raises what the interface raises.

    Attributes:
        since_ns: time by ``boottime_ns`` when the bus was last seen empty before the frame that
            ``recv`` has just returned. The frame arrived after that time.
        took: whether the interface took the last frame in time.
        lost: number of received frames dropped because too many waited to be read.
    """

    def __init__(
        self, bus: can.BusABC, receive: Callable[[can.BusABC], can.Message | None]
    ) -> None:
        self.since_ns = boottime_ns()
        self.took = True
        self.lost = 0
        self._bus, self._receive = bus, receive
        self._descriptor = descriptor(bus)
        self._changed = threading.Condition()
        self._waiting: dict[tuple[int, bool], tuple[can.Message, int]] = {}
        self._began_ns = 0  # when the present call of ``send`` began; 0 without one
        self._unsent_ns = 0  # since when the kernel holds unsent bytes; 0 without any
        self._late = False  # the last frame left too late
        self._not_before_ns = 0
        self._failure: Exception | None = None
        self._closing = False
        self._received: deque[tuple[can.Message | Exception, int]] = deque(maxlen=MOST_RECEIVED)
        self._wake_reader, self._wake_writer = socket.socketpair()
        for one in (self._wake_reader, self._wake_writer):
            one.setblocking(False)
        self._sender = self._started(self._send_waiting)
        self._receiver = self._started(self._receive_all)

    @staticmethod
    def _started(target: Callable[[], None]) -> threading.Thread:
        thread = threading.Thread(target=target, daemon=True)
        thread.start()
        return thread

    # -- called by the loop: none of these blocks ----------------------------------------------

    def send(self, message: can.Message) -> None:
        """Hand a frame to the sending thread; it replaces a waiting frame with the same id.

        Raises:
            can.CanTimeoutError: the adapter takes no frames; this one and waiting ones are dropped.
            Exception: the error of the interface for an earlier frame; this frame is dropped.
        """
        now_ns = boottime_ns()
        with self._changed:
            if self._blocked(now_ns):
                self.took = self._late = False
                self._waiting.clear()
                self._not_before_ns = now_ns + PROBE_NS
                discard_unsent(self._descriptor)
            if now_ns < self._not_before_ns:
                raise can.CanTimeoutError("the adapter takes no frames")
            if self._failure:
                failure, self._failure = self._failure, None
                raise failure
            self._waiting[message.arbitration_id, message.is_extended_id] = message, now_ns
            self._changed.notify()

    def recv(self, _timeout_s: float) -> can.Message | None:
        """Return the next received frame, or None.

        Raises:
            Exception: the interface raised it when the frame was read.
        """
        received = self._received
        if not received:
            with suppress(BlockingIOError):
                self._wake_reader.recv(4096)
            if not received:  # a frame may have come before the descriptor was emptied
                return None
        message, self.since_ns = received.popleft()
        if isinstance(message, Exception):
            raise message
        return message

    def fileno(self) -> int:
        """Return a file descriptor that is readable while a received frame waits."""
        return self._wake_reader.fileno()

    def shutdown(self) -> None:
        """Close the bus after the waiting frames are sent; abandon it after ``CLOSE_S``."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._sender.join(CLOSE_S)
        if self._sender.is_alive():
            # Otherwise the kernel lets the process exit only after the line has taken every byte.
            discard_unsent(self._descriptor)
        self._wake_reader.close()
        self._wake_writer.close()

    def _blocked(self, now_ns: int) -> bool:
        """Return whether a frame took or takes too long, in the interface or in the kernel."""
        if not unsent(self._descriptor):
            self._unsent_ns = 0
        elif not self._unsent_ns:
            self._unsent_ns = now_ns
        since = [ns for ns in (self._began_ns, self._unsent_ns) if ns]
        return self._late or (bool(since) and now_ns - min(since) > LEAVE_NS)

    # -- the two threads -----------------------------------------------------------------------

    def _send_waiting(self) -> None:
        while message := self._next():
            failure = None
            try:
                self._bus.send(message, LEAVE_S)  # most interfaces ignore the timeout
            except Exception as error:  # each interface raises its own classes
                failure = error
            with self._changed:
                self._late = boottime_ns() - self._began_ns > LEAVE_NS
                self.took = not (failure or self._late)
                # Keep an earlier failure until it is reported, although this frame may have left.
                self._failure = None if self._late else failure or self._failure
                self._began_ns = 0
        self._receiver.join(CLOSE_S)
        with suppress(Exception):
            self._bus.shutdown()

    def _next(self) -> can.Message | None:
        """Wait for a frame not older than ``LEAVE_NS``, and return it; None once the bus closes."""
        with self._changed:
            while True:
                while not self._waiting:
                    if self._closing:
                        return None
                    self._changed.wait()
                message, given_ns = self._waiting.pop(next(iter(self._waiting)))
                now_ns = boottime_ns()
                if now_ns - given_ns <= LEAVE_NS:
                    self._began_ns = now_ns
                    return message

    def _receive_all(self) -> None:
        empty_ns = boottime_ns()
        while not self._closing:
            polled_ns, readable = boottime_ns(), self._readable(0.0)
            result: can.Message | Exception | None
            try:
                result = self._receive(self._bus)
            except Exception as error:  # each interface raises its own classes
                result = error
            if result is None and readable and ended(self._descriptor):
                result = can.CanOperationError("the connection was closed at its other end")
            if result is not None:
                # If the loop reads a frame meanwhile, this counts one too many, which is safe.
                self.lost += len(self._received) == MOST_RECEIVED
                self._received.append((result, empty_ns))
                with suppress(OSError):  # full: the reader wakes anyway; or closed
                    self._wake_writer.send(b"\0")
            if isinstance(result, Exception):
                time.sleep(POLL_S)  # every call may fail
            elif result is None and not readable:
                # If the line was readable, ``_receive`` took bytes that are no frame, and a frame
                # may wait behind them.
                empty_ns = polled_ns
                self._readable(LOOK_S)

    def _readable(self, timeout_s: float) -> bool:
        """Return whether a line has bytes to read, in ``timeout_s`` at most; False if unknown."""
        if self._descriptor >= 0:
            with suppress(OSError, ValueError):  # closed meanwhile
                return bool(select([self._descriptor], [], [], timeout_s)[0])
        time.sleep(min(timeout_s, POLL_S))
        return False


def descriptor(bus: can.BusABC) -> int:
    """Return the file descriptor of the line behind a bus; -1 if it has none."""
    # python-can offers no public access to the connection of socketcand.
    line = getattr(bus, "_SocketCanDaemonBus__socket", bus)
    try:
        return int(line.fileno())
    except Exception:  # most have none, and each raises its own class
        return -1


def unsent(fileno: int) -> int:
    """Return the number of bytes that the kernel has yet to send on a line; 0 if unknown."""
    count = array.array("i", [0])
    for request in (SIOCOUTQNSD, TIOCOUTQ):
        with suppress(OSError, ValueError):
            ioctl(fileno, request, count)
            return count[0]
    return 0


def ended(fileno: int) -> bool:
    """Return whether a line is a connection that the other end has closed."""
    try:
        connection = socket.socket(fileno=fileno)
    except OSError:  # no socket
        return False
    try:
        return not connection.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
    except OSError:  # nothing waits
        return False
    finally:
        connection.detach()


def discard_unsent(fileno: int) -> None:
    """Drop the bytes that the kernel has yet to send on a serial line; TCP keeps its queue."""
    with suppress(ValueError, termios.error):
        termios.tcflush(fileno, termios.TCOFLUSH)
