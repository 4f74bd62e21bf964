"""The daemon's loop as a process of its own, on sockets that stand for the buses."""

import json
import select
import socket
import time
from array import array
from pathlib import Path
from typing import Any

from canshaper.can.binding import load_deployment
from canshaper.can.deployment import Deployment
from canshaper.can.frame import Frame
from canshaper.can.raw import RawPort
from canshaper.doctor.processes import LOOP_PRIORITY, real_time, say_ready
from canshaper.service.controller import Controller
from canshaper.service.events import Event
from canshaper.service.exchange import stall_ns
from canshaper.service.loop import run_at_deadlines
from canshaper.service.realtime import Collector, lock_memory


class Loop:
    """One tick as in the daemon: take all that waits, tick, send; and what happened when.

    Args:
        deployment: what is run.
        sockets: one end of a bus, by its name.
        seconds: how long.
    """

    def __init__(
        self, deployment: Deployment, sockets: dict[str, socket.socket], seconds: float
    ) -> None:
        self._controller = Controller(deployment)
        self._ports = {
            name: RawPort(
                name,
                lambda _ids, one=one: [one],  # type: ignore[misc]
                None,
                self._controller.counters.add,
                confirms=False,
            )
            for name, one in sockets.items()
        }
        self._valves: dict[tuple[str, int, bool], list[int]] = {}
        for i, axis in enumerate(deployment.axes.values()):
            self._valves.setdefault(axis.valve.message.sender.key, []).append(i)
        self._tick_ns = deployment.config.tick_ms * 1_000_000
        self._stall_ns = stall_ns(deployment)
        self._seconds_ns = round(seconds * 1e9)
        self._until_ns = 0
        self._collector = Collector()
        # Arrays, not lists: the collector has nothing to look through in them.
        self._late, self._began, self._ended = array("q"), array("q"), array("q")
        self._taken, self._sent = array("q"), array("q")
        self._frames = dict.fromkeys(sockets, 0)
        self._missed = 0
        self._events: list[tuple[str, str, str]] = []
        self._moved: set[str] = set()

    def run(self) -> None:
        """Run, as the daemon does, once the first frame of a lever is there."""
        self._collector.freeze()
        say_ready()
        select.select(list(self._ports.values()), [], [])
        self._until_ns = time.monotonic_ns() + self._seconds_ns
        run_at_deadlines(self._tick_ns, self._body)
        for port in self._ports.values():
            port.close()

    def _body(self, now_ns: int, missed: int, late_ns: int) -> bool:
        controller, ports = self._controller, self._ports
        if missed * self._tick_ns > self._stall_ns:
            for name, port in ports.items():
                self._frames[name] += sum(1 for _ in port.frames())
            controller.stalled()
        for name, port in ports.items():
            for frame in port.frames():
                self._frames[name] += 1
                if (passed := controller.receive(frame, now_ns)) is not None:
                    self._send(passed)
        for frame in controller.tick(now_ns, missed):
            self._send(frame)
        self._housekeeping(now_ns)
        self._late.append(late_ns)
        self._began.append(now_ns)
        self._taken.extend(self._frames.values())
        self._missed += missed
        self._ended.append(time.monotonic_ns())
        return now_ns < self._until_ns

    def _send(self, frame: Frame) -> None:
        if not self._ports[frame.bus].send(frame):
            self._controller.send_failed(frame)
            return
        tick = len(self._late)
        for axis in self._valves.get(frame[:3], ()):
            self._sent.extend((tick, axis, time.monotonic_ns()))

    def _housekeeping(self, now_ns: int) -> None:
        for event in self._controller.events:
            if isinstance(event, Event):
                t = event.transition
                self._events.append((event.axis, t.new.name, t.reason.name))
        self._controller.events.clear()
        self._moved |= {n for n, runner in self._controller.axes.items() if runner.axis.raw}
        self._collector.pause(now_ns)

    def record(self) -> dict[str, Any]:
        """What happened: the fields of ``Record``."""
        return {
            "late_ns": list(self._late),
            "began_ns": list(self._began),
            "ended_ns": list(self._ended),
            "taken": list(self._taken),
            "sent": list(self._sent),
            "missed": self._missed,
            "events": self._events,
            "moved": sorted(self._moved),
            "faults": {k: v for k, v in self._controller.counters.values.items() if v},
        }


def main(options: dict[str, Any]) -> None:
    """Run it as the service's unit would, as far as that is permitted; print the record."""
    deployment = load_deployment(Path(options["file"]))
    sockets = {name: socket.socket(fileno=fd) for name, fd in options["sockets"].items()}
    for one in sockets.values():
        one.setblocking(False)
    loop = Loop(deployment, sockets, options["seconds"])
    policy, memory = real_time(LOOP_PRIORITY), lock_memory()
    loop.run()
    print(json.dumps(loop.record() | {"policy": policy, "memory": memory}))
