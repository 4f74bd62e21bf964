"""When a frame arrived: the kernel's stamp of it, on the clock of the control loop.

The kernel stamps by the wall clock, which may be set between the stamp and the read:
docs/decisions/0007-age-and-standstill.md.
"""

import socket
import struct
import time
from collections.abc import Iterable, Sequence

from canshaper.bus.clock import boottime_ns

SO_TIMESTAMPNS = 35  # asm/socket.h; Python has no name for it
_STAMP = struct.Struct("@ll")  # struct timespec of this machine
ANCILLARY_BYTES = 64  # room for one stamp with its header: CMSG_SPACE, which only POSIX has, is 32


def stamp_ns(ancillary: Iterable[tuple[int, int, bytes]]) -> int | None:
    """Arrival of a frame by the wall clock, ns; None where the kernel gave none.

    Args:
        ancillary: what ``recvmsg`` returned, of a socket with SO_TIMESTAMPNS.
    """
    for level, kind, value in ancillary:
        if kind == SO_TIMESTAMPNS and level == socket.SOL_SOCKET and len(value) == _STAMP.size:
            seconds, ns = _STAMP.unpack(value)
            return int(seconds) * 1_000_000_000 + int(ns)
    return None


class Arrivals:
    """Arrivals of the frames of one port, ns by ``boottime_ns``; never younger than they are.

    A frame arrived after the port was last seen empty, and before it is read. A wall clock that
    is set in between makes one of two offsets wrong, the one of then or the one of now: the one
    that makes the frame older is used.
    """

    def __init__(self) -> None:
        self._empty_ns = self._empty_offset_ns = 0
        self.begin()
        self.emptied()

    def begin(self) -> int:
        """A read of the port begins.

        Returns:
            Earliest arrival of what is read: when the port was last seen empty.
        """
        # In this order: a standstill between the two makes frames older, not younger.
        self._now_ns = boottime_ns()
        self._now_offset_ns = self._now_ns - time.time_ns()
        self._offset_ns = min(self._now_offset_ns, self._empty_offset_ns)
        return self._empty_ns

    def of(self, ancillary: Sequence[tuple[int, int, bytes]]) -> int:
        """Arrival of a frame that this read has found; the earliest where it has no stamp.

        Args:
            ancillary: what ``recvmsg`` returned, of a socket that carries nothing but stamps.
        """
        try:
            seconds, ns = _STAMP.unpack(ancillary[0][2])
        except (IndexError, struct.error):
            return self._empty_ns
        arrived_ns: int = seconds * 1_000_000_000 + ns + self._offset_ns
        if arrived_ns > self._now_ns:
            return self._now_ns
        return arrived_ns if arrived_ns > self._empty_ns else self._empty_ns

    def emptied(self) -> None:
        """Nothing waits in the port: what comes later arrived after this read began."""
        self._empty_ns, self._empty_offset_ns = self._now_ns, self._now_offset_ns
