"""Promise 3, by the bytes of frames and the worst controller there can be."""

from collections.abc import Mapping

import pytest

from tests.promises.test_2 import rounding
from tests.promises.world import World, every
from tests.promises.worst import Worst

# Sticks one after another, by the side to which their axis is sent, and for how many ticks.
STROKES = (
    (0.3, 12), (0.8, 25), (0.1, 30), (-0.6, 25), (-0.02, 12), (0.0, 5), (1.0, 8), (0.0, 45),
    (-1.0, 12), (0.0, 3), (0.05, 20),
)  # fmt: skip


@every
class TestNeverFaster:
    """**Never faster than commanded** within the tail, and never against the joystick, but for what
    the file states: with `motion` one axis adds a bounded velocity to another one, whose joystick
    may be in neutral; with `reversal: brake_shaped` the output runs on for up to `reversal_s` after
    a reversal; `allow_faster` and `allow_reverse` lift these bounds."""

    def world(self, name: str) -> Worst:
        world = Worst(name)

        def judge(axis: str, before: float, now: float) -> None:
            seen = world.buses.axes[axis]
            of, sign = seen.axis, 1.0 if now > 0.0 else -1.0
            reach, held = max(seen.most(sign), 0.0), sign * seen.demand
            in_time = seen.period - seen.crossed < of.reversal
            if held < 0.0 and not in_time and seen.period > seen.stop_until:
                reach = 0.0
            if held >= 0.0 and seen.partner and (seen.partner.deflected > 0 or reach):
                reach = max(reach, of.largest_added)
            if now * before > 0.0:  # on its way back
                reach = max(reach, abs(before) - of.fall)
            reach = min(reach, max(of.maximum, abs(before) - of.fall))
            assert abs(now) <= reach + rounding(of), f"{axis}: {now:.3f} of {reach:.3f}"

        world.judge = judge
        return world

    def strokes(self, world: Worst, axes: Mapping[str, int]) -> None:
        for size, ticks in STROKES:
            world.go(ticks, **{axis: size * sign for axis, sign in axes.items()})

    def test_every_stick(self, name: str) -> None:
        world = self.world(name)
        world.starts()
        self.strokes(world, world.sign)

    def test_one_stick_moves_one_axis(self, name: str) -> None:
        """And its partner in a motion, by as much and as far as the file says, never against."""
        axes = [*World(name).axes]
        for axis in axes[:: len(axes) - 1]:
            world = self.world(name)
            world.go(5)
            others = {one: 0.0 for one in world.axes if one != axis}
            world.go(40, **{axis: world.sign[axis] * 0.8})
            assert world.way[axis]
            partner = world.axes[axis].moves_with
            for one in others:
                added = partner is not None and one == partner.name
                of = world.axes[one]
                assert world.way[one] <= added * of.largest_added * 42 * of.tick_s, one
            if partner:  # against its own stick nothing is added, once it has fallen
                sign = world.sign[partner.name]
                world.go(30, **{axis: world.sign[axis] * 0.8, partner.name: -0.4 * sign})
                assert world.speed[partner.name] * sign <= 0.0


@pytest.mark.parametrize("held", ["slew", "near_far"])
def test_what_a_motion_adds_ends(held: str) -> None:
    """One stick is held for 12 s; the other axis is sent to and fro: 6 s of a quarter at most."""
    world = TestNeverFaster().world("forwarder-robust")
    partner = world.axes[held].moves_with
    assert partner is not None
    world.go(5)
    for _ in range(12):
        world.go(50, **{held: 0.8})
        world.sign[partner.name] *= -1
    assert 0.3 < world.way[partner.name] <= 6.0 * partner.largest_added + 0.1
