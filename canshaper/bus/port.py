"""CAN buses of a deployment: SocketCAN by raw sockets, everything else through python-can.

Every error of a bus is counted and told, none leaves this module; reading and sending go on with
the next tick, so an interface that comes back is used again.
"""

import errno
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any, Protocol

import can

from canshaper.bus.arrival import Arrivals
from canshaper.bus.device import whereabouts
from canshaper.bus.multicast import LocalMulticastBus, receive_one_group
from canshaper.bus.raw import MOST_FRAMES, RawPort
from canshaper.bus.socketcan import open_sockets
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.config.bus import Bus
from canshaper.errors import BusError, WrongBusError, WrongDeviceError
from canshaper.machine.routing import BusRoutes

# Frames sent and not yet seen again: a few ticks of a machine with many axes.
MOST_ECHOES = 256
# Failures of an interface in one tick: a garbled line of an adapter costs that line, and what waits
# behind it must not grow old; a bus that is gone fails at every call.
MOST_FAILURES = 20


class Port(Protocol):
    """One open bus."""

    name: str

    @property
    def state(self) -> BusState:
        """How the bus is."""

    @property
    def arrived_ns(self) -> int:
        """When the frame arrived that ``frames`` has just handed out, by ``boottime_ns``.

        Where no one stamps the frames: when the bus was last seen empty, which is before that.
        """

    def frames(self) -> Iterator[Frame]:
        """Every frame that waits, in order; ends when there is none or the bus fails."""

    def background(self) -> Iterator[Frame]:
        """What can wait until the valves have been told: other senders with our ids, and so on."""

    def send(self, frame: Frame) -> bool:
        """Send now or not at all; False when the frame did not go out."""

    def watch(self, name: str, ids: BusRoutes) -> None:
        """Serve another deployment: its name of the bus, its messages."""

    def fileno(self) -> int:
        """File descriptor to wait on; -1 where there is none."""

    def close(self) -> None:
        """Close the bus; errors of a bus that is gone do not matter any more."""


def open_port(
    name: str, config: Bus, on_fault: Callable[[FrameFault], None], ids: BusRoutes | None = None
) -> Port:
    """Open a bus.

    Args:
        name: name of the bus in the deployment file.
        config: its section.
        on_fault: called with every fault of the bus.
        ids: the messages that matter; None takes all frames.

    Raises:
        BusError: the bus cannot be opened, or is another device; the message says which and why.
    """
    try:
        if config.interface != "socketcan":
            return PythonCanPort(name, config, on_fault)
        return RawPort(
            name,
            partial(open_sockets, config),
            ids,
            on_fault,
            confirms=ids is not None,
            matched=config.match is not None,
        )
    except WrongDeviceError as error:
        raise WrongBusError(name, f"{error}{whereabouts(config)}") from error
    except Exception as error:  # each interface raises its own kinds
        text = (error.strerror if isinstance(error, OSError) else None) or str(error)
        if isinstance(error, OSError) and error.errno == errno.EAFNOSUPPORT:
            text = "this kernel has no CAN, or its module can_raw is not loaded"
        where = f"{config.interface} channel {config.channel}"
        text = f"{text or type(error).__name__}{whereabouts(config)}"
        raise BusError(f"bus {name}: cannot open {where}: {text}") from error


class ListeningPort:
    """A port that sends only what a deployment that listens may send; all else is left out.

    The last thing before the bus: whatever is asked of it, no valve hears of it.
    """

    def __init__(self, port: Port, ids: BusRoutes) -> None:
        self._port = port
        self._sent = ids.sent | ids.claims
        self.name = port.name

    @property
    def state(self) -> BusState:
        """State of the bus."""
        return self._port.state

    @property
    def arrived_ns(self) -> int:
        """When the frame arrived that was just handed out."""
        return self._port.arrived_ns

    def frames(self) -> Iterator[Frame]:
        """Every frame that waits."""
        return self._port.frames()

    def background(self) -> Iterator[Frame]:
        """What can wait."""
        return self._port.background()

    def send(self, frame: Frame) -> bool:
        """Send a status; of anything else only say so."""
        return frame[1:3] not in self._sent or self._port.send(frame)

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


class PythonCanPort:
    """One open bus of python-can, without its Notifier: one exception ends that thread for good."""

    def __init__(self, name: str, config: Bus, on_fault: Callable[[FrameFault], None]) -> None:
        self.name = name
        self.state = BusState.UP
        self.arrived_ns = 0
        self._arrivals = Arrivals()  # before a frame can arrive
        self._on_fault = on_fault
        self._bus = open_python_can(config)
        # Multicast brings back what this process sent; the others do not.
        multicast = config.interface == "udp_multicast"
        self._echoes: deque[Frame] | None = deque(maxlen=MOST_ECHOES) if multicast else None

    def frames(self) -> Iterator[Frame]:
        """Every frame that waits, in order; ends when there is none or the bus fails."""
        receive, failures = self._bus.recv, 0
        # python-can's own times are those of whatever clock an interface has.
        self.arrived_ns = self._arrivals.begin()
        for _ in range(MOST_FRAMES):
            try:
                message = receive(0)
            except Exception:  # each interface raises its own kinds
                self.state = BusState.FAILED
                self._on_fault(FrameFault.BUS_ERROR)
                failures += 1
                if failures == MOST_FAILURES:
                    return
                continue
            if message is None:
                self._arrivals.emptied()
                return
            self.state = BusState.UP
            if message.is_error_frame:  # first: its id is an error class, and could match
                self._on_fault(FrameFault.ERROR_FRAME)
            elif message.is_remote_frame or message.is_fd:
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
        """Nothing: ``frames`` hands out everything."""
        return iter(())

    def send(self, frame: Frame) -> bool:
        """Send now or not at all; False when the frame did not go out."""
        message = can.Message(
            arbitration_id=frame.can_id, is_extended_id=frame.extended, data=frame.data
        )
        try:
            self._bus.send(message)
        except Exception:  # as above
            self.state = BusState.FAILED
            return False
        if self._echoes is not None:
            self._echoes.append(frame)
        return True

    def watch(self, name: str, ids: BusRoutes) -> None:
        """Serve another deployment: its name of the bus."""
        self.name = name

    def fileno(self) -> int:
        """File descriptor to wait on; -1 where the interface has none."""
        try:
            return int(self._bus.fileno())
        except Exception:  # most have none and say so in their own way
            return -1

    def close(self) -> None:
        """Close the bus; errors of a bus that is gone do not matter any more."""
        with suppress(Exception):
            self._bus.shutdown()


def open_python_can(config: Bus) -> can.BusABC:
    """Open a bus of python-can; ``udp_multicast`` stays on this machine but with ``network``.

    Raises:
        Exception: each interface raises its own kinds.
    """
    if config.interface == "udp_multicast" and not config.network:
        return LocalMulticastBus(config.channel)
    options: dict[str, Any] = {} if config.bitrate is None else {"bitrate": config.bitrate}
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
        while bus.recv(0) is not None:  # of other groups, until now
            pass
    return bus
