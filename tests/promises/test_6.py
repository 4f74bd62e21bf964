"""Promise 6, by the bytes of frames: every fault that can be made on a bus, and the way back."""

import random
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import pytest

from canshaper.codec.frame import Frame
from tests.promises.world import REST, World, every

Act = Callable[[World, int], None]
JOYSTICK = {"JOYSTICK_ERROR", "JOYSTICK_NOT_AVAILABLE", "JOYSTICK_OUT_OF_RANGE"}
JOYSTICK |= {"JOYSTICK_CONTRADICTORY"}


@dataclass
class Fault:
    """Attributes:
    act: makes it, tick by tick.
    reasons: names that it may have.
    state: the reaction.
    here: whether a machine can have it.
    """

    act: Act
    reasons: set[str]
    state: str = "TRIPPED"
    here: Callable[[World], object] = lambda world: True


def once(act: Callable[[World], object]) -> Act:
    return lambda world, k: None if k else (act(world), None)[1]


def flag(**values: object) -> Act:
    def act(world: World, k: int) -> None:
        for name, value in values.items():
            setattr(world, name, value)

    return act


def joysticks(change: Callable[[Frame], Iterable[Frame]]) -> Act:
    def act(world: World, k: int) -> None:
        keys = {one.key for one in world.machine.joysticks.values()}
        world.change = lambda frame: change(frame) if frame[:3] in keys else [frame]

    return act


def without(keys: Callable[[World], Iterable[tuple[str, int, bool]]]) -> Act:
    """Messages that are silent."""

    def act(world: World, k: int) -> None:
        lost = set(keys(world))
        world.change = lambda frame: [] if frame[:3] in lost else [frame]

    return act


def last_code(world: World, k: int) -> None:
    for axis in world.axes.values():
        ones = axis.signal.mask >> bool(axis.signal.sign)
        world.raw.setdefault(axis.joystick.name, {})[axis.signal.name] = ones


def counters(world: World, k: int) -> None:
    for one in world.machine.joysticks.values():
        if one.counter:
            world.raw[one.name] = {one.counter.name: 7}


def claimed(world: World) -> None:
    """Another node with the best NAME wants our address."""
    for bus, own in world.machine.addresses.items():
        world.receive(Frame(bus, 0x18EEFF00 | own, True, bytes(8)))


def raising(world: World) -> None:
    """A filter of every axis raises."""

    def step(*_: object) -> float:
        raise ZeroDivisionError("a mistake")

    for runner in world.evil.axes.values():
        runner.axis._output.shaper.step = step


FAULTS = {
    "enable released": Fault(flag(enable=0), {"ENABLE_LOST"}),
    "another switch off": Fault(
        flag(agree=False), {"ENABLE_LOST"}, here=lambda world: world.machine.switches
    ),
    "emergency stop": Fault(flag(stop=1), {"EMERGENCY_STOP"}, here=lambda w: w.machine.stop),
    "emergency stop lost": Fault(
        without(lambda w: [w.machine.stop.key] if w.machine.stop else []),
        {"EMERGENCY_STOP_LOST"},
        here=lambda w: w.machine.stop,
    ),
    "second sender": Fault(once(World.second_sender), {"SECOND_SENDER"}),
    "failed send": Fault(once(World.send_failed), {"SEND_FAILED"}),
    "stalled loop": Fault(once(World.stalled), {"LOOP_STALLED"}),
    "silence": Fault(joysticks(lambda frame: []), {"JOYSTICK_TIMEOUT", "ENABLE_LOST"}, "STOPPING"),
    "wrong length": Fault(
        joysticks(lambda frame: [frame._replace(data=frame.data[:-1])]),
        {"JOYSTICK_TIMEOUT", "ENABLE_LOST"},
        "STOPPING",
    ),
    "last code": Fault(last_code, JOYSTICK, "STOPPING"),
    "counter stands": Fault(
        counters,
        {"JOYSTICK_UNTRUSTED", "ENABLE_LOST"},
        "STOPPING",
        lambda w: all(one.counter for one in w.machine.joysticks.values()),
    ),
    "heartbeats end": Fault(
        without(lambda w: [(n.bus, 0x700 + n.number, False) for n in w.machine.nodes.values()]),
        {"NODE_FAULT", "ENABLE_LOST"},
        "STOPPING",
        lambda w: w.machine.nodes,
    ),
    "status words end": Fault(
        without(lambda w: [one.words.key for one in w.axes.values() if one.words]),
        {"VALVE_FAULT", "VALVE_NOT_READY"},
        here=lambda w: all(one.words for one in w.axes.values()),
    ),
    "address lost": Fault(
        once(claimed), {"ADDRESS_LOST"}, here=lambda w: w.machine.addresses and not w.machine.stop
    ),
    "a filter raises": Fault(once(raising), {"OUTPUT_INVALID"}),
}


