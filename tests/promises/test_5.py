"""Promise 5, by the bytes of wrong frames between a sound controller and the valves."""

import random
from collections.abc import Callable, Iterator

import pytest

from canshaper.codec.frame import Frame
from tests.faults.sealed import sealed
from tests.promises.test_2 import rounding
from tests.promises.world import REST, World, every
from tests.promises.worst import Worst

HEADERS = {"p04": 12, "p07": 20}  # bytes of E2E
WORDS = (0x8, 0x9, 0xB, 0xF, 0x3)  # of CiA 408

Wrong = Callable[[World, Frame], Iterator[Frame]]


def lengths(world: World, frame: Frame) -> Iterator[Frame]:
    for n in (*range(len(frame.data)), len(frame.data) + 1, 64):
        yield frame._replace(data=frame.data[:n].ljust(n, b"\0"))


def bits(world: World, frame: Frame) -> Iterator[Frame]:
    word = int.from_bytes(frame.data, "little")
    for bit in range(8 * len(frame.data)):
        yield frame._replace(data=(word ^ 1 << bit).to_bytes(len(frame.data), "little"))


def sealed_bits(world: World, frame: Frame) -> Iterator[Frame]:
    """With a header of E2E that is right: no header protects from one who makes it."""
    e2e = world.file["axes"][world.moved_by[frame[:3]][0]]["valve"].get("e2e")
    for one in bits(world, frame):
        yield one._replace(data=sealed(e2e, one.data))


def all_bytes(world: World, frame: Frame) -> Iterator[Frame]:
    for data in (bytes(255 - one for one in frame.data), frame.data[::-1],
                 b"\xff" * len(frame.data), b"\x7f" * len(frame.data)):  # fmt: skip
        yield frame._replace(data=data)


def values(world: World, frame: Frame) -> Iterator[Frame]:
    """Every value of a command of up to ten bits, of a longer one the ends and some; every code of
    a direction, of the same command in another resolution, of a control word."""
    for axis in world.moved_by[frame[:3]]:
        e2e = world.file["axes"][axis]["valve"].get("e2e")
        for field in world.fields(axis):
            rng, ones, full = random.Random(axis), field.mask, field.full
            half = (ones >> 1) + 1
            raws = [0, 1, half - 1, half, full, full + 1, ones - full, ones + 1 - full, ones]
            raws += [*field.special, *(rng.randrange(ones) for _ in range(100))]
            if ones < 1024:
                raws = [*range(ones + 1)]
            for raw in raws:
                word = int.from_bytes(frame.data, "little") & ~(ones << field.start)
                data = (word | (raw & ones) << field.start).to_bytes(len(frame.data), "little")
                yield frame._replace(data=sealed(e2e, data))


def counters(world: World, frame: Frame) -> Iterator[Frame]:
    for ahead in (-1, 1, 2, 128):
        yield frame._replace(data=world.counted(world.moved_by[frame[:3]][0], frame.data, ahead))


def identifiers(world: World, frame: Frame) -> Iterator[Frame]:
    yield frame._replace(extended=not frame.extended)
    for bit in range(29 if frame.extended else 11):
        yield frame._replace(can_id=frame.can_id ^ 1 << bit)
    for bus in [*world.machine.buses, "", "nowhere"]:
        if bus != frame.bus:
            yield frame._replace(bus=bus)


CANOPEN = (
    (0, "01"), (0x80, ""), (0xA0, "0" * 16), (0x720, "05"), (0x620, "2b40600006000000"),
    (0x77E, "04"),
)  # fmt: skip


def others(world: World, frame: Frame) -> Iterator[Frame]:
    """Joysticks; NMT, SYNC, SDO, heartbeats of CANopen; requests, claims, transport of J1939."""
    yield from (world.joystick(name) for name in world.machine.joysticks)
    for bus in world.machine.buses:
        for command in (2, 0x80, 0x81, 0x82, 3):
            yield from (Frame(bus, 0, False, bytes([command, node])) for node in (0, 0x20))
        for number, content in CANOPEN:
            yield Frame(bus, number, False, bytes.fromhex(content))
        for number in (0x18EAFF9C, 0x18EA339C, 0x18ECFF9C, 0x18EBFF9C, 0x18FED89C, 0x18D0FF9C):
            yield from (Frame(bus, number, True, bytes(n)) for n in (3, 9))
        yield Frame(bus, 0x18EEFF33, True, bytes(8))
    for key in (*world.machine.statuses, world.machine.service):
        assert key is not None
        yield from (Frame(*key, bytes(n)) for n in (0, 1, 7, 65))
        yield Frame(key[0], key[1], not key[2], bytes(8))


WRONG: dict[str, Wrong] = {
    one.__name__: one
    for one in (lengths, bits, sealed_bits, all_bytes, values, counters, identifiers, others)
}


def right(world: World, sound: Frame, frame: Frame) -> bool:
    """Whether a frame may leave in the place of a sound one, by the file and the DBC alone."""
    if frame[:3] != sound[:3]:
        if frame[:3] in world.moved_by:
            return True  # it is right or wrong in the turn of that valve
        keys = (*world.machine.statuses, world.machine.service, world.machine.identity)
        return frame[:3] in keys and 8 <= len(frame.data) <= 64  # whatever it says
    if len(frame.data) != len(sound.data):
        return False
    axes = world.moved_by[frame[:3]]
    return whole(world, axes, sound.data, frame.data) and all(
        may_be(world, axis, world.decode(axis, frame.data)) for axis in axes
    )


