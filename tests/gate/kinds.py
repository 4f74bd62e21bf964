"""Kinds of wrong outputs between controller and gate, and how far an axis goes by one.

Each kind plants, on every axis at once and in both directions, what a wrong controller would send,
whatever it was refused before, and states how far an axis may go from then on.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import pytest

from canshaper.codec.frame import Frame
from tests.gate.attacker import World

NAMES = """forwarder-robust forwarder-sensor j1939-forwarder canopen-forwarder moog-forwarder
    cia402-forwarder gateway-forwarder two-cranes remote-forwarder""".split()  # noqa: SIM905
MOTION = ("forwarder-robust", "forwarder-sensor")
RATE = 0.09  # of full speed in a tick: within rise and fall
REST = 25  # ticks until claims, nodes and neutral are seen

Speed = Callable[[int, float], float]
Each = Callable[[World, int], None]


def nothing(world: World, k: int) -> None:
    """The bus is sound, and the joysticks stay."""


@dataclass
class Kind:
    """Commands that no one asked for.

    Attributes:
        speed: by ticks since the attack began and speed before it; with the sign of the stick.
        each: what happens before each tick of the attack.
        bound: way in s of full speed that may leave: 0 is refused in the first frame.
        before: ticks in which the stick is held at ``size``; -1: the attack begins at the start.
        why: what a bound that is not 0 goes by.
    """

    speed: Speed
    each: Each = nothing
    bound: float = 0.0
    why: str = ""
    before: int = 0
    size: float = 0.5
    ticks: int = 60
    only: tuple[str, ...] = tuple(NAMES)


def up(k: int, was: float) -> float:
    return min(1.0, was + RATE * (k + 1))


def held(k: int, was: float) -> float:
    return was


def down(k: int, was: float) -> float:
    return max(0.0, was - 0.005 * (k + 1))


def release(world: World, k: int) -> None:
    world.stick = {}


def flag(**values: int) -> Each:
    """Enable, reset or emergency stop of the hand."""

    def each(world: World, k: int) -> None:
        for name, value in values.items():
            setattr(world, name, value)

    return each


def again(value: int, first: int, last: int, attribute: str = "enable", sound: int = 1) -> Each:
    """A switch is another for some ticks, and the stick stays where it is."""

    def each(world: World, k: int) -> None:
        setattr(world, attribute, value if first <= k < last else sound)

    return each


def turned(world: World, k: int) -> None:
    """The sticks are pulled the other way."""
    if k == 0:
        world.stick = {axis: -at for axis, at in world.stick.items()}


def drop(first: int = 0, last: int = 10**6) -> Each:
    """Joysticks are silent for some ticks."""

    def each(world: World, k: int) -> None:
        keys = joysticks(world)
        lost = first <= k < last
        world.change = lambda frame: [] if lost and frame[:3] in keys else [frame]

    return each


def joysticks(world: World) -> set[tuple[str, int, bool]]:
    return {world.key(one, own=False) for one in world.file["joysticks"].values()}


def spoilt(change: Callable[[World, Frame], Iterable[Frame]]) -> Each:
    """Frames of joysticks come otherwise."""

    def each(world: World, k: int) -> None:
        keys = joysticks(world)
        world.change = lambda frame: change(world, frame) if frame[:3] in keys else [frame]

    return each


def raw(of: Callable[[World, str], int]) -> Each:
    """A raw value in the place of that of every stick."""

    def each(world: World, k: int) -> None:
        for config in world.axes.values():
            command = config["command"]
            message = world.messages[world.file["joysticks"][command["joystick"]]["message"]]
            length = message.get_signal_by_name(command["signal"]).length
            values = world.raw.setdefault(command["joystick"], {})
            values[command["signal"]] = of(world, str(length))

    return each


def enable_code(code: int) -> Each:
    """Enable neither on nor off, where it has two bits."""

    def each(world: World, k: int) -> None:
        for section in world.file["joysticks"].values():
            if "enable" in section:
                signal = world.messages[section["message"]].get_signal_by_name(section["enable"])
                world.enable = code if signal.length == 2 else 0

    return each


def flags(neutral: int, negative: int, positive: int) -> Each:
    """Direction flags, or both directions of a rocker."""

    def each(world: World, k: int) -> None:
        for config in world.axes.values():
            command = config["command"]
            values = world.raw.setdefault(command["joystick"], {})
            if one := command.get("flags"):
                values |= {one["neutral"]: neutral, one["negative"]: negative}
                values[one["positive"]] = positive
            elif back := command.get("negative"):
                values |= {back: 200, command["signal"]: 200}

    return each


def counter(of: Callable[[int], int]) -> Each:
    """Alive counters of the joysticks as a function of the tick."""

    def each(world: World, k: int) -> None:
        for name, section in world.file["joysticks"].items():
            if "alive_counter" in section:
                world.raw.setdefault(name, {})[section["alive_counter"]] = of(k) & 255

    return each


def sender(first: int, last: int) -> Each:
    """Another node commands our valves."""

    def each(world: World, k: int) -> None:
        if first <= k < last:
            for axis, config in world.axes.items():
                key = world.valve(axis)
                length = world.messages[config["valve"]["message"]].length
                world.receive(Frame(*key, bytes(length)))

    return each


def failed(world: World, k: int) -> None:
    """Every valve frame of the tick before failed to leave."""
    if k == 0:
        valves = {world.valve(axis) for axis in world.axes}
        for frame in [one for one in world.left if one[:3] in valves]:
            world.guarded.send_failed(frame)


def stalled(world: World, k: int) -> None:
    if k == 0:
        world.n += 15
        world.guarded.stalled()


def gap(world: World, k: int) -> None:
    if k == 0:
        world.n += 15


def twin(world: World, frame: Frame) -> list[Frame]:
    """The stick is in neutral, but a twin of its frame says full."""
    stick, world.stick = world.stick, dict.fromkeys(world.axes, 1.0)
    frames = [world.joystick(name) for name in world.file["joysticks"]]
    world.stick = stick
    wrong = [one._replace(extended=not one.extended) for one in frames]
    wrong += [one._replace(can_id=one.can_id ^ 1 << 4) for one in frames]
    wrong += [one._replace(data=one.data[:-1]) for one in frames]
    wrong += [one._replace(data=one.data + b"\0") for one in frames]
    return [frame, *wrong]


def saw(k: int, was: float) -> float:
    return abs(k % 20 - 10) * 0.09


COUNTED = tuple(
    one
    for one in NAMES
    if one not in ("j1939-forwarder", "canopen-forwarder", "moog-forwarder", "cia402-forwarder")
)
STOPPED = 2.6  # stop_s and what falls


def goes_no_farther(name: str, kind: Kind) -> None:
    """Attack a deployment; from then on no axis may go farther than the bound of this kind."""
    if name not in kind.only:
        pytest.skip("the deployment has no such thing")
    world = World(name)
    signs = {axis: (-1) ** i for i, axis in enumerate(world.axes)}
    stick = {axis: kind.size * sign for axis, sign in signs.items()}
    if kind.before >= 0:
        world.go(REST)
        world.go(kind.before, **(stick if kind.before else {}))
    else:
        world.stick = stick
    was = {axis: abs(speed) for axis, speed in world.seen.items()}
    world.way = dict.fromkeys(world.axes, 0.0)
    for k in range(kind.ticks):
        kind.each(world, k)
        speeds = {axis: signs[axis] * kind.speed(k, was[axis]) for axis in world.axes}
        world.step(world.commands(**speeds))
    assert max(world.way.values()) <= kind.bound + 1e-9, world.way
