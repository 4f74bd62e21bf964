"""Promise 2, by the bytes of frames: the worst controller there can be, and the sound one."""

import math
import random
from collections.abc import Iterator

from tests.faults.axis import Axis
from tests.promises.world import REST, World, every
from tests.promises.worst import Worst

STICKS = (1.0, 0.0, -1.0, 0.5, -0.05, 0.02, -0.02, 0.03)


def rounding(axis: Axis) -> float:
    return 1.5 * axis.step + 1e-6


def tail(axis: Axis) -> int:
    """Periods for which a demand counts; in a motion also its partner's, and one more."""
    partner = axis.moves_with
    return max(axis.tail, partner.tail if partner else 0) + bool(partner or axis.slews)


def run_on(axis: Axis) -> int:
    """Periods from the last demand to rest, at most."""
    return tail(axis) + math.ceil(1.0 / axis.fall) + (axis.moves_with is None)


@every
class TestNeutralStops:
    """**A joystick in neutral stops its axis** within a bounded run-on: after `tail_s` at the
    latest, and within `stop_distance_m` where the file has it, the output falls to zero, by
    `fall_per_s` or faster. For `tail_s` after anti-sway was switched on in motion, or after a trip
    or the end of a stop cut a motion off, there is no run-on. A `motion` has its own bounds."""

    def judged(self, world: World) -> World:
        """After the tail each frame is lower by the fall, and from its end on there is none.

        Of the worst controller the fall counts beyond the distance, of a sound one within it.
        """
        ran = dict.fromkeys(world.axes, 0.0)

        def judge(axis: str, before: float, now: float) -> None:
            seen = world.buses.axes[axis]
            of = seen.axis
            held = seen.demand if now > 0.0 else -seen.demand
            beyond = abs(now) - max(held, 0.0) - of.largest_added
            if beyond > 0.0:
                ran[axis] += beyond * of.tick_s * of.period_ticks
                falling = 0.5 * of.tick_s * of.period_ticks / of.fall
                most = of.run_on + falling * isinstance(world, Worst)
                assert ran[axis] <= most + 0.03, f"{axis}: {ran[axis]:.3f} of {most:.3f}"
            elif seen.demand:
                ran[axis] = 0.0
            last = max(one.deflected for one in (seen, seen.partner or seen))
            since = seen.period - last
            if now and since > tail(of):
                assert since <= run_on(of), f"{axis}: after the run-on"
                least = abs(before) - of.fall + rounding(of)
                assert abs(now) <= least and now * before > 0, f"{axis}: does not fall"

        world.judge = judge
        return world

    def test_whatever_a_controller_sends(self, name: str) -> None:
        """Held, tapped, turned round, just outside neutral, in a bypass; then in neutral."""
        world = Worst(name)
        self.judged(world)
        longest = max(run_on(one) * one.period_ticks for one in world.axes.values())
        for taps in ((40, 0.0), (4, 0.0), (6, 0.02), (30, -0.02)):
            world.starts()
            world.go(taps[0], **world.held(1.0))
            world.go(longest // 2, **world.held(taps[1]))
            world.sign = {axis: -sign for axis, sign in world.sign.items()}
            world.go(longest // 2 + 5)
            assert not any(world.speed.values())
            world.go(10)
            world.sign = {axis: -sign for axis, sign in world.sign.items()}

    def test_of_the_sound_controller(self, name: str) -> None:
        """Any strokes: no frame is refused, and after the run-on it rests."""
        world = self.judged(World(name))
        rng = random.Random(name)
        world.go(REST)
        for _ in range(8):
            world.go(rng.randint(2, 25), **{axis: rng.choice(STICKS) for axis in world.axes})
        assert any(world.way.values())
        world.go(max(run_on(one) * one.period_ticks for one in world.axes.values()) + 7)
        assert not any(world.speed.values())
        assert not world.refusals()

    def test_no_run_on_after_anti_sway_was_switched_on(self, name: str) -> None:
        world = World(name)
        off = {j.name: {j.off.name: 1} for j in world.machine.joysticks.values() if j.off}
        world.go(REST)
        world.raw = off
        world.go(20, **world.held(1.0))
        world.raw = {}
        assert any(world.speed.values())
        world.go(world.machine.gateway)  # whose frames are a tick old
        for _ in self.falling(world):
            world.go(1)

    def test_no_run_on_after_a_trip(self, name: str) -> None:
        """Reset at once, and touched: what was cut off is not run later."""
        world = World(name)
        world.go(REST)
        world.go(30, **world.held(1.0))
        world.enable = 0
        world.go(2)
        assert not any(world.speed.values())
        world.enable = 1
        world.go(3)
        assert not any(world.speed.values())
        world.way = dict.fromkeys(world.axes, 0.0)
        for _ in self.falling(world, asked=0.1):
            world.go(1, **world.held(0.1))
        assert any(world.way.values())

    def falling(self, world: World, asked: float = 0.0) -> Iterator[int]:
        """Ticks of a tail, with an output no faster than asked; but for what a motion adds."""

        def judge(axis: str, before: float, now: float) -> None:
            of = world.axes[axis]
            if not of.moves_with and of.joystick.off:
                least = max(asked, abs(before) - of.fall) + rounding(of)
                assert abs(now) <= least, f"{axis}: runs on"

        world.judge = judge
        yield from range(max(one.tail * one.period_ticks for one in world.axes.values()) + 5)
        assert not world.refusals()
