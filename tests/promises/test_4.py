"""Promise 4, by the bytes of frames that a wrong controller hands out."""

from collections.abc import Iterator

import pytest

from canshaper.codec.frame import Frame
from tests.promises.world import REST, World, every


@every
class TestEveryFrameIsOfItsTick:
    """**Every valve frame is computed in the tick that sends it**, in a gateway at most one tick
    before. None is repeated: no cyclic job of the kernel (BCM), no resend, no frame while the loop
    stands still."""

    def world(self, name: str) -> World:
        world = World(name)
        world.go(REST)
        world.go(20, **world.held(0.6))
        assert all(world.speed.values())
        return world

    def valves(self, world: World) -> list[Frame]:
        """Frames of valves in the last tick: one for each at most, with the next counter."""
        left = [frame for frame in world.left if frame[:3] in world.moved_by]
        assert len({frame[:3] for frame in left}) == len(left)
        return left

    def counters(
        self, world: World, frames: list[Frame], before: dict[tuple[str, int, bool], int]
    ) -> None:
        for frame in frames:
            axis = world.moved_by[frame[:3]][0]
            count, last = world.count(axis, frame.data), before.get(frame[:3])
            if (counter := world.axes[axis].valve_counter) and last is not None:
                assert count == (last + 1) & counter.mask
            before[frame[:3]] = count

    def test_one_frame_of_a_valve_in_a_tick(self, name: str) -> None:
        """Late ticks, standstills, frames that fail: nothing is made up for."""
        world = self.world(name)
        before: dict[tuple[str, int, bool], int] = {}
        for k in range(60):
            if k == 20:
                world.send_failed()
            if k == 40:
                world.stalled()
            if k % 10 == 9:
                world.n += 2
                world.step(missed=2)
            else:
                world.step()
            self.counters(world, self.valves(world), before)
        assert set(before) == set(world.moved_by)

    def test_a_frame_is_not_sent_again(self, name: str) -> None:
        """Twice in its tick, or one of a tick before in front of it, behind it, or instead."""
        world = self.world(name)
        past: list[Frame] = []
        before: dict[tuple[str, int, bool], int] = {}
        for k in range(32):

            def plant(frames: list[Frame], k: int = k, past: list[Frame] = past) -> Iterator[Frame]:
                for frame in frames:
                    old = next((one for one in past if one[:3] == frame[:3]), frame)
                    several = [frame, frame], [old, frame], [frame, old], [old]
                    yield from several[k // 8] if frame[:3] in world.moved_by else [frame]

            world.step(plant)
            left = self.valves(world)
            self.counters(world, left, before)
            past = [*left, *past[-20:]]
        counted = {k for k, (axis, *_) in world.moved_by.items() if world.axes[axis].valve_counter}
        moving = [axis for key in counted for axis in world.moved_by[key] if world.speed[axis]]
        assert not moving  # refused: neutral in their place

    def test_no_frame_without_a_tick(self, name: str) -> None:
        """Frames of any speed, right behind the tick, also such as ask for nothing new."""
        world = self.world(name)
        if world.machine.gateway:
            pytest.skip(
                "a frame of ours may leave next to one that is passed on: rates hold over both"
            )
        for key, axes in world.moved_by.items():
            frame = next(one for one in world.left if one[:3] == key)
            for speed in (0.2, 0.6, -0.5, 1.0):
                data = frame.data
                for axis in axes:
                    data = world.encode(axis, data, round(speed * world.axes[axis].steps))
                for ahead in (0, 1):
                    wrong = frame._replace(data=world.counted(axes[0], data, ahead))
                    assert not world.gated.passes(wrong, world.now_ns), (axes, speed, ahead)

    def test_what_waited_while_the_loop_stood(self, name: str) -> None:
        """Frames that are computed from it are neutral; a gateway passes nothing of it on."""
        world = self.world(name)
        world.stalled()
        for _ in range(3):
            for one in world.machine.joysticks:
                left = world.receive(world.joystick(one))
                assert all(world.decode(axis, frame.data) == 0
                           for frame in left for axis in world.moved_by[frame[:3]])  # fmt: skip
        world.step()
        assert not any(world.speed.values())

    def test_a_frame_that_is_withheld_leaves_no_gap(self, name: str) -> None:
        world = self.world(name)
        if world.machine.gateway:
            pytest.skip("its frames leave between two ticks")
        before: dict[tuple[str, int, bool], int] = {}
        late = [frame for frame in world.left if frame[:3] in world.moved_by]
        self.counters(world, late, before)
        world.step()
        assert all(world.gated.withhold(frame) for frame in self.valves(world))
        world.step()
        self.counters(world, self.valves(world), before)
        assert len(self.valves(world)) == len(world.moved_by)
        assert all(world.speed.values())
