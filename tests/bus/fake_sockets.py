"""A socket that keeps its options, for tests without CAN."""

import errno
from typing import Any

from canshaper.config.bus import Bus
from canshaper.machine.routing import BusRoutes

BUS = Bus(interface="socketcan", channel="can0", bitrate=250000)
IDS = BusRoutes(
    received=frozenset({(0x110, False)}),
    sent=frozenset({(0x200, False), (0x300, False)}),
    valves=frozenset({(0x200, False)}),
    known=frozenset({(0x110, False), (0x200, False), (0x300, False), (0x400, False)}),
)


class Made:
    """A socket that keeps its options."""

    def __init__(self, *arguments: int) -> None:
        self.arguments = arguments
        self.options: list[tuple[int, int, Any]] = []
        self.bound: tuple[str, ...] = ()
        self.blocking = True
        self.closed = False

    def setblocking(self, blocking: bool) -> None:
        self.blocking = blocking

    def setsockopt(self, *option: Any) -> None:
        self.options.append(option)

    def bind(self, address: tuple[str, ...]) -> None:
        if address == ("none",):
            raise OSError(errno.ENODEV, "No such device")
        self.bound = address

    def close(self) -> None:
        self.closed = True