def whole(world: World, axes: list[str], sound: bytes, data: bytes) -> bool:
    """Whether all that is no command is as before, and signals of a command agree."""
    before, after = int.from_bytes(sound, "little"), int.from_bytes(data, "little")
    ours = 0
    for axis in axes:
        fields, e2e = world.fields(axis), world.file["axes"][axis]["valve"].get("e2e")
        ours |= sum(field.mask << field.start for field in fields)
        if e2e:
            ours |= (1 << 8 * HEADERS[e2e["profile"]]) - 1
        steps, words = world.decode(axis, data) or 0, world.axes[axis].words
        also = [one.get(after) - one.full * abs(steps) / fields[0].full for one in fields[1:]
                if one.name in world.file["axes"][axis]["valve"].get("also", [])]  # fmt: skip
        if sealed(e2e, data) != data or any(abs(one) > 0.51 for one in also):
            return False
        if words and words.control.get(after) not in WORDS:
            return False
    return before & ~ours == after & ~ours


def may_be(world: World, axis: str, steps: int | None) -> bool:
    """Whether a command may be sent now; in doubt it may: on the way back, by a motion."""
    of, seen, now = world.axes[axis], world.buses.axes[axis], world.speed[axis]
    if not steps:
        return steps == 0
    if seen.stopped_at_once(world.now_ns) or seen.latched or not seen.neutral:
        return False
    speed, rounds = of.velocity(steps), rounding(of)
    asked = max(seen.most(1.0), seen.most(-1.0), abs(now), of.largest_added)
    if abs(speed) > min(abs(now) + of.rise, asked) + rounds:
        return False
    return abs(speed - now) <= max(of.rise, of.fall) + rounds or (
        of.largest_added > 0.0 and abs(speed) < abs(now)
    )


@every
class TestNoFrameBeyondTheLimits:
    """**No valve frame beyond the limits leaves.** The gate checks each one before the socket, by
    the file's limits and the bytes alone. A wrong command within the limits passes."""

    @pytest.mark.parametrize("what", WRONG)
    def test_no_wrong_frame_leaves(self, name: str, what: str) -> None:
        """Each of them in the turn of the sound frame: at rest, in motion, tripped."""
        world, planted = World(name), 0

        def plant(frames: list[Frame]) -> Iterator[Frame]:
            nonlocal planted
            gate, of = world.gated._gate, world.evil.of
            for sound in frames:
                if sound[:3] in world.moved_by:
                    for wrong in WRONG[what](world, sound):
                        if not right(world, sound, wrong):
                            planted += 1
                            assert gate.leaving(wrong[:3], wrong.data, of), (sound, wrong)
                yield sound

        world.go(REST)
        world.step(plant)
        world.go(15, **world.held(0.6))
        assert all(world.speed.values())
        world.step(plant)
        assert all(world.speed.values())
        world.enable = 0
        world.go(2)
        world.step(plant)
        assert planted or what == "counters"

    def test_neutral_leaves_in_its_place(self, name: str) -> None:
        """Whatever is tried, from rest and in motion: neutral with the next counter, and a trip."""
        for size, wrong in ((0.0, 1.0), (0.0, 0.1), (0.6, -1.0), (0.6, 1.0)):
            world = World(name)
            world.go(REST)
            world.go(15, **world.held(size))
            counts = {f[:3]: world.count(world.moved_by[f[:3]][0], f.data)
                      for f in world.left if f[:3] in world.moved_by}  # fmt: skip
            world.step(world.commands(**world.held(wrong)))
            for frame in (f for f in world.left if f[:3] in world.moved_by):
                axis = world.moved_by[frame[:3]][0]
                if counter := world.axes[axis].valve_counter:
                    count = world.count(axis, frame.data)
                    assert count == (counts[frame[:3]] + 1) & counter.mask
            assert not any(world.speed.values()), (size, wrong)
            assert len(world.refusals()) == len(world.moved_by)
            world.go(10, world.commands(**world.held(0.1)), **world.held(size))
            assert not any(world.speed.values())

    def test_where_even_neutral_moves_nothing_leaves(self, name: str) -> None:
        world = World(name)
        world.go(REST)
        wrong = world.commands(**world.held(1.0))
        world.evil.substitute = lambda frame: next(iter(wrong([frame])))
        for _ in range(5):
            world.step(wrong)
            assert not [one for one in world.left if one[:3] in world.moved_by]

    def test_every_frame_is_within_the_limits_of_the_file(self, name: str) -> None:
        """The worst controller keeps rise, fall and a maximum that was set, in any stroke."""
        world, most = Worst(name), 0.4
        for axis in world.gate.axes.values():
            axis.of.ranges = {"limits.max_pct": (20.0, 80.0)}

        def judge(axis: str, before: float, now: float) -> None:
            of = world.axes[axis]
            size = abs(now) - (abs(before) if now * before > 0.0 else 0.0)
            assert size <= of.rise + rounding(of), f"{axis}: rises by {size:.3f}"
            if now and now * before > 0.0 and not of.moves_with:
                assert -size <= of.fall + rounding(of), f"{axis}: falls by {-size:.3f}"
            assert abs(now) <= max(most, abs(before) - of.fall) + rounding(of), f"{axis}: too fast"

        world.judge = judge
        for name_of in world.axes:
            world.gate.set(f"axes.{name_of}.limits.max_pct", 100.0 * most)
        for size in (1.0, -0.5, 0.2, 0.0, 1.0):
            world.starts()
            world.go(15, **world.held(size))
            world.go(6)
