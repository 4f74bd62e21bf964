"""The gate refuses nothing of the sound controller in random drives of 18 s.

Longer than those of ``tests.faults``: swings sum up, trips are reset within the tail, anti-sway is
switched in motion. One again: ``refused(SEED)``.
"""

import random
from collections.abc import Iterator

import pytest

from tests.faults.shipped import NAMES
from tests.promises.world import World

TICKS, FIRST = 900, 110
QUICK, QUICK_TICKS, MANY = 20, 350, 400
FAULTS = ("enable", "enable", "silent", "bypass", "bypass", "late", "stalled", "not sent")


def taps(rng: random.Random) -> Iterator[float]:
    while True:
        yield from [rng.choice((1, -1, 0.5, rng.uniform(-1, 1)))] * rng.choice((1, 2, 5, 8, 20, 40))
        yield from [0.0] * rng.choice((1, 5, 20, 60, 98, 110, 150))


def rhythm(rng: random.Random) -> Iterator[float]:
    """In the time of the swing, or near it."""
    period = rng.choice((40, 80, 100, 106, 112, 120, 150))
    while True:
        high, low = rng.choice(((1, 0), (1, -1), (0.6, 0), (1, 0.05), (-1, -0.1)))
        for _ in range(rng.randint(1, 6)):
            width = rng.choice((8, 12, period // 2))
            yield from [high] * width + [low] * (period - width)


def steps(rng: random.Random) -> Iterator[float]:
    while True:
        size = rng.choice((0, 0, 1, -1, rng.uniform(-1, 1), rng.uniform(0, 0.1)))
        yield from [size] * rng.choice((2, 5, 10, 25, 60, 120))


class Random:
    """Sticks, switches and faults of one drive, by its seed."""

    def __init__(self, seed: int) -> None:
        self.rng = rng = random.Random(f"canshaper sound {seed}")
        self.world = World(NAMES[seed % len(NAMES)])
        self.sticks = {axis: rng.choice((taps, rhythm, steps))(rng) for axis in self.world.axes}
        self.faults = {rng.randrange(FIRST, TICKS): rng.choice(FAULTS) for _ in range(8)}
        self.faults = dict(list(self.faults.items())[: rng.choice((0, 1, 2, 4, 8))])
        self.left = dict.fromkeys((*FAULTS, "rest"), 0)  # ticks of each that is under way
        joysticks = self.world.machine.joysticks
        self.off = {name: one.off.name for name, one in joysticks.items() if one.off}
        self.keys = {one.key for one in joysticks.values()}

    def fault(self, what: str) -> int:
        """Begin one; deadlines that it misses."""
        world, length = self.world, self.rng.choice((1, 2, 3, 8, 20, 60, 150))
        self.left[what] = length
        if what == "late":
            return min(length, 3)
        if what == "stalled":
            world.stalled(30)
        elif what == "not sent":
            world.send_failed()
        elif what == "enable":
            self.left[what] = min(length, 20)
        if what != "bypass":
            self.left["rest"] = self.left[what] + self.rng.choice((5, 10, 30))
        return 0

    def tick(self, number: int) -> str:
        """One tick; what the gate refuses in it."""
        world, left = self.world, self.left
        at = {axis: next(stick) for axis, stick in self.sticks.items()}
        missed = self.fault(self.faults[number]) if number in self.faults else 0
        world.stick = at if number > FIRST and left["rest"] <= 0 else {}
        stopped = any(0 < left[what] <= 3 for what in ("stalled", "not sent"))  # then it is reset
        world.enable = int(left["enable"] <= 0 and not stopped)
        silent = left["silent"] > 0
        world.change = lambda frame: [] if silent and frame[:3] in self.keys else [frame]
        for name, signal in self.off.items():
            world.raw.setdefault(name, {})[signal] = int(left["bypass"] > 0)
        self.left = {what: ticks - 1 for what, ticks in left.items()}
        world.step(missed=missed)
        return "".join(world.refusals()[:1])


def refused(seed: int, ticks: int = TICKS) -> tuple[str, float]:
    """Drive; return what the gate refuses and when, empty for nothing; part that is in motion."""
    drive, moves = Random(seed), 0
    for number in range(ticks):
        if why := drive.tick(number):
            why = f"seed {seed}, {drive.world.name}, tick {number}: {why}, faults {drive.faults}"
            return why, 1.0
        moves += any(drive.world.speed.values())
    return "", moves / ticks


@pytest.mark.parametrize("seed", range(QUICK))
def test_no_frame_of_a_sound_controller_is_refused(seed: int) -> None:
    why, moves = refused(seed, QUICK_TICKS)
    assert not why and moves > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("first", range(QUICK, MANY, 20))
def test_no_frame_of_many_is_refused(first: int) -> None:
    """One drive may stand nearly all the time; of twenty the most move."""
    drives = [refused(seed) for seed in range(first, first + 20)]
    assert not [why for why, _ in drives if why]
    assert sorted(moves for _, moves in drives)[2] > 0.05
