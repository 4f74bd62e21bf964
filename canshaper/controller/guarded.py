"""A controller behind the output guard: what every loop drives, with sockets or without."""

from collections.abc import Iterator

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.events import RefusalEvent
from canshaper.guard.output import OutputGuard

# A valve whose frames are refused one after the other is logged once in this time.
QUIET_NS = 1_000_000_000


class Guarded:
    """Hands frames in to controller and guard, and out what both let pass.

    Args:
        controller: what computes the frames.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._guard = OutputGuard(controller.deployment)
        self._inputs, self._valves = self._guard.inputs, self._guard.valves
        self._quiet_until_ns: dict[tuple[str, int, bool], int] = {}

    def receive(self, frame: Frame, now_ns: int) -> Frame | None:
        """Take a frame from a bus; see ``Controller``. What it says binds the next frame out."""
        entry = self._inputs.get(frame[:3])
        if entry is not None:
            entry.note(frame[3], now_ns)
        else:
            self._guard.note(frame, now_ns)
        passed = self._controller.receive(frame, now_ns)
        if passed is None:
            return None
        why = self._refusal(passed, now_ns)
        return self._instead(passed, why, now_ns) if why else passed

    def demand(self, axis: str, part: float, now_ns: int) -> None:
        """Take a demand of a measurement in the place of a joystick; see ``GuardedAxis``."""
        self._guard.axes[axis].demand(part, now_ns)

    @property
    def moves(self) -> bool:
        """Whether the frame that was handed out last may move a valve."""
        return self._controller.moves

    def stalled(self) -> None:
        """The loop stood still for too long: what comes before the next tick has waited."""
        self._guard.stalled()
        self._controller.stalled()

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """One tick: the frames to send now; see ``Controller``."""
        valve_of, at = self._valves.get, self._guard.begin(missed)
        for frame in self._controller.tick(now_ns, missed):
            valve = valve_of(frame[:3])
            if valve is None:
                yield frame
                continue
            data = frame[3]
            part = data[valve.span]
            if part == valve.part and now_ns < valve.valid_until_ns:
                valve.at = at  # the same command as before, and nothing forbids it since
                yield frame
            elif not (why := valve.refusal(data, part, now_ns, at)):
                yield frame
            elif (neutral := self._instead(frame, why, now_ns)) is not None:
                yield neutral

    def send_failed(self, frame: Frame) -> None:
        """A frame did not reach its bus."""
        self._controller.send_failed(frame)

    def withhold(self, frame: Frame) -> bool:
        """A valve frame comes too late: whether it moves one, and so must not leave."""
        return self._controller.withhold(frame)

    def neutral_frames(self) -> list[Frame]:
        """A neutral frame for every valve: the last thing sent."""
        frames = self._controller.neutral_frames()
        return [frame for frame in frames if not self._moves(frame)]

    def _moves(self, frame: Frame) -> bool:
        valve = self._valves.get(frame[:3])
        return valve is not None and valve.moves(frame.data)

    def _refusal(self, frame: Frame, now_ns: int) -> str:
        valve, data = self._valves[frame[:3]], frame.data
        return valve.refusal(data, data[valve.span], now_ns, self._guard.at)

    def _instead(self, frame: Frame, why: str, now_ns: int) -> Frame | None:
        """Neutral in the place of a frame that is refused; silence where even that moves."""
        if now_ns >= self._quiet_until_ns.get(frame[:3], 0):
            self._quiet_until_ns[frame[:3]] = now_ns + QUIET_NS
            self._controller.events.append(RefusalEvent(frame, why))
        neutral = self._controller.refused(frame)
        return None if self._refusal(neutral, now_ns) else neutral
