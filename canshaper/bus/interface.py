"""The SocketCAN interface under a raw port: its state, and its sockets while they are open.

Someone pulls out an adapter or sets an interface down, or a bus takes no frames. Each is a state.
A socket error, an error frame, a missing confirmation or the carrier shows it, and it ends by
itself once the interface works again.
"""

import errno
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from canshaper.bus.device import FD_MTU
from canshaper.bus.packet import (
    CAN_FRAME,
    CLASS_RESTARTED,
    SIZE,
    SO_TIMESTAMPNS,
    Arrivals,
    read_error,
)
from canshaper.bus.socketcan import (
    STATE_CLASSES,
    carrier,
    readable,
    receive_errors,
    renamed,
)
from canshaper.codec.frame import ERR_FLAG, BusState, FrameFault
from canshaper.config.bus import Bus
from canshaper.errors import WrongDeviceError
from canshaper.machine.routing import BusRoutes

# After so many error frames in one tick, the kernel filters out those without a state for a while.
# Their count is therefore a lower bound.
MOST_ERRORS = 50
QUIET_NS = 1_000_000_000
# Time between two attempts to send one frame (neutral by then) on a bus that takes none.
PROBE_NS = 500_000_000
# Time between two attempts to reopen an interface; it must work within a second of its return.
REOPEN_NS = 200_000_000
# Errors of a socket whose device is gone: a socket for its successor has to be bound again.
GONE = frozenset((errno.ENODEV, errno.ENXIO, errno.EBADF))
# States in which the sockets are closed until they can be opened again.
AWAY = frozenset((BusState.GONE, BusState.DOWN, BusState.WRONG_DEVICE, BusState.UNFIT))
# Errors of an interface that exists but does not suit the bus.
NOT_FIT = frozenset((errno.EINVAL, errno.EOPNOTSUPP))
NO_FD = f"expected an interface with CAN FD, which has the MTU {FD_MTU}, got one without"
# Unconfirmed frames of one id that are a fault once they have waited for UNCONFIRMED_NS: one waits,
# one is being sent, and the confirmation of one may come just after the tick. A fast loop on a slow
# bus is no fault, so the time counts as well: 30 frames at 250 kbit/s.
MOST_UNCONFIRMED = 3
UNCONFIRMED_NS = 20_000_000
# Claims under way: on a bus that takes no frames one is sent now and then, until the queue is full.
MOST_CLAIMS = 32


class UnderWay:
    """Our frames that were sent and not yet confirmed.

    Attributes:
        counts: number of frames by id with its flags.
        claims: address claims as ``CAN_FRAME`` unpacks them; the first socket receives them back.
        dropped: ids of which frames were no longer counted, and none was confirmed since.
    """

    def __init__(self) -> None:
        self.counts: dict[int, int] = {}
        self.dropped: set[int] = set()
        self.claims: deque[Any] = deque(maxlen=MOST_CLAIMS)
        self._since_ns: dict[int, int] = {}

    def waited_ns(self, word: int, now_ns: int) -> int:
        """Return how long frames of an id wait for a confirmation, ns; 0 while that is no fault.

        The time counts from the first call since their last confirmation.
        """
        waited_ns = now_ns - self._since_ns.setdefault(word, now_ns)
        if self.counts[word] < MOST_UNCONFIRMED or waited_ns < UNCONFIRMED_NS:
            return 0
        return waited_ns

    def confirmed(self, word: int) -> None:
        """Take note that one frame of an id is on the bus."""
        self.counts[word] = max(0, self.counts.get(word, 0) - 1)
        self.dropped.discard(word)
        self._since_ns.pop(word, None)

    def restart(self, word: int) -> None:
        """Count the frames of an id, and the time that they wait, from 0."""
        self.counts[word] = 0
        del self._since_ns[word]

    def clear(self) -> None:
        """Count the frames of every id from 0; ``claims`` lists its frames one by one and stays."""
        self.dropped |= {word for word, count in self.counts.items() if count}
        self.counts.clear()
        self._since_ns.clear()


