"""Promise 6, by the bytes of frames: every fault that can be made on a bus, and the way back."""

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from canshaper.codec.frame import Frame
from canshaper.shaping.transfer import Off
from tests.promises.events import (
    Event,
    address_claimed,
    broken,
    code,
    counter_stands,
    flag,
    once,
    shorter,
    silence,
    without,
)
from tests.promises.world import HOUR_NS, REST, World, every

JOYSTICK = {"JOYSTICK_ERROR", "JOYSTICK_NOT_AVAILABLE", "JOYSTICK_OUT_OF_RANGE"}
JOYSTICK |= {"JOYSTICK_CONTRADICTORY"}


NETWORK = (0x18EEFF00, 0x18EA0000, 0x18EC0000, 0x18EB0000, 0x18E80000)  # of J1939


@dataclass
class Fault:
    """Attributes:
    act: makes it, tick by tick.
    reasons: names that it may have.
    state: the reaction.
    here: whether a machine can have it.
    """

    act: Event
    reasons: set[str]
    state: str = "TRIPPED"
    here: Callable[[World], object] = lambda world: True


def raising(world: World) -> None:
    """A filter of every axis raises."""

    class Raising(Off):
        def step(self, command: float) -> float:
            raise ZeroDivisionError

    for control in world.evil.axes.values():
        control.axis.transfer.shaper = Raising()


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
    "silence": Fault(silence, {"JOYSTICK_TIMEOUT", "ENABLE_LOST"}, "STOPPING"),
    "stamps of an hour ago": Fault(
        flag(age_ns=HOUR_NS),
        {"JOYSTICK_TIMEOUT", "ENABLE_LOST", "NODE_FAULT"},
        "STOPPING",
        here=lambda w: not (w.machine.nodes or w.machine.stop or w.machine.switches),
    ),
    "wrong length": Fault(shorter, {"JOYSTICK_TIMEOUT", "ENABLE_LOST"}, "STOPPING"),
    "a code of the DBC": Fault(
        code(0), JOYSTICK, "STOPPING", lambda w: all(map(broken, w.axes.values()))
    ),
    "counter stands": Fault(
        counter_stands,
        {"JOYSTICK_UNTRUSTED", "ENABLE_LOST"},
        "STOPPING",
        lambda w: all(one.counter for one in w.machine.joysticks.values()),
    ),
    "heartbeats end": Fault(
        without(lambda w: [(n.bus, 0x700 + n.number, False) for n in w.machine.nodes.values()]),
        {"NODE_FAULT", "VALVE_FAULT", "VALVE_NOT_READY"},
        here=lambda w: {*w.axes} == {*w.machine.drives} | {n for n, a in w.axes.items() if a.words},
    ),
    "status words end": Fault(
        without(lambda w: [one.words.key for one in w.axes.values() if one.words]),
        {"VALVE_FAULT", "VALVE_NOT_READY"},
        here=lambda w: all(one.words for one in w.axes.values()),
    ),
    "address lost": Fault(
        once(address_claimed),
        {"ADDRESS_LOST"},
        here=lambda w: w.machine.addresses and all(one.valve_key[2] for one in w.axes.values()),
    ),
    "a filter raises": Fault(once(raising), {"OUTPUT_INVALID"}),
}


