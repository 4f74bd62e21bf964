"""Promise 1, by the bytes of frames and the worst controller there can be."""

from collections.abc import Callable, Iterable

from canshaper.codec.frame import Frame
from tests.promises.world import every
from tests.promises.worst import Worst

Event = Callable[[Worst, int], None]
RUN, AFTER = 8, 5  # ticks


def flag(**values: int) -> Event:
    """Enable or emergency stop of the hand, or switches of the machine."""

    def event(world: Worst, k: int) -> None:
        for name, value in values.items():
            setattr(world, name, value)

    return event


def once(act: Callable[[Worst], None]) -> Event:
    return lambda world, k: act(world) if k == 0 else None


def joysticks(change: Callable[[Worst, Frame], Iterable[Frame]]) -> Event:
    """Frames of joysticks come otherwise."""

    def event(world: Worst, k: int) -> None:
        keys = {one.key for one in world.machine.joysticks.values()}
        world.change = lambda frame: change(world, frame) if frame[:3] in keys else [frame]

    return event


def shorter(world: Worst, frame: Frame) -> Iterable[Frame]:
    return [frame._replace(data=frame.data[:-1])]


def code(raw: int) -> Event:
    """Every velocity signal has a raw value so far from the end of its range."""

    def event(world: Worst, k: int) -> None:
        for axis in world.axes.values():
            signal = axis.signal
            value = signal.mask >> bool(signal.sign)
            world.raw.setdefault(axis.joystick.name, {})[signal.name] = value - raw

    return event


EVENTS: dict[str, Event] = {
    "enable released": flag(enable=0),
    "enable released for a tick": lambda world, k: setattr(world, "enable", int(k != 0)),
    "enable in error": flag(enable=2),
    "another switch off": lambda world, k: setattr(world, "agree", False),
    "emergency stop": flag(stop=1),
    "emergency stop for a tick": lambda world, k: setattr(world, "stop", int(k == 0)),
    "silence": joysticks(lambda world, frame: []),
    "wrong length": joysticks(shorter),
    "the last code": code(0),
    "the last but one": code(1),
    "second sender": once(Worst.second_sender),
    "failed send": once(Worst.send_failed),
    "stalled loop": once(Worst.stalled),
    "reload": once(Worst.reload),
}


@every
class TestNoMotionWithoutAnOperator:
    """**No motion without an operator.** A valve frame carries motion only in a moving state, which
    an axis enters only from READY; READY needs a fresh, valid, enabled joystick that was seen in
    neutral."""

    def world(self, name: str) -> Worst:
        """What moves is checked in each frame that leaves."""
        world = Worst(name)

        def judge(axis: str, before: float, now: float) -> None:
            seen = world.buses.axes[axis]
            asked = max(one.deflected for one in (seen, seen.partner or seen))
            way_back = seen.axis.tail + 1.0 / seen.axis.fall + 2
            assert not now or not seen.stopped_at_once(world.now_ns), f"{axis}: has to stop"
            assert not now or seen.neutral or seen.period <= seen.stop_until, f"{axis}: no neutral"
            assert not now or seen.period - asked <= way_back, f"{axis}: no demand"

        world.judge = judge
        return world

    def test_at_the_start(self, name: str) -> None:
        world = self.world(name)
        world.change = lambda frame: []
        world.go(10, **world.held(1.0))
        world.well()
        world.go(10, **world.held(1.0))
        world.enable = 0
        world.go(10)
        world.go(5, **world.held(1.0))
        world.enable = 1
        world.go(10, **world.held(1.0))
        assert not any(world.way.values())
        world.starts()

    def test_after_every_reason_to_stop(self, name: str) -> None:
        world = self.world(name)
        for event in EVENTS.values():
            world.starts()
            for k in range(RUN):
                event(world, k)
                world.step()
            world.well()
            world.go(AFTER, **world.held(1.0))
            world.go(AFTER)
            world.go(AFTER, **world.held(1.0))
