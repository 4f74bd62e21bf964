"""One tick between the buses and what reckons: the same for all that drives a machine."""

from collections.abc import Iterator, Mapping
from typing import Protocol

from canshaper.can.bus import Port
from canshaper.can.deployment import Deployment
from canshaper.can.frame import Frame

# After a standstill ports are asked so often until none has anything more: a port hands out 2000
# frames at a time, a queue holds more, and 100 000 is more than any.
MOST_ROUNDS = 50


class Reckons(Protocol):
    """Frames in, frames out: a ``Controller``, or what stands around one."""

    def receive(self, frame: Frame, now_ns: int) -> Frame | None:
        """Take a frame from a bus; what it leaves as on the other bus of a gateway, or None."""

    def stalled(self) -> None:
        """The loop stood still for too long: what comes before the next tick has waited."""

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """One tick: the frames to send now."""

    def send_failed(self, frame: Frame) -> None:
        """A frame did not reach its bus."""


def stall_ns(deployment: Deployment) -> int:
    """Longest standstill of the loop, in ns, after which an axis in motion may go on.

    After the shortest age limit of an input, what waits in the sockets must not look fresh; after
    the shortest timeout of a valve, that valve has closed, and would get full speed in one step.
    """
    limits = [lever.config.timeout_ms for lever in deployment.levers.values()]
    limits += [axis.config.valve.timeout_ms for axis in deployment.axes.values()]
    if deployment.emergency_stop:
        limits.append(deployment.emergency_stop.config.timeout_ms)
    return min(limits) * 1_000_000


def take(reckons: Reckons, ports: Mapping[str, Port], now_ns: int) -> int:
    """Take all waiting frames; those of a lever that pass a gateway leave at once.

    Returns:
        How many there were.
    """
    count = 0
    for port in ports.values():
        for frame in port.frames():
            count += 1
            passed = reckons.receive(frame, now_ns)
            if passed is not None and not ports[passed.bus].send(passed):
                reckons.send_failed(passed)
    return count


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
        reckons.stalled()
        for _ in range(MOST_ROUNDS):
            if not take(reckons, ports, now_ns):
                break
    else:
        take(reckons, ports, now_ns)
    for frame in reckons.tick(now_ns, missed):
        if not ports[frame.bus].send(frame):
            reckons.send_failed(frame)
    for port in ports.values():
        for frame in port.others():
            reckons.receive(frame, now_ns)
