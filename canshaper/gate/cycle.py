"""A loop at its deadlines, its tick between buses and controller, and the check for standstill."""

import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:  # for the checker of types only: nothing of it is loaded with the gate
    from canshaper.codec.frame import Frame
    from canshaper.machine.deployment import Deployment

# Time since the machine was booted, ns. No one can set it, and unlike CLOCK_MONOTONIC it goes on
# while the machine is suspended: an age, and a standstill of the loop, includes that time. Other
# systems than Linux only simulate a machine, and there any clock that runs forward serves.
boottime_ns: Callable[[], int] = (
    partial(time.clock_gettime_ns, time.CLOCK_BOOTTIME)
    if hasattr(time, "CLOCK_BOOTTIME")
    else time.monotonic_ns
)


def run_at_deadlines(
    period_ns: int,
    body: Callable[[int, int, int], bool],
    wait: Callable[[float], None] | None = None,
    steer: Callable[[int], int] | None = None,
) -> None:
    """Call ``body`` at every deadline until it returns False.

    A deadline is fixed before the sleep that ends at it, so lateness does not add up. Deadlines
    that have passed are counted and skipped, never caught up in a burst.

    Args:
        period_ns: time between two deadlines, ns.
        body: called with the time by ``boottime_ns``, the number of deadlines missed since its
            last call, and its lateness: ns after the first deadline that it was not called for.
        wait: waits so many seconds; by default it sleeps.
        steer: called after each call of ``body`` with the time of the next deadline; returns by how
            many ns to move that deadline, which is much less than a period.
    """
    clock = boottime_ns
    deadline = now = clock()
    while True:
        late = now - deadline
        missed = late // period_ns if late > 0 else 0
        deadline += missed * period_ns
        if not body(now, missed, late):
            return
        deadline += period_ns
        if steer:
            deadline += steer(deadline)
        left = deadline - clock()
        if left > 0:
            (wait or time.sleep)(left / 1e9)
        now = clock()


# A frame may leave so late after it was computed, if a tick is shorter: a program that is held up
# for some milliseconds now and then continues.
LEAST_LEAVE_NS = 10_000_000
NEVER_NS = 1 << 63  # later than any time of a clock


def longest_gap_ns(deployment: "Deployment") -> int:
    """Return the longest time between two ticks, in ns, after which an axis may continue to move.

    After the shortest age limit of an input, frames that wait in the sockets must not look fresh.
    After the shortest timeout of a valve, that valve has closed, and would get full speed in one
    step. A valve with a frame in every n-th tick may have waited n - 1 ticks before.
    """
    tick_ms = deployment.config.tick_ms
    limits = [one.config.timeout_ms for one in deployment.stopping_inputs]
    limits += [
        axis.config.valve.timeout_ms - (axis.period_ticks - 1) * tick_ms
        for axis in deployment.axes.values()
    ]
    gap_ms: int = min(limits)
    return gap_ms * 1_000_000


class Standstill:
    """Finds whether a loop stood still too long since its last tick, or that before a reload."""

    def __init__(self, deployment: "Deployment", before: "Standstill | None" = None) -> None:
        # The time when a frame is about to leave; a test may replace it.
        self.clock: Callable[[], int] = boottime_ns
        self.limit_ns = longest_gap_ns(deployment)
        # Time of the last tick that counts as run: all its frames were sent in time.
        self.last_ns: int = before.last_ns if before else NEVER_NS
        self.until_ns = 0  # frames of the present tick may leave until then
        self._leave_ns = max(deployment.config.tick_ms * 1_000_000, LEAST_LEAVE_NS)

    def late(self) -> bool:
        """Return whether it is too late for a frame that was computed in this tick to leave."""
        return self.clock() > self.until_ns

    def over(self, now_ns: int) -> bool:
        """Begin a tick at ``now_ns``; return whether the loop stood still for too long before."""
        latest_ns = self.last_ns + self.limit_ns
        self.until_ns = min(latest_ns, now_ns + self._leave_ns)
        return now_ns > latest_ns


# Most rounds in which ports are read after a standstill, until none has more frames: a port hands
# out 2000 frames at a time, its queue holds more, but no queue holds 100 000.
MOST_ROUNDS = 50


class FrameProcessor(Protocol):
    """Takes frames and yields frames to send: an object with the gate in it.

    A ``GatedController``, or one that hands on its frames (``Recorder``, a measurement's drive). A
    ``Controller`` would fit the type too, but its frames have passed no gate.
    """

    @property
    def moves(self) -> bool:
        """Whether the frame handed out last is a valve's, and an axis run in its tick moves."""

    def receive(self, frame: "Frame", arrived_ns: int) -> "Frame | None":
        """Receive a frame; return the frame for the other bus of a gateway, or None."""

    def stalled(self) -> None:
        """Take note that the loop stood still: frames up to the next tick have waited."""

    def tick(self, now_ns: int, missed: int) -> "Iterator[Frame]":
        """Run one tick, and yield the frames to send now."""

    def send_failed(self, frame: "Frame") -> None:
        """Take note that a frame did not reach its bus."""

    def withhold(self, frame: "Frame") -> bool:
        """Return whether a late valve frame moves a valve, and so must not leave."""


class FramePort(Protocol):
    """A bus as a cycle uses it: a ``Port``, or a substitute."""

    @property
    def arrived_ns(self) -> int:
        """Arrival of the frame that ``frames`` has just handed out."""

    def frames(self) -> "Iterator[Frame]":
        """Yield every frame that waits, in order."""

    def background(self) -> "Iterator[Frame]":
        """Yield frames that can wait until the valves have their commands."""

    def send(self, frame: "Frame") -> bool:
        """Send a frame now or not at all; return whether it was sent."""


def receive_waiting(
    processor: FrameProcessor, ports: Mapping[str, FramePort], now_ns: int, standstill: Standstill
) -> int:
    """Receive all waiting frames, and return how many there were.

    An arrival after ``now_ns`` counts as one at ``now_ns``. A joystick's frame that passes a
    gateway leaves at once or not at all.
    """
    count = 0
    for port in ports.values():
        for frame in port.frames():
            count += 1
            arrived_ns = port.arrived_ns
            passed = processor.receive(frame, arrived_ns if arrived_ns < now_ns else now_ns)
            if passed is None:
                continue
            if processor.moves and standstill.late() and processor.withhold(passed):
                continue
            if not ports[passed.bus].send(passed):
                processor.send_failed(passed)
    return count


def io_cycle(
    processor: FrameProcessor,
    ports: Mapping[str, FramePort],
    now_ns: int,
    missed: int,
    standstill: Standstill,
) -> None:
    """Receive all waiting frames, run the tick, send its frames, then receive background frames.

    A frame that moves a valve, and was computed before the process was held up, does not leave
    afterwards. Its tick does not count as run, so the next one sees how long the loop stood still.
    ``now_ns`` is the time of this tick by ``boottime_ns``; ``missed`` counts from the last tick.
    """
    if standstill.over(now_ns):
        processor.stalled()
        for _ in range(MOST_ROUNDS):
            if not receive_waiting(processor, ports, now_ns, standstill):
                break
    else:
        receive_waiting(processor, ports, now_ns, standstill)
    made_ns = now_ns
    for frame in processor.tick(now_ns, missed):
        if processor.moves and standstill.late() and processor.withhold(frame):
            made_ns = standstill.last_ns
        elif not ports[frame.bus].send(frame):
            processor.send_failed(frame)
    standstill.last_ns = made_ns
    for port in ports.values():
        for frame in port.background():
            processor.receive(frame, now_ns)
