"""One tick between the buses and what reckons: the same for all that drives a machine."""

from collections.abc import Iterator, Mapping
from typing import Protocol

from canshaper.can.binding import Deployment
from canshaper.can.bus import Port
from canshaper.can.frame import Frame


class Reckons(Protocol):
    """Frames in, frames out: a ``Controller``, or what stands around one."""

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take a frame from a bus."""

    def stalled(self) -> None:
        """The loop stood still for longer than any input may be old."""

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """One tick: the frames to send now."""

    def send_failed(self, frame: Frame) -> None:
        """A frame did not reach its bus."""


def stall_ns(deployment: Deployment) -> int:
    """Time after which what waits in the sockets must not look fresh: the shortest age limit."""
    inputs = [lever.config.timeout_ms for lever in deployment.levers.values()]
    if deployment.emergency_stop:
        inputs.append(deployment.emergency_stop.config.timeout_ms)
    return min(inputs) * 1_000_000


def exchange(
    reckons: Reckons, ports: Mapping[str, Port], now_ns: int, missed: int, *, stalled: bool
) -> None:
    """Take all waiting frames, tick, send, then take what can wait.

    Args:
        reckons: what the frames are for.
        ports: the buses by name.
        now_ns: monotonic time of this tick.
        missed: deadlines missed since the last one.
        stalled: that was longer than ``stall_ns``.
    """
    if stalled:
        for port in ports.values():
            for _ in port.frames():
                pass
        reckons.stalled()
    for port in ports.values():
        for frame in port.frames():
            reckons.receive(frame, now_ns)
    for frame in reckons.tick(now_ns, missed):
        if not ports[frame.bus].send(frame):
            reckons.send_failed(frame)
    for port in ports.values():
        for frame in port.others():
            reckons.receive(frame, now_ns)
