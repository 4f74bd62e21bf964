"""The interface under a port on raw sockets: its state, and its sockets while it has any.

An adapter is pulled out, an interface is set down, a bus takes no frames. Each is a state that an
error of a socket, an error frame, a missing confirmation or the carrier shows; each is left by
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

# With so many error frames in one tick, the kernel keeps those without a state to itself for a
# while; so their count is a minimum.
MOST_ERRORS = 50
QUIET_NS = 1_000_000_000
# How often a bus that took no frames is tried again, with one frame, neutral by then.
PROBE_NS = 500_000_000
# How often an interface that has gone is looked for; it shall work again within a second.
REOPEN_NS = 200_000_000
# The device is gone; the socket would have to be bound to a new one.
GONE = frozenset((errno.ENODEV, errno.ENXIO, errno.EBADF))
# States in which the sockets are closed, to be opened again.
AWAY = frozenset((BusState.GONE, BusState.DOWN, BusState.WRONG_DEVICE, BusState.UNFIT))
# Sending or opening failed for what the interface of that name is.
NOT_FIT = frozenset((errno.EINVAL, errno.EOPNOTSUPP))
NO_FD = f"expected an interface with CAN FD, which has the MTU {FD_MTU}, got one without"
# Frames of one id under way, and for how long, until that is a fault: one waits, one is being sent,
# one more for a confirmation just after the tick. A slow bus with a fast loop is no fault, so time
# has to pass as well: 30 frames at 250 kbit/s.
MOST_UNCONFIRMED = 3
UNCONFIRMED_NS = 20_000_000
# Claims: on a bus that takes none one is sent now and then, until its queue is full.
MOST_CLAIMS = 32


class UnderWay:
    """Counts of our frames under way by id, and since when there is more than one.

    Attributes:
        counts: number of frames, by the kernel's id.
        claims: address claims; they come back to the socket of the inputs.
    """

    def __init__(self) -> None:
        self.counts: dict[int, int] = {}
        self.claims: deque[Any] = deque(maxlen=MOST_CLAIMS)
        self._since_ns: dict[int, int] = {}

    def waited_ns(self, word: int, now_ns: int) -> int:
        """How long frames of an id have been under way; 0 where that is no fault yet."""
        waited_ns = now_ns - self._since_ns.setdefault(word, now_ns)
        if self.counts[word] < MOST_UNCONFIRMED or waited_ns < UNCONFIRMED_NS:
            return 0
        return waited_ns

    def confirmed(self, word: int) -> None:
        """One of them is on the bus."""
        self.counts[word] = max(0, self.counts.get(word, 0) - 1)
        self._since_ns.pop(word, None)

    def restart(self, word: int) -> None:
        """Count the frames of an id from 0."""
        self.counts[word] = 0
        del self._since_ns[word]

    def clear(self) -> None:
        """Count all of them from 0; of claims it is known which they are."""
        self.counts.clear()
        self._since_ns.clear()


class Interface:
    """State and sockets of one interface.

    Args:
        config: its section.
        on_fault: called with every fault of the bus.
        ids: the messages that matter; None for all of them, of which none is confirmed.
        open_sockets: opens, non-blocking, a socket for the messages that are received and perhaps
            two for what else is to be seen, see ``socketcan.open_sockets``; called again after
            the interface was gone.
        has_echo: asks of the interface just opened whether our frames come back from the bus.

    Attributes:
        state: of the bus, as far as seen.
        why: cause of a state that does not say it; empty for the others.

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
        """Begin with new sockets, of which nothing is known yet."""
        arrivals = Arrivals()  # before a frame can arrive
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

    def _up(self) -> None:
        self.state = self._good
        self._not_before_ns = 0

    def _failed(self, error: OSError) -> None:
        """Take the state from an error of a socket."""
        if error.errno in GONE:
            self._away(BusState.GONE, FrameFault.BUS_GONE)
        elif error.errno == errno.ENETDOWN:
            if self._config.match:  # name and bit rate may be others when it is back
                self._away(BusState.DOWN, FrameFault.BUS_DOWN)
                return
            if self.state is not BusState.DOWN:
                self._on_fault(FrameFault.BUS_DOWN)
            self.state = BusState.DOWN
            self._under_way.clear()  # the queue is emptied with the interface
            self._under_way.claims.clear()
        elif error.errno == errno.EINVAL and self._config.fd:
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
        elif state is BusState.UP:
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

    def look(self) -> str:
        """Look after carrier and name of the interface, now and then; what to say of its name."""
        if not self._sockets:
            return ""
        one = self._sockets[0]
        try:
            has_carrier = carrier(one)
            text = renamed(one, self._config.channel)
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

    def fileno(self) -> int:
        """File descriptor to wait on; -1 while the interface is gone."""
        return self._sockets[0].fileno() if self._sockets else -1

    def close(self) -> None:
        """Close the sockets."""
        for one in self._sockets:
            one.close()
        self._sockets = []
