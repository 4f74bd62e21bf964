"""The daemon's loop as a process of its own, on sockets that stand for the buses."""

import json
import select
import socket
from array import array
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from canshaper.bus.raw import RawPort
from canshaper.codec.frame import Frame, FrameFault, MessageKey
from canshaper.commissioning.doctor.processes import LOOP_PRIORITY, real_time, say_ready
from canshaper.config.bus import Bus
from canshaper.controller.controller import Controller
from canshaper.controller.events import StateEvent
from canshaper.controller.gated import GatedController
from canshaper.daemon.realtime import Collector, lock_memory, refuse_huge_pages
from canshaper.gate.cycle import Standstill, boottime_ns, io_cycle, run_at_deadlines
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment


class WatchedPort(RawPort):
    """A bus on one end of a socket pair; it counts received frames and reports sent ones.

    Args:
        name, config: of the bus, and its section.
        one: its end of the socket pair.
        on_fault: called with every fault of the bus.
        on_sent: called with every frame as soon as it was sent.
        fd: identifier, and whether it is extended, of what is sent in frames of CAN FD.

    Attributes:
        received: frames so far.
    """

    def __init__(
        self,
        name: str,
        config: Bus,
        one: socket.socket,
        on_fault: Callable[[FrameFault], None],
        on_sent: Callable[[Frame], None],
        *,
        fd: Iterable[tuple[int, bool]],
    ) -> None:
        self.received = 0
        self._on_sent = on_sent
        super().__init__(
            name, config, on_fault, None, fd, open_sockets=lambda *_: [one], has_echo=bool
        )

    def frames(self) -> Iterator[Frame]:
        """Yield every waiting frame, and count it."""
        for frame in super().frames():
            self.received += 1
            yield frame

    def send(self, frame: Frame) -> bool:
        """Send a frame at once or not at all; return whether it was sent."""
        sent = super().send(frame)
        if sent:
            self._on_sent(frame)
        return sent


class Loop:
    """The loop of the daemon, and the record of its ticks.

    Args:
        deployment: what is run.
        sockets: the loop's end of the socket pair of each bus, by its name.
        seconds: how long, from the first frame on.
    """

    def __init__(
        self, deployment: Deployment, sockets: dict[str, socket.socket], seconds: float
    ) -> None:
        self._controller = Controller(deployment)
        self._gated = GatedController(self._controller)
        faults = self._controller.counters.add
        buses, routes = deployment.config.buses, deployment.routing.buses
        self._ports = {
            name: WatchedPort(name, buses[name], one, faults, self._note, fd=routes[name].fd)
            for name, one in sockets.items()
        }
        self._valves: dict[MessageKey, list[int]] = {}
        for i, axis in enumerate(deployment.axes.values()):
            self._valves.setdefault(axis.valve.message.key, []).append(i)
        self._tick_ns = deployment.config.tick_ms * 1_000_000
        self._standstill = Standstill(deployment)
        self._seconds_ns = round(seconds * 1e9)
        self._until_ns = 0
        self._collector = Collector()
        # Arrays, not lists: the collector has nothing to look through in them.
        self._late, self._began, self._ended = array("q"), array("q"), array("q")
        self._received, self._sent = array("q"), array("q")
        self._missed = 0
        self._events: list[tuple[str, str, str]] = []
        self._moved: set[str] = set()

    def run(self) -> None:
        """Run as the daemon does, from the first frame of a joystick on; then close the buses."""
        self._collector.freeze()
        say_ready()
        select.select(list(self._ports.values()), [], [])
        self._until_ns = boottime_ns() + self._seconds_ns
        run_at_deadlines(self._tick_ns, self._body)
        for port in self._ports.values():
            port.close()

    def _body(self, now_ns: int, missed: int, late_ns: int) -> bool:
        io_cycle(self._gated, self._ports, now_ns, missed, self._standstill)
        self._housekeeping(now_ns)
        self._late.append(late_ns)
        self._began.append(now_ns)
        self._received.extend(port.received for port in self._ports.values())
        self._missed += missed
        self._ended.append(boottime_ns())
        return now_ns < self._until_ns

    def _note(self, frame: Frame) -> None:
        tick = len(self._late)
        for axis in self._valves.get(frame[:3], ()):
            self._sent.extend((tick, axis, boottime_ns()))

    def _housekeeping(self, now_ns: int) -> None:
        for event in self._controller.events:
            if isinstance(event, StateEvent):
                t = event.transition
                self._events.append((event.axis, t.new.name, t.reason.name))
        self._controller.events.clear()
        self._moved |= {
            n for n, control in self._controller.axes.items() if control.axis.output.steps
        }
        self._collector.pause(now_ns)

    def record(self) -> dict[str, Any]:
        """Return the record of the run, of which ``run_of`` makes a ``Run``; times in ns."""
        return {
            "late_ns": list(self._late),
            "began_ns": list(self._began),
            "ended_ns": list(self._ended),
            "received": list(self._received),
            "sent": list(self._sent),
            "missed": self._missed,
            "events": self._events,
            "moved": sorted(self._moved),
            "faults": {k: v for k, v in self._controller.counters.values.items() if v},
        }


def main(options: dict[str, Any]) -> None:
    """Run with the priority and memory of the service, where permitted; print the record."""
    deployment = load_deployment(Path(options["file"]))
    sockets = {name: socket.socket(fileno=fd) for name, fd in options["sockets"].items()}
    for one in sockets.values():
        one.setblocking(False)
    loop = Loop(deployment, sockets, options["seconds"])
    refuse_huge_pages()
    policy, memory = real_time(LOOP_PRIORITY), lock_memory()
    loop.run()
    print(json.dumps(loop.record() | {"policy": policy, "memory": memory}))
