"""A bus of python-can whose calls may block, kept apart from the loop by two threads.

The ``send`` of a serial line or of a TCP connection waits until the line takes the bytes, for ever
where it takes none, and ``recv(0)`` of a serial line waits as long as the line's own timeout. What
waits here is one frame of each id, and none for longer than ``LEAVE_NS``.
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

from canshaper.bus.python_can import receive
from canshaper.gate.cycle import boottime_ns

# A frame may leave so late after it was given to an adapter, and an adapter may take so long for
# one: half a tick of the slowest loop, ten frames on a serial line of 115200 baud.
LEAVE_NS = 20_000_000
LEAVE_S = LEAVE_NS / 1e9
# How often an adapter that took no frames is tried again, with one frame, neutral by then.
PROBE_NS = 500_000_000
# How long a read waits before the bus counts as seen empty again: a frame looks so much older.
LOOK_S = 0.005
# Polling period of an adapter with nothing to wait on.
POLL_S = 0.002
# Room for the backlog of a long stall.
MOST_RECEIVED = 20_000
# Longest wait of a close for the last frames and for the goodbye of the interface.
CLOSE_S = 0.2
# linux/sockios.h and asm/ioctls.h: bytes that TCP has not sent yet, and those that a tty has not.
SIOCOUTQNSD, TIOCOUTQ = 0x894B, 0x5411


class BusApart:
    """The methods of ``can.BusABC`` that a port uses, of a bus whose calls may block.

    Args:
        bus: the bus; nothing else may call it any more.

    Attributes:
        since_ns: when the bus was seen empty before the frame that ``recv`` has just returned, by
            ``boottime_ns``: the frame arrived after that.
        took: whether the interface took the last frame in time.
        lost: frames that were dropped because too many waited to be read.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self.since_ns = boottime_ns()
        self.took = True
        self.lost = 0
        self._bus = bus
        self._descriptor = descriptor(bus)
        self._changed = threading.Condition()
        self._waiting: dict[tuple[int, bool], tuple[can.Message, int]] = {}
        self._began_ns = 0  # when the call began that sends now; 0 where there is none
        self._unsent_ns = 0  # since when bytes have been seen in the kernel; 0 where there are none
        self._late = False  # the last frame was
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

    # -- called by the loop: nothing of this waits ---------------------------------------------

    def send(self, message: can.Message) -> None:
        """Leave a frame to the thread that sends, in place of one with its id that still waits.

        Raises:
            can.CanTimeoutError: the adapter takes no frames; this one is dropped.
            Exception: what the interface raised for a frame before; this one is dropped.
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
        """The next frame that waits, or None.

        Raises:
            Exception: what the interface raised in its place.
        """
        received = self._received
        if not received:
            with suppress(BlockingIOError):
                self._wake_reader.recv(4096)
            if not received:  # else one came before its descriptor was read empty
                return None
        message, self.since_ns = received.popleft()
        if isinstance(message, Exception):
            raise message
        return message

    def fileno(self) -> int:
        """Descriptor that is readable when a frame waits."""
        return self._wake_reader.fileno()

    def shutdown(self) -> None:
        """Close the bus once what waits is sent; one that is blocked is left behind."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._sender.join(CLOSE_S)
        if self._sender.is_alive():
            # Else the kernel holds the process at its end until the line took it all.
            discard_unsent(self._descriptor)
        self._wake_reader.close()
        self._wake_writer.close()

    def _blocked(self, now_ns: int) -> bool:
        """Whether a frame was or is under way for too long, in the interface or in the kernel."""
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
                self._bus.send(message, LEAVE_S)  # most do not look at it
            except Exception as error:  # each interface raises its own kinds
                failure = error
            with self._changed:
                self._late = boottime_ns() - self._began_ns > LEAVE_NS
                self.took = not (failure or self._late)
                # Of a frame before too, until it is reported: the next one may well have left.
                self._failure = None if self._late else failure or self._failure
                self._began_ns = 0
        self._receiver.join(CLOSE_S)
        with suppress(Exception):
            self._bus.shutdown()

    def _next(self) -> can.Message | None:
        """The next frame that is not too old; None at the end."""
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
                result = receive(self._bus)
            except Exception as error:  # as above
                result = error
            if result is None and readable and ended(self._descriptor):
                result = can.CanOperationError("the connection was closed at its other end")
            if result is not None:
                # One too many where the loop reads one meanwhile: bad news too early is no harm.
                self.lost += len(self._received) == MOST_RECEIVED
                self._received.append((result, empty_ns))
                with suppress(OSError):  # it is full, which says as much; or closed
                    self._wake_writer.send(b"\0")
            if isinstance(result, Exception):
                time.sleep(POLL_S)  # it may fail at every call
            elif result is None and not readable:
                # Else it read bytes that are no frame, and a frame may wait behind them.
                empty_ns = polled_ns
                self._readable(LOOK_S)

    def _readable(self, timeout_s: float) -> bool:
        """Whether the line has something to read, or will have within a time."""
        if self._descriptor >= 0:
            with suppress(OSError, ValueError):  # closed meanwhile
                return bool(select([self._descriptor], [], [], timeout_s)[0])
        time.sleep(min(timeout_s, POLL_S))
        return False


def descriptor(bus: can.BusABC) -> int:
    """File descriptor of the line behind a bus; -1 where there is none."""
    # python-can has no other way to the connection of socketcand.
    line = getattr(bus, "_SocketCanDaemonBus__socket", bus)
    try:
        return int(line.fileno())
    except Exception:  # most have none and say so in their own way
        return -1


def unsent(fileno: int) -> int:
    """Bytes that the kernel has queued for a line and not sent; 0 where it does not say."""
    count = array.array("i", [0])
    for request in (SIOCOUTQNSD, TIOCOUTQ):
        with suppress(OSError, ValueError):
            ioctl(fileno, request, count)
            return count[0]
    return 0


def ended(fileno: int) -> bool:
    """Whether a line is a connection that its other end has closed."""
    try:
        connection = socket.socket(fileno=fileno)
    except OSError:  # it is none
        return False
    try:
        return not connection.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
    except OSError:  # nothing waits
        return False
    finally:
        connection.detach()


def discard_unsent(fileno: int) -> None:
    """Drop what the kernel has queued for a serial line and not sent; TCP keeps its queue."""
    with suppress(ValueError, termios.error):
        termios.tcflush(fileno, termios.TCOFLUSH)