class Interface:
    """State and sockets of one interface.

    Args:
        config: section of the bus in the deployment file.
        on_fault: called with every fault of the bus.
        ids: messages to receive and to send; None for all messages, of which none is confirmed.
        open_sockets: opens the non-blocking sockets as ``socketcan.open_sockets`` does: one for
            received messages, and two more unless ``ids`` is None; called again after the interface
            was gone.
        has_echo: returns whether an interface returns our frames from the bus.

    Attributes:
        state: last known state of the bus.
        why: cause of a state whose name does not say it; empty for the others.

    Raises:
        OSError: the sockets cannot be opened.
        WrongDeviceError: the interface is another device.
    """

    def __init__(
        self,
        config: Bus,
        on_fault: Callable[[FrameFault], None],
        ids: BusRoutes | None,
        open_sockets: Callable[[Bus, BusRoutes | None], list[socket.socket]],
        has_echo: Callable[[str], bool],
    ) -> None:
        self.why = self._renamed = ""
        self._config, self._ids = config, ids
        self._on_fault = on_fault
        self._open, self._has_echo = open_sockets, has_echo
        self._under_way = UnderWay()
        self._use()
        self.state = self._good

    def _use(self) -> None:
        """Open the sockets, and begin without knowledge of the bus."""
        arrivals = Arrivals()  # before the sockets can receive a frame
        self._sockets = sockets = self._open(self._config, self._ids)
        own = self._ids is not None
        self._confirms = own and self._has_echo(self._config.channel)
        self._good = BusState.UNCONFIRMED if own and not self._confirms else BusState.UP
        self._errors = self._quiet_until_ns = 0
        self._no_carrier = False
        self._arrivals = arrivals
        sockets[0].setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._waiting = [readable(one) for one in sockets]
        self._receive = sockets[0].recvmsg
        self._send = sockets[1].send if len(sockets) > 1 else sockets[0].send
        self._under_way.clear()
        self._under_way.claims.clear()
        self._dropped = 0
        self._not_before_ns = 0

    def _reopened(self) -> bool:
        """Try to open lost sockets again, every ``REOPEN_NS``; return whether this opened them."""
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
        if self.state is not BusState.DOWN:  # the first frame ends DOWN
            self.state = self._good
        return True

    def _up(self) -> None:
        self.state = self._good
        self._not_before_ns = 0

    def _failed(self, error: OSError) -> None:
        """Set the state that an error of a socket shows, and report it; a full queue shows none."""
        if error.errno in GONE:
            self._away(BusState.GONE, FrameFault.BUS_GONE)
        elif error.errno == errno.ENETDOWN:
            if self._config.match:  # name and bit rate may differ when it is up again
                self._away(BusState.DOWN, FrameFault.BUS_DOWN)
                return
            if self.state is not BusState.DOWN:
                self._on_fault(FrameFault.BUS_DOWN)
            self.state = BusState.DOWN
            self._under_way.clear()  # an interface that goes down empties its queue
            self._under_way.claims.clear()
        elif error.errno == errno.EINVAL and self._config.fd:
            self._away(BusState.UNFIT, FrameFault.BUS_ERROR, NO_FD)
        elif error.errno not in (errno.ENOBUFS, errno.EAGAIN):  # full queues: only this send failed
            self.state = BusState.FAILED
            self._on_fault(FrameFault.BUS_ERROR)

    def _away(self, state: BusState, fault: FrameFault, why: str = "") -> None:
        """Set a state, report it if it is new, and close the sockets until they can be reopened."""
        self.close()
        self._not_before_ns = time.monotonic_ns() + REOPEN_NS
        if self.state is not state:
            self.state, self.why = state, why
            self._on_fault(fault)

    def _no_frame(self, data: bytes) -> None:
        """Report an error frame and set the state that it shows; the rest is a WRONG_LENGTH.

        After ``MOST_ERRORS`` in a tick, receive for ``QUIET_NS`` only those that show a state.
        """
        word, _length, payload = CAN_FRAME.unpack(data) if len(data) == SIZE else (0, 0, b"")
        if not word & ERR_FLAG:
            self._on_fault(FrameFault.WRONG_LENGTH)
            return
        fault, state = read_error(word, payload)
        if state is BusState.BUS_OFF:
            self._no_carrier = False
            self._block(state)
        elif state is BusState.UP:
            # Without an echo nothing else shows the end of bus-off, and a frame sent before that
            # end is dropped.
            if self._confirms or self.state is not BusState.BUS_OFF or word & CLASS_RESTARTED:
                self._up()
        elif state is not None and self.state is self._good:
            self.state = state
        self._on_fault(fault)
        self._errors += 1
        if self._errors == MOST_ERRORS:
            self._receive_errors(STATE_CLASSES, time.monotonic_ns() + QUIET_NS)

    def _receive_errors(self, classes: int, until_ns: int) -> None:
        """Receive error frames of these classes only, until a time; 0: for good."""
        self._quiet_until_ns = until_ns
        with suppress(OSError, IndexError):  # gone: it is opened again with all classes
            receive_errors(self._sockets[min(1, len(self._sockets) - 1)], classes)

    def _block(self, state: BusState) -> None:
        """Set a state in which one frame is queued every ``PROBE_NS``; forget those under way."""
        self.state = state
        self._not_before_ns = time.monotonic_ns() + PROBE_NS
        self._under_way.clear()

    def _blocked(self) -> bool:
        """Return whether a frame must not be queued now; one every ``PROBE_NS`` may try."""
        now_ns = time.monotonic_ns()
        if now_ns < self._not_before_ns:
            return True
        if self.state is BusState.BUS_OFF and not self._confirms:
            return True  # the kernel would drop it and report no error
        self._not_before_ns = now_ns + PROBE_NS
        self._under_way.clear()
        return False

    def look(self) -> str:
        """Check name and, without an echo, carrier; return a log line of a new name, else empty."""
        if not self._sockets:
            return ""
        one = self._sockets[0]
        try:
            has_carrier = carrier(one)
            text = renamed(one, self._config.channel)
        except OSError:  # it is going; the next frame shows that
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

    def fileno(self) -> int:
        """Return the file descriptor to wait on; -1 while the interface is gone."""
        return self._sockets[0].fileno() if self._sockets else -1

    def close(self) -> None:
        """Close the sockets."""
        for one in self._sockets:
            one.close()
        self._sockets = []