@every
class TestEveryFault:
    """**Every listed fault has a name, a reaction and a way back.** No received bytes end the loop.
    An unexpected error within the program does: every valve is sent neutral, and the service
    manager starts it again. A valve whose neutral cannot be made gets no frame."""

    def moving(self, name: str) -> World:
        world = World(name)
        world.go(REST)
        self.moves(world)
        return world

    def moves(self, world: World) -> None:
        moved: set[str] = set()
        for _ in range(12):  # what came before may stop one of them for a moment
            world.go(1, **world.held(0.7))
            moved |= {axis for axis, speed in world.speed.items() if speed}
        assert moved == world.speed.keys()
        world.evil.events.clear()

    @pytest.mark.parametrize("state", ["TRIPPED", "STOPPING"])
    def test_name_reaction_and_way_back(self, name: str, state: str) -> None:
        world = self.moving(name)
        faults = {
            what: one for what, one in FAULTS.items() if one.state == state and one.here(world)
        }
        assert len(faults) >= 2
        for what, fault in faults.items():
            self.one(world, what, fault)
            self.comes_back(world, what)

    def one(self, world: World, what: str, fault: Fault) -> None:
        """From motion until every axis rests; the log says of each why."""
        names: set[tuple[str, str, str]] = set()
        longest = max(one.stop * one.period_ticks for one in world.axes.values()) + 55
        for k in range(longest):
            fault.act(world, k)
            world.step()
            names |= {(f["axis"], f["state"], f["reason"]) for f in self.fields(world)}
            if not any(world.speed.values()):
                break
        assert not any(world.speed.values()), what
        for axis in world.axes:
            states = {
                state for of, state, reason in names if of == axis and reason in fault.reasons
            }
            # An axis that another message enables too may trip for that.
            assert states, (what, axis, names)
            assert states <= {fault.state, "TRIPPED"}, (what, axis, names)
        assert fault.state in {state for _, state, reason in names if reason in fault.reasons}, what

    def fields(self, world: World) -> Iterator[dict[str, str]]:
        """Changes of state, as the log has them."""
        for event in world.evil.events:
            assert "output=refused" not in event.text
            if event.text.startswith("axis=") and " state=" in event.text:
                yield dict(word.split("=", 1) for word in event.text.split() if "=" in word)
        world.evil.events.clear()

    def comes_back(self, world: World, what: str) -> None:
        """Nothing is wrong any more; neutral, and enable pressed again."""
        world.well()
        for node in world.machine.nodes.values():  # CiA 301: no error any more
            world.receive(Frame(node.bus, 0x80 + node.number, False, bytes(8)))
        if what in ("address lost", "a filter raises", "any bytes"):
            world.reload()  # a good file
        world.go(60 if what in ("second sender", "any bytes") else 20)
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
                  for number in NETWORK]  # fmt: skip
        for _ in range(60):
            for key in (
                rng.choice(known),
                (rng.choice(machine.buses), rng.randrange(1 << 29), True),
            ):
                assert key is not None
                world.receive(
                    Frame(*key, rng.randbytes(rng.choice((0, 1, 2, 7, 8, 8, 12, 24, 64))))
                )
            if rng.random() < 0.3:
                world.step()
            assert not any(world.speed.values())
        self.comes_back(world, "any bytes")

    def test_every_valve_is_sent_neutral_where_a_part_raises(self, name: str) -> None:
        world = self.moving(name)

        def plant(frames: list[Frame]) -> Iterator[Frame]:
            raise ZeroDivisionError
            yield from frames

        with pytest.raises(ZeroDivisionError):
            world.step(plant)
        last = {frame[:3]: frame for frame in world.gated.neutral_frames()}
        assert set(last) >= set(world.moved_by)
        for key, axes in world.moved_by.items():
            assert all(world.decode(axis, last[key].data) == 0 for axis in axes)

    def test_where_neutral_cannot_be_made_no_frame_is_sent(self, name: str) -> None:
        world = self.moving(name)
        sound, key = world.evil.neutral_frames, next(iter(world.moved_by))
        moving = world.commands(**world.held(0.3))
        for wrong in (
            lambda frame: next(iter(moving([frame]))),
            lambda frame: frame._replace(data=frame.data[:-1]),
        ):
            world.evil.neutral_frames = (
                lambda wrong=wrong: [  # type: ignore[method-assign,misc]
                    wrong(one) if one[:3] == key else one for one in sound()
                ]
            )
            left = {frame[:3] for frame in world.gated.neutral_frames()}
            assert key not in left
            assert left >= set(world.moved_by) - {key}
            assert any("output=refused" in event.text for event in world.evil.events)
            world.evil.events.clear()
