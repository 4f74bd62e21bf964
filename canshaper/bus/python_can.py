"""A bus of python-can whose errors and blocking calls never stop the control loop."""

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any

import can

from canshaper.bus.multicast import LocalMulticastBus, receive_one_group
from canshaper.bus.packet import Arrivals
from canshaper.bus.raw import MOST_FRAMES
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.config.bus import Bus
from canshaper.machine.buses import ALWAYS_FD
from canshaper.machine.routing import BusRoutes

# Most failures of an interface in one read. After a garbled line of an adapter the read continues,
# because the frames behind it must not grow old. A bus that is gone fails at every call.
MOST_FAILURES = 20


def receive(bus: Any, timeout_s: float | None = 0.0) -> can.Message | None:
    """Return the next frame of a bus; None if none comes in ``timeout_s`` (None: wait for ever).

    Raises:
        Exception: each interface raises its own classes.
    """
    try:
        message: can.Message | None = bus.recv(timeout_s)
    except Exception as error:
        # slcan keeps a line that it cannot decode, and would fail at that line for ever.
        if isinstance(error.__cause__, UnicodeDecodeError):
            getattr(bus, "_buffer", bytearray()).clear()
        raise
    return message


def waiting(bus: Any, most: int) -> Iterator[can.Message | Exception | None]:
    """Yield up to ``most`` waiting frames and errors of the interface; None when none waits.

    After ``MOST_FAILURES`` errors it ends without None.
    """
    failures = 0
    for _ in range(most):
        try:
            message = receive(bus)
        except Exception as error:  # each interface raises its own classes
            yield error
            failures += 1
            if failures == MOST_FAILURES:
                return
        else:
            yield message
            if message is None:
                return


# Most sent frames whose echo is awaited: a few ticks of a machine with many axes.
MOST_ECHOES = 256
# Interfaces whose calls return at once: datagrams and a queue in memory. Others may block.
NEVER_BLOCK = frozenset(("udp_multicast", "virtual"))
# Options of an interface unless the file sets them: the longest wait of a serial line in the middle
# of a frame, s; a TCP connection that sends without waiting for the last acknowledgement.
DEFAULTS: Mapping[str, Mapping[str, Any]] = {
    "serial": {"timeout": 0.01},
    "socketcand": {"tcp_tune": True},
}


