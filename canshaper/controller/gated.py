"""Controller behind its gate, as every loop drives it, with sockets or without."""

from collections.abc import Iterator, Mapping

from canshaper.codec.frame import Frame, FrameFault, MessageKey
from canshaper.controller.controller import Controller
from canshaper.controller.events import DisagreementEvent, RefusalEvent
from canshaper.gate.build import record_of
from canshaper.gate.fields import EPSILON
from canshaper.gate.gate import Gate
from canshaper.gate.received import Received

# A refusal, or a disagreement of decoders, that repeats is logged once in this time.
QUIET_NS = 1_000_000_000


class GatedController:
    """Controller behind its gate: hands out only frames that the gate lets leave.

    Args:
        controller: controller that computes the frames.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._gate = Gate(record_of(controller.deployment))
        self._quiet_until_ns: dict[MessageKey, int] = {}

    def carry_over(self, before: "GatedController") -> None:
        """Continue the gate's state before a reload; the caller carries the controller's over."""
        buses = self._controller.deployment.config.buses
        open_before = before._controller.deployment.config.buses.values()
        reopened = frozenset(name for name, bus in buses.items() if bus not in open_before)
        self._gate.carry_over(before._gate, reopened)

    def receive(self, frame: Frame, now_ns: int) -> Frame | None:
        """Give a frame to gate and controller; return the one for the other bus of a gateway."""
        message = self._gate.receive(frame[:3], frame[3], now_ns)
        passed = self._controller.receive(frame, now_ns)
        if message is not None and message.of.protection.known:
            self._compare(message, frame, now_ns)
        if passed is None:
            return None
        why = self._gate.leaving(passed[:3], passed[3], frame[3])
        return self._instead(passed, why, now_ns, frame[3]) if why else passed

    def demand(self, axis: str, part: float) -> None:
        """Set a measurement's demand, [-1, 1] of full command, in place of the joystick's."""
        self._gate.measure(axis, part)

    @property
    def moves(self) -> bool:
        """Whether the frame that was handed out last may move a valve."""
        return self._controller.moves

    def stalled(self) -> None:
        """Take note that the loop stood still: frames up to the next tick have waited."""
        self._gate.stalled()
        self._controller.stalled()

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """Run one tick; yield the frames to send now, neutral in place of refused valve frames."""
        self._gate.tick(now_ns, missed)
        leaving = self._gate.leaving
        for frame in self._controller.tick(now_ns, missed):
            why = leaving(frame[:3], frame[3])
            if not why:
                yield frame
            elif (neutral := self._instead(frame, why, now_ns, None)) is not None:
                yield neutral

    def passes(self, frame: Frame, now_ns: int) -> bool:
        """Return whether a frame that no tick has made may leave; log a refusal."""
        why = self._gate.leaving(frame[:3], frame[3])
        if why and self._loud(frame, now_ns):
            self._controller.events.append(RefusalEvent(frame, why))
        return not why

    def set(self, values: Mapping[str, object]) -> None:
        """Give the gate the numbers that ``Adjuster`` has changed, by their keys."""
        for key, value in values.items():
            self._gate.set(key, float(value))  # type: ignore[arg-type]

    def send_failed(self, frame: Frame) -> None:
        """Take note that a frame did not reach its bus."""
        self._gate.send_failed(frame[:3])
        self._controller.send_failed(frame)

    def withhold(self, frame: Frame) -> bool:
        """Return whether a late frame moves a valve and must not leave; if so, reuse its count."""
        withheld = self._controller.withhold(frame)
        if withheld:
            self._gate.withheld(frame[:3])
        return withheld

    def neutral_frames(self) -> list[Frame]:
        """Return the neutral frames to send last; log those that the gate refuses."""
        passed = []
        for frame in self._controller.neutral_frames():
            if why := self._gate.last(frame[:3], frame[3]):
                self._controller.events.append(RefusalEvent(frame, why))
            else:
                passed.append(frame)
        return passed

    def _compare(self, message: Received, frame: Frame, now_ns: int) -> None:
        """Stop axes whose demands differ by gate and codec; all, if only one accepts the frame."""
        joystick, axes = self._controller.joysticks[message.of.name], message.axes
        wrong = axes if message.good_ns != joystick.received_ns else []
        if not wrong and message.good_ns == now_ns:
            for axis in axes:
                command = joystick.commands[axis.of.signal]
                if command != axis.demand and not _same(axis.demand, command):
                    wrong = [*wrong, axis]
        if wrong:
            self._gate.disagrees(wrong)
            self._controller.counters.add(FrameFault.DECODERS_DISAGREE)
            if self._loud(frame, now_ns):
                event = DisagreementEvent(frame, wrong[0].of.name)
                self._controller.events.append(event)

    def _loud(self, frame: Frame, now_ns: int) -> bool:
        """Return whether an event of this message is logged: at most one in ``QUIET_NS``."""
        key = frame[:3]
        loud = now_ns >= self._quiet_until_ns.get(key, 0)
        if loud:
            self._quiet_until_ns[key] = now_ns + QUIET_NS
        return loud

    def _instead(self, frame: Frame, why: str, now_ns: int, of: bytes | None) -> Frame | None:
        """Stop the axes of a refused frame; return a neutral one in its place.

        It is None where the frame is no valve's, or the neutral one is refused too.

        Args:
            frame: the refused frame.
            why: why the gate refuses it.
            now_ns: monotonic time.
            of: data of the joystick's frame that a gateway was to pass on; None for a tick's frame.
        """
        if self._loud(frame, now_ns):
            self._controller.events.append(RefusalEvent(frame, why))
        key = frame[:3]
        if key not in self._gate.valves:
            return None
        self._gate.refused(key)
        if of is not None:
            frame = frame._replace(data=of)
        neutral = self._controller.refused(frame)
        if not self._gate.leaving(key, neutral[3], of):
            return neutral
        self._controller.valves.take_back(key)
        return None


def _same(demand: float | None, command: object) -> bool:
    """Return whether both decoders found the same demand, or both found none."""
    if not isinstance(command, float) or demand is None:
        return not isinstance(command, float) and demand is None
    return abs(demand - command) <= EPSILON
