"""One tick between the buses and a frame processor: the same for all that drives a machine."""

from collections.abc import Iterator, Mapping
from typing import Protocol

from canshaper.codec.frame import Frame
from canshaper.daemon.standstill import Standstill

# After a standstill ports are asked so often until none has anything more: a port hands out 2000
# frames at a time, a queue holds more, and 100 000 is more than any.
MOST_ROUNDS = 50


class FrameProcessor(Protocol):
    """Frames in, frames out: a ``Controller``, or what stands around one."""

    @property
    def moves(self) -> bool:
        """Whether the frame that was handed out last is one of a valve, and any moves."""

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        """A frame was received; what it leaves as on the other bus of a gateway, or None."""

    def stalled(self) -> None:
        """The loop stood still for too long: what comes before the next tick has waited."""

    def tick(self, now_ns: int, missed: int) -> Iterator[Frame]:
        """One tick: the frames to send now."""

    def send_failed(self, frame: Frame) -> None:
        """A frame did not reach its bus."""

    def withhold(self, frame: Frame) -> bool:
        """A valve frame comes too late: whether it moves one, and so must not leave."""


class FramePort(Protocol):
    """What a cycle needs of a bus, see ``Port``; or of what stands for one."""

    @property
    def arrived_ns(self) -> int:
        """When the frame arrived that ``frames`` has just handed out."""

    def frames(self) -> Iterator[Frame]:
        """Every frame that waits, in order."""

    def background(self) -> Iterator[Frame]:
        """What can wait until the valves have their commands."""

    def send(self, frame: Frame) -> bool:
        """Send now or not at all; whether the frame went out."""


def receive_waiting(
    processor: FrameProcessor, ports: Mapping[str, FramePort], now_ns: int, standstill: Standstill
) -> int:
    """Receive what waits; frames of a joystick that pass a gateway leave at once or not at all.

    Args:
        processor: what the frames are for.
        ports: the buses by name.
        now_ns: time by ``boottime_ns``; no frame is younger.
        standstill: until when a frame that moves a valve may leave.

    Returns:
        How many there were.
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
    """Receive all waiting frames, tick, send, then receive what can wait.

    A frame that moves a valve and was computed before the process was held up does not leave
    after that. Its tick is none that was made, so the next one sees how long the loop stood still.

    Args:
        processor: what the frames are for.
        ports: the buses by name.
        now_ns: time of this tick, by ``boottime_ns``.
        missed: deadlines missed since the last one.
        standstill: when the last tick was.
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
