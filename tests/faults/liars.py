"""Controllers that do one thing wrong, each around the real one: the judge has to catch them all.

They change what goes in or comes out, so they stay what they are however the controller is built.
"""

from collections.abc import Iterable
from typing import Any

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment
from tests.faults.inputs import Joystick
from tests.faults.machine import Machine


class Honest:
    """The real controller, with its machine as the files say."""

    def __init__(self, deployment: Deployment) -> None:
        self.machine = Machine("", deployment.path)
        self.real = Controller(deployment)

    def receive(self, frame: Frame, now_ns: int) -> None:
        self.real.receive(frame, now_ns)

    def tick(self, now_ns: int, missed: int = 0) -> Iterable[Frame]:
        yield from self.real.tick(now_ns, missed)
        self.real.events.clear()

    def stalled(self) -> None:
        self.real.stalled()

    def send_failed(self, frame: Frame) -> None:
        self.real.send_failed(frame)

    def neutral_frames(self) -> list[Frame]:
        return self.real.neutral_frames()

    def joystick(self, frame: Frame) -> Joystick | None:
        """The joystick whose frame this is."""
        source = self.machine.inputs.get(frame[:3])
        return source if isinstance(source, Joystick) and len(frame.data) == source.length else None

    def steps(self, frame: Frame, change: Any) -> Frame:
        """The frame with its command changed, if it is one of a valve."""
        axis = self.machine.valves.get(frame[:3])
        if axis is None:
            return frame
        word = int.from_bytes(frame.data, "little")
        raw = axis.valve.get(word)
        new = max(-axis.steps, min(axis.steps, change(raw, axis)))
        word += axis.valve.put(new) - axis.valve.put(raw)
        return frame._replace(data=word.to_bytes(len(frame.data), "little"))


class EnableForced(Honest):
    """Sees the enable switch on, always."""

    def receive(self, frame: Frame, now_ns: int) -> None:
        if (joystick := self.joystick(frame)) and joystick.checksum is None and joystick.enable:
            word = int.from_bytes(frame.data, "little")
            word += joystick.enable.put(1) - joystick.enable.put(joystick.enable.get(word))
            frame = frame._replace(data=word.to_bytes(joystick.length, "little"))
        super().receive(frame, now_ns)


class SilenceUnseen(Honest):
    """Takes the last frame of a silent joystick once more, with the next counter."""

    def __init__(self, deployment: Deployment) -> None:
        super().__init__(deployment)
        self._last: dict[str, Frame] = {}
        self._count = 0

    def receive(self, frame: Frame, now_ns: int) -> None:
        if (joystick := self.joystick(frame)) and joystick.counter and joystick.checksum is None:
            self._last[joystick.name] = frame
            return
        super().receive(frame, now_ns)

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        self._count += 1
        for frame in self._last.values():
            joystick = self.joystick(frame)
            assert joystick
            assert joystick.counter
            word = int.from_bytes(frame.data, "little")
            word += joystick.counter.put(self._count) - joystick.counter.put(
                joystick.counter.get(word)
            )
            super().receive(frame._replace(data=word.to_bytes(joystick.length, "little")), now_ns)
        return super().tick(now_ns, missed)


class StallUnseen(Honest):
    """Does not care that the loop stood still."""

    def stalled(self) -> None:
        pass


class SendFailureUnseen(Honest):
    """Counts frames that did not go out, and goes on."""

    def send_failed(self, frame: Frame) -> None:
        axis = self.machine.valves.get(frame[:3])
        self.real.send_failed(frame._replace(can_id=0x7F0) if axis else frame)


class SecondSenderUnseen(Honest):
    """Does not see others send its valve frames."""

    def receive(self, frame: Frame, now_ns: int) -> None:
        if frame[:3] not in self.machine.valves:
            super().receive(frame, now_ns)


class StopUnseen(Honest):
    """Hears the emergency stop and takes everything for free."""

    def receive(self, frame: Frame, now_ns: int) -> None:
        stop = self.machine.stop
        if stop and frame[:3] == stop.key and len(frame.data) == stop.length:
            assert stop.counter
            count = stop.counter.get(int.from_bytes(frame.data, "little"))
            frame = frame._replace(data=stop.data({stop.counter.name: count}))
        super().receive(frame, now_ns)


class OneTickLate(Honest):
    """Sends what it should have sent a tick ago."""

    def __init__(self, deployment: Deployment) -> None:
        super().__init__(deployment)
        self._last: dict[Any, int] = {}

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        def late(raw: int, axis: Any) -> int:
            before = self._last.get(axis.name, 0)
            self._last[axis.name] = raw
            return before

        return [self.steps(f, late) for f in super().tick(now_ns, missed)]


class LittleTooFast(Honest):
    """Two steps more than commanded, wherever something moves."""

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        def more(raw: int, _axis: Any) -> int:
            return raw + (2 if raw > 0 else -2) if raw else 0

        return [self.steps(f, more) for f in super().tick(now_ns, missed)]


class WrongWay(Honest):
    """Moves the other way."""

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        return [self.steps(f, lambda raw, _: -raw) for f in super().tick(now_ns, missed)]


class Creeps(Honest):
    """The smallest command instead of neutral, now and then."""

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        frames = list(super().tick(now_ns, missed))
        if now_ns // self.machine.tick_ns % 50 != 49:
            return frames
        return [
            self.steps(f, lambda raw, a: raw or round(a.steps * a.deadband) + 1) for f in frames
        ]


class CounterStands(Honest):
    """The alive counter of the valves stands still for a frame in a hundred."""

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        frames = list(super().tick(now_ns, missed))
        if now_ns // self.machine.tick_ns % 100 != 99:
            return frames
        return [f if f[:3] not in self.machine.valves else _count_back(f) for f in frames]


def _count_back(frame: Frame) -> Frame:
    return frame._replace(data=frame.data[:1] + bytes([(frame.data[1] - 1) % 256]))


class FrameLeftOut(Honest):
    """Leaves out a valve frame that says what the last one said, now and then."""

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        frames = list(super().tick(now_ns, missed))
        return frames[1:] if now_ns // self.machine.tick_ns % 60 == 59 else frames


class TripUntold(Honest):
    """Stops as it should and does not report that it has tripped."""

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        return [f for f in super().tick(now_ns, missed) if not self._trip(f)]

    def _trip(self, frame: Frame) -> bool:
        return frame[:3] in self.machine.statuses and frame.data[0] & 0xF == 5


class NeverBack(Honest):
    """Stays neutral for good once it has moved and stopped."""

    def __init__(self, deployment: Deployment) -> None:
        super().__init__(deployment)
        self._moved = self._over = False

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        frames = list(super().tick(now_ns, missed))
        valves = [f for f in frames if f[:3] in self.machine.valves]
        moves = any(f.data[0] for f in valves)
        self._over |= self._moved and not moves
        self._moved |= moves
        return [self.steps(f, lambda _, __: 0) for f in frames] if self._over else frames


class NotNeutralAtTheEnd(Honest):
    """Leaves the last valve as it is."""

    def neutral_frames(self) -> list[Frame]:
        frames = super().neutral_frames()
        return [*frames[:-1], self.steps(frames[-1], lambda *_: 10)]


LIARS = list(Honest.__subclasses__())
