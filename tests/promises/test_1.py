"""Promise 1, by the bytes of frames and the worst controller there can be."""

from tests.promises.events import Event, code, counter_stands, flag, once, shorter, silence, without
from tests.promises.world import HOUR_NS, World, every
from tests.promises.worst import Worst


def pressed_meanwhile(world: World) -> None:
    """Enable is released and pressed in frames that wait while the loop stands."""
    world.stalled()
    sticks, world.stick = world.stick, {}
    for world.enable in (0, 0, 1, 1):
        for name in world.machine.joysticks:
            world.receive(world.joystick(name))
    world.stick = sticks


RUN, AFTER = 8, 5  # ticks

EVENTS: dict[str, Event] = {
    "enable released": flag(enable=0),
    "enable released for a tick": lambda world, k: setattr(world, "enable", int(k != 0)),
    "enable in error": flag(enable=2),
    "another switch off": lambda world, k: setattr(world, "agree", False),
    "emergency stop": flag(stop=1),
    "emergency stop for a tick": lambda world, k: setattr(world, "stop", int(k == 0)),
    "silence": silence,
    "silence of switches": without(lambda world: [one.key for one in world.machine.switches]),
    "stamps of an hour ago": flag(age_ns=HOUR_NS),
    "wrong length": shorter,
    "counter stands": counter_stands,
    "a code of the DBC": code(0),
    "beyond the range": code(-1),
    "second sender": once(World.second_sender),
    "failed send": once(World.send_failed),
    "stalled loop": once(World.stalled),
    "stalled loop, and pressed meanwhile": once(pressed_meanwhile),
    "reload": once(lambda world: world.reload()),
}


@every
class TestNoMotionWithoutAnOperator:
    """**No motion without an operator.** An axis moves only from READY, and READY needs a fresh,
    valid, enabled joystick that was seen in neutral."""

    def world(self, name: str) -> Worst:
        """Make a world that checks every moving axis in each frame that leaves."""
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