class Changed(logging.Filter):
    """Passes a line of a log only if it differs from the previous line."""

    _last = ""

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether the line differs from the previous one."""
        text = record.getMessage()
        before, self._last = self._last, text
        return text != before


# While socketcand tries to reach its server, it logs the same line ten thousand times a second.
logging.getLogger("can.interfaces.socketcand.socketcand").addFilter(Changed())


class PythonCanPort:
    """One open bus of python-can; arguments as ``open_port``.

    It does without the Notifier of python-can, a thread that one exception ends for good.
    """

    def __init__(
        self,
        name: str,
        config: Bus,
        on_fault: Callable[[FrameFault], None],
        fd: Iterable[tuple[int, bool]] = (),
    ) -> None:
        self.name = name
        self._fd, self._fd_bus = frozenset(fd), config.fd
        self._brs = config.data_bitrate is not None
        self.state = BusState.UP
        self.why = ""
        self.confirmed = None  # python-can does not report when a frame is on the bus
        self.waited = 0  # always: ``BusApart`` drops a frame that does not leave in time
        self.arrived_ns = 0
        self._arrivals = Arrivals()  # before the bus can receive a frame
        self._on_fault = on_fault
        self._bus: Any = open_python_can(config)
        self._apart = config.interface not in NEVER_BLOCK
        if self._apart:
            from canshaper.bus.apart import BusApart  # uses modules that only POSIX has

            self._bus = BusApart(self._bus, receive)
        # Multicast returns the frames of this process; the other interfaces do not.
        multicast = config.interface == "udp_multicast"
        self._echoes: deque[Frame] | None = deque(maxlen=MOST_ECHOES) if multicast else None
        self._lost = 0

    def frames(self) -> Iterator[Frame]:
        """Yield the waiting data frames in order, but no echoes of ours; report errors.

        It ends after ``MOST_FRAMES`` frames, or after ``MOST_FAILURES`` errors of the interface.
        """
        # The time stamps of python-can are not used: each interface has its own clock.
        self.arrived_ns = self._arrivals.begin()
        if self._apart and (lost := self._bus.lost) != self._lost:
            self._lost = lost
            self._on_fault(FrameFault.FRAMES_LOST)
        for message in waiting(self._bus, MOST_FRAMES):
            if message is None:
                self._arrivals.emptied()
                return
            if isinstance(message, Exception):
                self.state = BusState.FAILED
                self._on_fault(FrameFault.BUS_ERROR)
                continue
            if self._apart:
                self.arrived_ns = self._bus.since_ns
            if self.state is not BusState.NOT_CONFIRMED:
                self.state = BusState.UP
            if message.is_error_frame:  # first: its id is an error class
                self._on_fault(FrameFault.ERROR_FRAME)
            elif message.is_remote_frame or (message.is_fd and not self._fd_bus):
                self._on_fault(FrameFault.WRONG_LENGTH)
            else:
                frame = Frame(
                    self.name, message.arbitration_id, message.is_extended_id, bytes(message.data)
                )
                if self._echoes and frame in self._echoes:
                    self._echoes.remove(frame)
                else:
                    yield frame

    def background(self) -> Iterator[Frame]:
        """Return no frames: ``frames`` yields all of them."""
        return iter(())

    def send(self, frame: Frame) -> bool:
        """Send now or not at all; return whether the interface, or its thread, took the frame."""
        fd = frame[1:3] in self._fd
        message = can.Message(
            arbitration_id=frame.can_id,
            is_extended_id=frame.extended,
            data=frame.data,
            is_fd=fd,
            bitrate_switch=fd and self._brs,
        )
        try:
            self._bus.send(message)
        except Exception as error:  # each interface raises its own classes
            blocked = self._apart and isinstance(error, can.CanTimeoutError)
            before = self.state
            self.state = BusState.NOT_CONFIRMED if blocked else BusState.FAILED
            if blocked and before is not self.state:
                self._on_fault(FrameFault.NOT_CONFIRMED)
            return False
        if self.state is BusState.NOT_CONFIRMED and self._bus.took:
            self.state = BusState.UP
        if self._echoes is not None:
            self._echoes.append(frame)
        return True

    def look(self) -> str:
        """Return an empty line: python-can knows no more of an interface."""
        return ""

    def watch(self, name: str, ids: BusRoutes) -> None:
        """Serve another deployment, with its name of the bus and its CAN FD messages."""
        self.name, self._fd = name, ids.fd

    def fileno(self) -> int:
        """Return the file descriptor to wait on; -1 if the interface has none."""
        try:
            return int(self._bus.fileno())
        except Exception:  # most have none, and each raises its own class
            return -1

    def close(self) -> None:
        """Close the bus; ignore the errors of a bus that is gone."""
        with suppress(Exception):
            self._bus.shutdown()


def open_python_can(config: Bus) -> can.BusABC:
    """Open a bus of python-can; ``udp_multicast`` stays on this computer unless ``network`` is set.

    Raises:
        Exception: each interface raises its own classes.
    """
    if config.interface == "udp_multicast" and not config.network:
        return LocalMulticastBus(config.channel)
    options = {**DEFAULTS.get(config.interface, {}), **config.options}
    if config.bitrate is not None:
        options["bitrate"] = config.bitrate
    if config.fd and config.interface not in ALWAYS_FD:
        options["fd"] = True
        if config.data_bitrate is not None:
            options["data_bitrate"] = config.data_bitrate
    # ignore_config: files and variables of the environment must not change the bus
    bus = can.Bus(
        interface=config.interface,
        channel=config.channel,
        ignore_config=True,
        receive_own_messages=False,
        **options,
    )
    if config.interface == "udp_multicast":
        receive_one_group(bus.fileno())
        while bus.recv(0) is not None:  # frames of other groups received so far
            pass
    return bus
