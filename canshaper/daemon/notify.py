"""Messages to the service manager: sd_notify(3), whose protocol is one datagram of KEY=VALUE lines.

Without a service manager (no NOTIFY_SOCKET) nothing is sent.
"""

import os
import socket
import time
from collections.abc import Mapping

# Some adapters take seconds to open; then the loop does not run, with every axis in neutral.
RELOAD_US = 30_000_000


class ServiceManager:
    """The service manager that started us, if one did.

    Args:
        environment: where NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID are looked up.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket: socket.socket | None = None
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)  # a manager that hangs must not hold up the loop
        limit_us = int(environment.get("WATCHDOG_USEC") or 0)
        ours = environment.get("WATCHDOG_PID") in (None, "", str(os.getpid()))
        self._limit_us = limit_us if ours else 0
        # A quarter: two pings may come late or be lost before the manager acts.
        self._ping_ns = self._limit_us * 1000 // 4
        self._next_ping_ns = 0
        self._unsent: str | None = None

    def ready(self, status: str) -> None:
        """Report that the service is at work, or that the reload is over."""
        limit = f"\nWATCHDOG_USEC={self._limit_us}" if self._limit_us else ""
        self._send_surely(f"READY=1\nSTATUS={status}{limit}")

    @property
    def present(self) -> bool:
        """Whether there is one."""
        return self._socket is not None

    def waiting(self, status: str) -> None:
        """Report that the service waits for an adapter; its loop, watched more closely, comes."""
        limit = f"\nWATCHDOG=1\nWATCHDOG_USEC={RELOAD_US}" if self._limit_us else ""
        self._send(f"READY=1\nSTATUS={status}{limit}")

    def reloading(self) -> None:
        """Report that a reload is being applied, and the loop waits; ``ready`` ends it.

        Until then the watchdog has more patience. systemd ends this state after TimeoutStartSec, so
        waiting for neutral is no part of it.
        """
        limit = f"\nWATCHDOG_USEC={RELOAD_US}" if self._limit_us else ""
        self._send_surely(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}{limit}")

    def stopping(self) -> None:
        """Report that the service is about to end."""
        self._send("STOPPING=1")

    def status(self, text: str) -> None:
        """Report one line for people."""
        self._send(f"STATUS={text}")

    def ping(self, now_ns: int) -> None:
        """Report that the control loop is alive, no more often than the watchdog needs it."""
        if self._unsent:
            self._send_surely(self._unsent)
        if self._ping_ns and now_ns >= self._next_ping_ns:
            self._next_ping_ns = now_ns + self._ping_ns
            self._send("WATCHDOG=1")

    def _send_surely(self, message: str) -> None:
        """Send again with the next pings while the manager's queue is full: it waits for this."""
        self._unsent = None if self._send(message) else message

    def _send(self, message: str) -> bool:
        if self._socket is None:
            return True
        try:
            self._socket.sendto(message.encode(), self._address)
        except BlockingIOError:
            return False
        except OSError:  # the manager is gone; it will find us when it is back
            return True
        return True
