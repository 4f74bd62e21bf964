"""An open CAN bus: SocketCAN by raw sockets, every other interface through python-can.

A port reports every error of its bus, and raises none once it is open. It reads and sends again at
the next tick, and so uses an interface again that comes back.
"""

import errno
import socket
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol

from canshaper.bus.device import has_echo, whereabouts
from canshaper.bus.raw import RawPort
from canshaper.bus.socketcan import open_sockets
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.config.bus import Bus
from canshaper.errors import BusError, WrongBusError, WrongDeviceError
from canshaper.machine.routing import BusRoutes


class Port(Protocol):
    """One open bus."""

    name: str
    waited: int  # number of valve frames that stayed in the kernel's queue beyond their cycle

    @property
    def why(self) -> str:
        """Cause of a state whose name does not say it; otherwise empty."""

    @property
    def state(self) -> BusState:
        """State of the bus."""

    @property
    def arrived_ns(self) -> int:
        """Arrival of the last frame that ``frames`` yielded, by ``boottime_ns``.

        Without a time stamp: the earlier time when the bus was last seen empty.
        """

    def frames(self) -> Iterator[Frame]:
        """Yield the waiting data frames in order, 2000 at most; end early if the bus fails."""

    def background(self) -> Iterator[Frame]:
        """Yield frames to read after the valve frames are sent, as of others with our ids."""

    def send(self, frame: Frame) -> bool:
        """Send now or not at all; return whether the kernel or the adapter took the frame."""

    @property
    def confirmed(self) -> bool | None:
        """Whether all valve frames sent are on the bus; None if the bus does not say."""

    def look(self) -> str:
        """Check the interface; return a line for the log, or an empty one. Called once a second."""

    def watch(self, name: str, ids: BusRoutes) -> None:
        """Serve another deployment, with its name of the bus and its messages."""

    def fileno(self) -> int:
        """Return the file descriptor to wait on; -1 without one."""

    def close(self) -> None:
        """Close the bus; ignore the errors of a bus that is gone."""


def open_port(
    name: str,
    config: Bus,
    on_fault: Callable[[FrameFault], None],
    ids: BusRoutes | None = None,
    *,
    fd: Iterable[tuple[int, bool]] = (),
) -> Port:
    """Open a bus.

    Args:
        name: name of the bus in the deployment file.
        config: section of the bus in the deployment file.
        on_fault: called with every fault of the bus.
        ids: messages to receive and to send; None receives all frames.
        fd: messages to send as CAN FD frames; used without ``ids`` only.

    Raises:
        BusError: the bus cannot be opened, or is another device; the message says which and why.
    """
    try:
        fd = ids.fd if ids else fd
        if config.interface != "socketcan":
            from canshaper.bus.python_can import PythonCanPort

            return PythonCanPort(name, config, on_fault, fd)
        return RawPort(
            name, config, on_fault, ids, fd, open_sockets=open_sockets, has_echo=has_echo
        )
    except WrongDeviceError as error:
        raise WrongBusError(name, f"{error}{whereabouts(config)}") from error
    except Exception as error:  # each interface raises its own classes
        raise not_opened(name, config, error) from error


def not_opened(name: str, config: Bus, error: Exception) -> BusError:
    """Return the error that every verb reports for a bus that ``error`` keeps from opening."""
    text = (error.strerror if isinstance(error, OSError) else None) or str(error)
    if isinstance(error, OSError) and error.errno == errno.EAFNOSUPPORT:
        text = "this kernel has no CAN, or its module can_raw is not loaded"
    if config.interface == "socketcan" and not hasattr(socket, "AF_CAN"):
        text = f"it needs Linux, got {sys.platform}; python-can has other interfaces"
    where = f"{config.interface} channel {config.channel}"
    text = f"{text or type(error).__name__}{whereabouts(config)}"
    return BusError(f"bus {name}: cannot open {where}: {text}")


class ListeningPort:
    """A port of a deployment that only listens: it sends status and claims, and no valve frame.

    It is the last step before the bus, so no error above it can reach a valve.
    """

    def __init__(self, port: Port, ids: BusRoutes) -> None:
        self._port = port
        self._sent = ids.sent | ids.claims
        self.name, self.waited = port.name, 0

    @property
    def state(self) -> BusState:
        """State of the bus."""
        return self._port.state

    @property
    def why(self) -> str:
        """Cause of a state whose name does not say it; otherwise empty."""
        return self._port.why

    @property
    def confirmed(self) -> bool | None:
        """None, because this port sends no valve frame that could be confirmed."""
        return None

    @property
    def arrived_ns(self) -> int:
        """Arrival of the last frame that ``frames`` yielded, by ``boottime_ns``."""
        return self._port.arrived_ns

    def frames(self) -> Iterator[Frame]:
        """Yield the waiting data frames in order."""
        return self._port.frames()

    def background(self) -> Iterator[Frame]:
        """Yield frames to read after the valve frames are sent."""
        return self._port.background()

    def send(self, frame: Frame) -> bool:
        """Send a status or a claim; drop any other frame, and return True for it."""
        return frame[1:3] not in self._sent or self._port.send(frame)

    def look(self) -> str:
        """Check the interface; return a line for the log, or an empty one."""
        return self._port.look()

    def watch(self, name: str, ids: BusRoutes) -> None:
        """Serve another deployment, with its name of the bus and its messages."""
        self.name, self._sent = name, ids.sent | ids.claims
        self._port.watch(name, ids)

    def fileno(self) -> int:
        """Return the file descriptor to wait on; -1 without one."""
        return self._port.fileno()

    def close(self) -> None:
        """Close the bus."""
        self._port.close()
