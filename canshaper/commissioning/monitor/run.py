"""Loops of the monitor: they listen to the buses, and draw or print."""

import time
from collections.abc import Callable

from rich.console import Console
from rich.live import Live

from canshaper.commissioning.monitor.state import Monitor
from canshaper.commissioning.monitor.view import (
    Keys,
    clock,
    pressed_keys,
    screen,
    status_line,
    waiting,
)
from canshaper.errors import BusError
from canshaper.machine.deployment import Deployment
from canshaper.recording.listen import Listener

# Time between two attempts to open a lost bus.
REOPEN_S = 1.0
GARBLED = "unreadable"
SECOND_NS = 1_000_000_000


class Ear:
    """Listener to the buses of a deployment; it opens a lost bus again.

    Raises:
        BusError: a bus cannot be opened at the start.
    """

    def __init__(self, deployment: Deployment, monitor: Monitor) -> None:
        self._buses = list(deployment.config.buses.items())
        self._monitor = monitor
        self._listener: Listener | None = Listener(self._buses)
        self._again_s = 0.0

    def listen(self, timeout_s: float) -> None:
        """Receive waiting frames, or try a lost bus again; wait for no longer than the timeout."""
        if self._listener is None:
            self._reopen(timeout_s)
            return
        try:
            for frame in self._listener.frames(timeout_s):
                self._monitor.receive(frame)
            if count := self._listener.errors.total():
                if not self._monitor.others[GARBLED]:
                    self._monitor.note(time.time_ns(), self._listener.last_error)
                self._monitor.others[GARBLED] = count
        except BusError as error:
            self._monitor.note(time.time_ns(), f"{error}; trying again")
            self.close()
            self._again_s = time.monotonic() + REOPEN_S

    def _reopen(self, timeout_s: float) -> None:
        if time.monotonic() < self._again_s:
            time.sleep(timeout_s)
            return
        try:
            self._listener = Listener(self._buses)
            self._monitor.note(time.time_ns(), "the buses are open again")
        except BusError:
            self._again_s = time.monotonic() + REOPEN_S

    def close(self) -> None:
        """Stop listening."""
        if self._listener is not None:
            self._listener.close()
            self._listener = None


def run_live(
    deployment: Deployment, console: Console, rate_hz: float, going: Callable[[], bool]
) -> None:
    """Draw the state of the machine until a person ends it.

    Args:
        deployment, console: the machine and the terminal.
        rate_hz, going: how often it is drawn, and whether to go on.

    Raises:
        BusError: a bus cannot be opened.
    """
    monitor = Monitor(deployment)
    ear = Ear(deployment, monitor)
    plain = not (console.encoding or "").lower().startswith("utf")
    pause_s = 1.0 / rate_hz
    keys = Keys([*deployment.axes])
    try:
        with pressed_keys() as can, Live(console=console, screen=True, auto_refresh=False) as live:
            due_s = time.monotonic()
            while going() and not keys.ended:
                ear.listen(max(0.0, due_s - time.monotonic()))
                if time.monotonic() < due_s:
                    continue
                due_s = time.monotonic() + pause_s
                paused = keys.paused
                keys.press(waiting() if can else "")
                if paused and keys.paused:
                    continue
                shown = keys if can else None
                picture = screen(monitor, time.time_ns(), *console.size, plain=plain, keys=shown)
                live.update(picture, refresh=True)
    finally:
        ear.close()


def run_plain(
    deployment: Deployment, write: Callable[[str], None], going: Callable[[], bool]
) -> None:
    """Write a line for every event, and one with the whole state every second.

    Raises:
        BusError: a bus cannot be opened.
    """
    monitor = Monitor(deployment)
    ear = Ear(deployment, monitor)
    due_ns = time.time_ns() + SECOND_NS
    try:
        while going():
            ear.listen(0.1)
            while monitor.events:
                event = monitor.events.popleft()
                write(f"{clock(event.time_ns)} {event.text}")
            now_ns = time.time_ns()
            if now_ns >= due_ns:
                due_ns = max(due_ns + SECOND_NS, now_ns)
                write(status_line(monitor, now_ns))
    finally:
        ear.close()
