"""CAN buses through python-can, without its Notifier: one exception ends that thread for good.

Every error of a bus is counted and told, none leaves this module; reading and sending go on with
the next tick, so an interface that comes back is used again.
"""

import socket
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import can

from canshaper.can.frame import Frame, FrameFault
from canshaper.config.schema import Bus

# Frames taken from one bus in one tick at most: at 1 Mbit/s a bus carries 180 frames in 20 ms;
# ten times that empties any backlog and still cannot hold up the tick for ever.
MOST_FRAMES = 2000
# Room for the backlog of a long stall; python-can leaves the default of about 300 frames.
RECEIVE_BUFFER_BYTES = 1 << 20
# Frames sent and not yet seen again: a few ticks of a machine with many axes.
MOST_ECHOES = 256


class BusError(Exception):
    """A bus could not be opened."""


class Port:
    """One open bus.

    Args:
        name: name of the bus in the deployment file.
        config: its section.
        on_fault: called with every fault of the bus.

    Raises:
        BusError: the bus cannot be opened; the message says which and why.
    """

    def __init__(self, name: str, config: Bus, on_fault: Callable[[FrameFault], None]) -> None:
        self.name = name
        self._on_fault = on_fault
        options: dict[str, Any] = {} if config.bitrate is None else {"bitrate": config.bitrate}
        try:
            # ignore_config: files and variables of the environment must not change the bus
            self._bus = can.Bus(
                interface=config.interface,
                channel=config.channel,
                ignore_config=True,
                receive_own_messages=False,
                **options,
            )
        except Exception as error:  # each interface raises its own kinds
            text = str(error) or type(error).__name__
            raise BusError(
                f"bus {name}: cannot open {config.interface} channel {config.channel}: {text}"
            ) from error
        # Multicast brings back what this process sent; SocketCAN does not.
        self._echoes: deque[Frame] | None = (
            deque(maxlen=MOST_ECHOES) if config.interface == "udp_multicast" else None
        )
        raw = getattr(self._bus, "socket", None)
        if isinstance(raw, socket.socket):
            raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)

    def frames(self) -> Iterator[Frame]:
        """Every frame that waits, in order; ends when there is none or the bus fails."""
        receive = self._bus.recv
        for _ in range(MOST_FRAMES):
            try:
                message = receive(0)
            except (can.CanError, OSError):
                self._on_fault(FrameFault.BUS_ERROR)
                return
            if message is None:
                return
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

    def send(self, frame: Frame) -> bool:
        """Send now or not at all; False when the frame did not go out."""
        message = can.Message(
            arbitration_id=frame.can_id, is_extended_id=frame.extended, data=frame.data
        )
        try:
            self._bus.send(message)
        except (can.CanError, OSError):
            return False
        if self._echoes is not None:
            self._echoes.append(frame)
        return True

    def fileno(self) -> int:
        """File descriptor to wait on; -1 where the interface has none."""
        return int(self._bus.fileno())

    def close(self) -> None:
        """Close the bus; errors of a bus that is gone do not matter any more."""
        try:
            self._bus.shutdown()
        except (can.CanError, OSError):
            return
