"""Faults on the buses of a machine, tick by tick; ``World.well`` ends them."""

from collections.abc import Callable, Iterable

from canshaper.codec.frame import Frame
from tests.faults.axis import Axis
from tests.faults.machine import Key
from tests.promises.world import World

Event = Callable[[World, int], None]
"""Act before each tick, called with the number of ticks since it began."""


def once(act: Callable[[World], None]) -> Event:
    return lambda world, k: None if k else act(world)


def flag(**values: object) -> Event:
    """Enable or emergency stop of the hand, or switches of the machine."""

    def event(world: World, k: int) -> None:
        for name, value in values.items():
            setattr(world, name, value)

    return event


def joysticks(change: Callable[[Frame], Iterable[Frame]]) -> Event:
    """Frames of joysticks come otherwise."""

    def event(world: World, k: int) -> None:
        keys = {one.key for one in world.machine.joysticks.values()}
        world.change = lambda frame: change(frame) if frame[:3] in keys else [frame]

    return event


silence = joysticks(lambda frame: [])
shorter = joysticks(lambda frame: [frame._replace(data=frame.data[:-1])])


def without(keys: Callable[[World], Iterable[Key]]) -> Event:
    """Other messages are silent."""

    def event(world: World, k: int) -> None:
        lost = set(keys(world))
        world.change = lambda frame: [] if frame[:3] in lost else [frame]

    return event


def broken(axis: Axis) -> list[int]:
    """Codes that are no measurement: those that the DBC names, and the first beyond the range."""
    beyond = axis.signal.full + 1
    return [*axis.signal.special, *([beyond] if beyond <= axis.signal.high else [])]


def code(which: int) -> Event:
    """Every joystick has such a code, where there is one."""

    def event(world: World, k: int) -> None:
        for axis in world.axes.values():
            if codes := broken(axis):
                raw = {axis.signal.name: codes[which % len(codes)]}
                world.raw.setdefault(axis.joystick.name, {}).update(raw)

    return event


def counter_stands(world: World, k: int) -> None:
    for one in world.machine.joysticks.values():
        if one.counter:
            world.raw.setdefault(one.name, {})[one.counter.name] = 7


def address_claimed(world: World) -> None:
    """Another node with the best NAME wants our address."""
    for bus, own in world.machine.addresses.items():
        world.receive(Frame(bus, 0x18EEFF00 | own, True, bytes(8)))
