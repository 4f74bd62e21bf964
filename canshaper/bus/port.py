"""CAN buses of a deployment: SocketCAN by raw sockets, everything else through python-can.

Every error of a bus is counted and reported, none leaves this module; reading and sending go on
with the next tick, so an interface that comes back is used again.
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
    waited: int  # valve frames that were in the kernel's queue for longer than their cycle

    @property
    def why(self) -> str:
        """Cause of a state that does not say it; else empty."""

    @property
    def state(self) -> BusState:
        """State of the bus."""

    @property
    def arrived_ns(self) -> int:
        """When the frame arrived that ``frames`` has just handed out, by ``boottime_ns``.

        Where no one stamps the frames: when the bus was last seen empty, which is before that.
        """

    def frames(self) -> Iterator[Frame]:
        """Yield every frame that waits, in order; end when there is none or the bus fails."""

    def background(self) -> Iterator[Frame]:
        """Yield frames that can wait until the valve frames are out, as of senders with our ids."""

    def send(self, frame: Frame) -> bool:
        """Send now or not at all; False when the frame did not go out."""

    @property
    def confirmed(self) -> bool | None:
        """Whether every valve frame that was sent is on the bus; None where nothing says so."""

    def look(self) -> str:
        """Look after the interface, once a second; what to say of it."""

    def watch(self, name: str, ids: BusRoutes) -> None:
        """Serve another deployment: its name of the bus, its messages."""

    def fileno(self) -> int:
        """File descriptor to wait on; -1 where there is none."""

    def close(self) -> None:
        """Close the bus; errors of a bus that is gone do not matter any more."""


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
        config: its section.
        on_fault: called with every fault of the bus.
        ids: the messages that matter; None takes all frames.
        fd: without ``ids``, what is sent in frames of CAN FD.

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
    except Exception as error:  # each interface raises its own kinds
        raise not_opened(name, config, error) from error


def not_opened(name: str, config: Bus, error: Exception) -> BusError:
    """A bus that cannot be opened, in the words of every verb; ``error`` is why."""
    text = (error.strerror if isinstance(error, OSError) else None) or str(error)
    if isinstance(error, OSError) and error.errno == errno.EAFNOSUPPORT:
        text = "this kernel has no CAN, or its module can_raw is not loaded"
    if config.interface == "socketcan" and not hasattr(socket, "AF_CAN"):
        text = f"it needs Linux, got {sys.platform}; python-can has other interfaces"
    where = f"{config.interface} channel {config.channel}"
    text = f"{text or type(error).__name__}{whereabouts(config)}"
    return BusError(f"bus {name}: cannot open {where}: {text}")


class ListeningPort:
    """A port that sends only what a deployment that listens may send; all else is left out.

    The last thing before the bus: whatever is sent through it, no valve receives it.
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
        """Cause of the state."""
        return self._port.why

    @property
    def confirmed(self) -> bool | None:
        """None: this port sends no valve frame that could be confirmed."""
        return None

    @property
    def arrived_ns(self) -> int:
        """When the frame arrived that was just handed out."""
        return self._port.arrived_ns

    def frames(self) -> Iterator[Frame]:
        """Yield every frame that waits."""
        return self._port.frames()

    def background(self) -> Iterator[Frame]:
        """Yield frames that can wait."""
        return self._port.background()

    def send(self, frame: Frame) -> bool:
        """Send a status; drop anything else, and return True for it."""
        return frame[1:3] not in self._sent or self._port.send(frame)

    def look(self) -> str:
        """Look after the interface."""
        return self._port.look()

    def watch(self, name: str, ids: BusRoutes) -> None:
        """Serve another deployment."""
        self.name, self._sent = name, ids.sent | ids.claims
        self._port.watch(name, ids)

    def fileno(self) -> int:
        """File descriptor to wait on."""
        return self._port.fileno()

    def close(self) -> None:
        """Close the bus."""
        self._port.close()