@every
class TestEveryFault:
    """**Every fault has a name, a reaction and a way back.** No fault of machine or bus ends the
    loop. What a part of the program raises does: every valve is sent neutral,
    `failed reason=INTERNAL_ERROR` with its place stands in log and black box, and the service
    manager starts it again. Where a valve's neutral cannot be made either, it gets no frame and its
    own timeout acts; the log ends with `stopped valves=not-sent`."""

    def moving(self, name: str) -> World:
        world = World(name)
        world.go(REST)
        self.moves(world)
        return world

    def moves(self, world: World) -> None:
        world.go(12, **world.held(0.7))
        assert all(world.speed.values())
        world.evil.events.clear()

    @pytest.mark.parametrize("what", FAULTS)
    def test_name_reaction_and_way_back(self, name: str, what: str) -> None:
        fault, world = FAULTS[what], self.moving(name)
        if not fault.here(world):
            pytest.skip("the machine has no such thing")
        names: set[tuple[str, str, str]] = set()
        longest = max(one.stop * one.period_ticks for one in world.axes.values())
        longest += max(one.source.timeout_ns for one in world.buses._inputs.values()) // 20_000_000
        for k in range(longest + 30):
            fault.act(world, k)
            world.step()
            names |= {(f["axis"], f["state"], f["reason"]) for f in self.fields(world)}
            if not any(world.speed.values()):
                break
        assert not any(world.speed.values())
        first = {axis: [s for a, s, r in names if a == axis and r in fault.reasons]
                 for axis in world.axes}  # fmt: skip
        assert all(first.values()), names
        # Of a joystick whose enable is another message's that one is lost.
        assert {s for s in sum(first.values(), [])} <= {fault.state, "TRIPPED"}, names
        assert fault.state in sum(first.values(), []), names
        self.comes_back(world, what)

    def fields(self, world: World) -> Iterator[dict[str, str]]:
        """Changes of state, as the log has them."""
        for event in world.evil.events:
            if " state=" in event.text:
                yield dict(word.split("=", 1) for word in event.text.split() if "=" in word)
        world.evil.events.clear()

    def comes_back(self, world: World, what: str) -> None:
        """Nothing is wrong any more; neutral, and enable pressed again."""
        world.enable, world.stop, world.agree, world.raw = 1, 0, True, {}
        world.change = lambda frame: [frame]
        if what in ("address lost", "a filter raises"):
            world.reload()  # a good file
        world.go(75)
        world.enable = 0
        world.go(3)
        world.enable = 1
        world.go(REST)
        self.moves(world)

    def test_no_bytes_end_the_loop(self, name: str) -> None:
        """Whatever identifier and content: nothing is raised, and nothing moves that rests."""
        world, rng = World(name), random.Random(name)
        world.go(REST)
        machine = world.machine
        known = [*machine.inputs, *machine.valves, *machine.statuses, machine.service]
        known += [one.words.key for one in world.axes.values() if one.words]
        known += [(n.bus, base + n.number, False)
                  for n in machine.nodes.values() for base in (0x80, 0x580, 0x700)]  # fmt: skip
        known += [(bus, number | 0x9C, True) for bus in machine.buses
                  for number in (0x18EEFF00, 0x18EA0000, 0x18EC0000, 0x18EB0000, 0x18E80000)]  # fmt: skip
        for _ in range(60):
            for key in (rng.choice(known), (rng.choice(machine.buses), rng.randrange(1 << 29), True)):
                assert key is not None
                world.receive(Frame(*key, rng.randbytes(rng.choice((0, 1, 2, 7, 8, 8, 12, 24, 64)))))
            if rng.random() < 0.3:
                world.step()
            assert not any(world.speed.values())
        self.comes_back(world, "address lost")

    def test_every_valve_is_sent_neutral_where_a_part_raises(self, name: str) -> None:
        world = self.moving(name)

        def plant(frames: list[Frame]) -> Iterator[Frame]:
            raise ZeroDivisionError
            yield from frames

        with pytest.raises(ZeroDivisionError):
            world.step(plant)
        last = {frame[:3]: frame for frame in world.guarded.neutral_frames()}
        assert set(last) >= set(world.moved_by)
        for key, axes in world.moved_by.items():
            assert all(world.decode(axis, last[key].data) == 0 for axis in axes)

    def test_where_neutral_cannot_be_made_no_frame_is_sent(self, name: str) -> None:
        world = self.moving(name)
        sound, key = world.evil.neutral_frames, next(iter(world.moved_by))
        moving = world.commands(**world.held(0.3))
        world.evil.neutral_frames = lambda: [  # type: ignore[method-assign]
            next(iter(moving([one]))) if one[:3] == key else one for one in sound()
        ]
        left = {frame[:3] for frame in world.guarded.neutral_frames()}
        assert key not in left
        assert left >= set(world.moved_by) - {key}
        assert any("output=refused" in event.text for event in world.evil.events)
