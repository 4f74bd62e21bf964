"""Messages to the service manager by sd_notify(3): each is one datagram of KEY=VALUE lines.

Without a service manager (no NOTIFY_SOCKET) no message is sent.
"""

import os
import socket
import time
from collections.abc import Mapping

# Watchdog limit while a bus opens, which takes some adapters seconds; every axis is neutral then.
RELOAD_US = 30_000_000


class ServiceManager:
    """The service manager that started the daemon, if one did.

    Args:
        environment: variables of the process; NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID count.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket: socket.socket | None = None
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)  # a hanging manager must not block the loop
        limit_us = int(environment.get("WATCHDOG_USEC") or 0)
        ours = environment.get("WATCHDOG_PID") in (None, "", str(os.getpid()))
        self._limit_us = limit_us if ours else 0
        # A quarter of the limit: two pings may be late or lost before the manager acts.
        self._ping_ns = self._limit_us * 1000 // 4
        self._next_ping_ns = 0
        self._unsent: str | None = None

    def ready(self, status: str) -> None:
        """Report that the service runs, or that a reload is over."""
        limit = f"\nWATCHDOG_USEC={self._limit_us}" if self._limit_us else ""
        self._send_surely(f"READY=1\nSTATUS={status}{limit}")

    @property
    def present(self) -> bool:
        """Whether a service manager started the daemon."""
        return self._socket is not None

    def waiting(self, status: str) -> None:
        """Report the service as ready while it waits for an adapter; the watchdog waits longer."""
        limit = f"\nWATCHDOG=1\nWATCHDOG_USEC={RELOAD_US}" if self._limit_us else ""
        self._send(f"READY=1\nSTATUS={status}{limit}")

    def reloading(self) -> None:
        """Report that the daemon applies a reload and the loop waits, until ``ready``.

        Meanwhile the longer limit of the watchdog applies. systemd fails a reload that takes longer
        than TimeoutStartSec, so the daemon calls this only once every axis is neutral.
        """
        limit = f"\nWATCHDOG_USEC={RELOAD_US}" if self._limit_us else ""
        self._send_surely(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}{limit}")

    def stopping(self) -> None:
        """Report that the service stops."""
        self._send("STOPPING=1")

    def status(self, text: str) -> None:
        """Report the status line that ``systemctl status`` shows."""
        self._send(f"STATUS={text}")

    def ping(self, now_ns: int) -> None:
        """Report every quarter of the watchdog's limit that the loop lives; repeat unsent ones."""
        if self._unsent:
            self._send_surely(self._unsent)
        if self._ping_ns and now_ns >= self._next_ping_ns:
            self._next_ping_ns = now_ns + self._ping_ns
            self._send("WATCHDOG=1")

    def _send_surely(self, message: str) -> None:
        """Send a message that the manager waits for; ``ping`` repeats it if the queue is full."""
        self._unsent = None if self._send(message) else message

    def _send(self, message: str) -> bool:
        if self._socket is None:
            return True
        try:
            self._socket.sendto(message.encode(), self._address)
        except BlockingIOError:
            return False
        except OSError:  # the manager is gone; the next ping reaches it when it is back
            return True
        return True
