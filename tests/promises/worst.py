"""The worst controller: sends each axis as fast towards one side as the gate lets it."""

from collections.abc import Iterable, Iterator
from functools import cache
from itertools import zip_longest

from canshaper.codec.frame import Frame
from canshaper.gate.build import record_of
from canshaper.gate.gate import Gate
from tests.faults.machine import Key
from tests.promises.world import REST, World


@cache
def at_rest(name: str) -> dict[Key, bytes]:
    """A frame of each valve that no one moves."""
    world = World(name)
    world.go(REST)
    return {frame[:3]: frame.data for frame in world.left if frame[:3] in world.moved_by}


class Worst(World):
    """A gate, and no controller but this one: of many frames the fastest that leaves is sent.

    Attributes:
        sign: of each axis, to which side it is sent.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.gate = Gate(record_of(self.deployment))
        self.sign = {axis: (-1) ** i for i, axis in enumerate(self.axes)}
        self._next = dict(at_rest(name))
        self._steps = dict.fromkeys(self.axes, 0)

    def passed(self, frame: Frame, at_ns: int) -> list[Frame]:
        self.gate.receive(frame[:3], frame.data, at_ns)
        keys = [key for key in self.moved_by if key[1:] == frame[1:3] and self.machine.gateway]
        return [one for key in keys for one in self._sent(key, frame.data)]

    def ticked(self, missed: int) -> Iterable[Frame]:
        self.gate.tick(self.now_ns, missed)
        for key, (axis, *_) in self.moved_by.items():
            if self.n % self.axes[axis].period_ticks == 0 and not self.machine.gateway:
                yield from self._sent(key)

    def _sent(self, key: Key, of: bytes | None = None) -> Iterator[Frame]:
        """The first of the candidates that leaves."""
        axes = self.moved_by[key]
        for axis in axes:
            if not self.speed[axis]:
                self._steps[axis] = 0
        for several in self._together([self._candidates(axis) for axis in axes]):
            data = self._next[key]
            if of is not None and len(of) == len(data):
                data = self._with_count(axes[0], of, data)
            for axis, steps in zip(axes, several, strict=True):
                data = self.encode(axis, data, steps)
            if not self.gate.leaving(key, data, of):
                self._steps.update(zip(axes, several, strict=True))
                self._next[key] = self.counted(axes[0], data, 1)
                yield Frame(*key, data)
                return

    def _together(self, axes: list[list[int]]) -> Iterator[tuple[int, ...]]:
        """Commands of the axes of one frame: all of them, then one at a time."""
        if len(axes) > 1:
            yield from list(zip_longest(*axes, fillvalue=0))[:-1]
            for i, one in enumerate(axes):
                yield from (tuple(c * (j == i) for j in range(len(axes))) for c in one[:-1])
            yield (0,) * len(axes)
        else:
            yield from ((c,) for c in axes[0])

    def _with_count(self, axis: str, data: bytes, counted: bytes) -> bytes:
        """The frame with the alive counter of another one."""
        return self.counted(axis, data, self.count(axis, counted) - self.count(axis, data))

    def starts(self, size: float = 1.0) -> None:
        """From whatever was: enable is released and pressed again, then all sticks deflected."""
        self.well()
        seen = [*self.buses.axes.values()]
        while any("second sender" in one.stopped_at_once(self.now_ns) for one in seen):
            self.go(1)
        self.enable = 0
        self.go(2)
        self.enable = 1
        self.go(3)
        self.go(6, **self.held(size))
        assert all(self.speed[axis] * sign > 0 for axis, sign in self.sign.items())

    def _candidates(self, axis: str) -> list[int]:
        """Commands, the one that goes farthest to its side first, neutral last."""
        of, sign, last = self.axes[axis], self.sign[axis], self._steps[axis]
        full = of.steps
        rise = round(of.rise * full * (1.0 - of.deadband))
        fall = round(of.fall * full * (1.0 - of.deadband))
        edge = round(of.deadband * full) + 1  # from rest a command begins behind the dead band
        seen = self.buses.axes[axis]
        asked = edge - 1 + round(max(seen.most(sign), 0.0) * (full - edge + 1))
        if last:
            ways = [rise + 1, rise, 1, 0, -1, 1 - fall, -fall, -fall - 1]
            sizes = {max(-full, min(full, sign * last + way)) for way in ways}
            sizes |= {one for one in (asked + 1, asked) if one <= sign * last + rise}
        else:
            sizes = {edge + rise, edge + rise // 2, edge, 1, -edge - rise // 2}
        return [*(sign * one for one in sorted(sizes, reverse=True) if one), 0]

    def fails(self, frame: Frame) -> None:
        self.gate.send_failed(frame[:3])

    def stands(self) -> None:
        self.gate.stalled()

    def reload(self) -> None:
        before, self.gate = self.gate, Gate(record_of(self.deployment))
        self.gate.carry_over(before, frozenset())
        self.buses.reload()
