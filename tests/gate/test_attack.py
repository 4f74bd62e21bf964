"""Wrong outputs of many kinds between controller and gate, on shipped deployments.

Each kind plants, on every axis at once and in both directions, what a wrong controller would send,
whatever it was refused before, and states how far an axis may go from then on.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import pytest

from canshaper.codec.frame import Frame
from tests.gate.attacker import World

pytestmark = pytest.mark.slow

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
ONE = "a gateway's frame before the next tick"

KINDS = {
    # at rest, joysticks in neutral and enabled
    "jump from rest": Kind(lambda k, was: 1.0),
    "ramp from rest": Kind(up),
    "creep from rest": Kind(lambda k, was: 0.03),
    "one frame from rest": Kind(lambda k, was: 0.5 if k == 0 else 0.0, ticks=5),
    "saw tooth from rest": Kind(saw),
    "chatter around rest": Kind(lambda k, was: 0.06 * (-1) ** k),
    "slow swing around rest": Kind(lambda k, was: 0.05 * (k % 10 - 5) / 5),
    "enable is off": Kind(up, flag(enable=0)),
    "stick held, enable is off": Kind(up, flag(enable=0), before=20),
    # at the start
    "nothing received": Kind(up, drop(), before=-1),
    "held since the start": Kind(up, before=-1),
    "held since the start, enable comes later": Kind(up, again(0, 0, 20), before=-1),
    "held since the start, enable twice": Kind(up, again(0, 20, 30), before=-1),
    # stick held
    "faster than asked": Kind(up, before=20, bound=0.7, why="what was asked"),
    "against the stick at once": Kind(lambda k, was: -0.3, before=20),
    "against the stick by the rates": Kind(
        lambda k, was: max(-1, was - RATE * (k + 1)), before=20, bound=0.15, why="the way to zero"
    ),
    "jump to what is asked": Kind(lambda k, was: 1.0, size=1.0, before=1),
    "fall at once, not to zero": Kind(
        lambda k, was: 0.1,
        before=40,
        bound=0.13,
        why="with a motion a part of it may end at once: slower",
    ),
    "saw tooth of 25 Hz": Kind(
        lambda k, was: 0.1 if k % 2 else 0.5,
        before=40,
        bound=0.02,
        why="the frame that is as before",
    ),
    "slower than asked": Kind(lambda k, was: was * 0.8, before=40, bound=0.7, why="slower"),
    "the other way and back": Kind(lambda k, was: -0.05, before=40),
    # stick released
    "goes on": Kind(held, release, before=60, ticks=200, bound=2.8, why="tail"),
    "goes on after a tap": Kind(
        held, release, before=5, ticks=200, bound=0.75, why="distance, and the path of a motion"
    ),
    "falls too slowly": Kind(down, release, before=60, ticks=200, bound=2.8, why="tail"),
    "goes on faster": Kind(up, release, before=20, ticks=200, bound=1.6, why="tail, distance"),
    "after the tail": Kind(
        lambda k, was: 0.0 if k < 150 else 0.09 * min(5, k - 150),
        release,
        before=30,
        ticks=200,
        bound=0.02,
        why="nothing",
    ),
    "again within the tail": Kind(
        lambda k, was: max(0, was - RATE * k) if k < 20 else min(0.4, RATE * (k - 20)),
        release,
        before=30,
        ticks=200,
        bound=0.9,
        why="tail, distance",
    ),
    "reversed, output stays": Kind(held, turned, before=40, ticks=200, bound=1.6, why="distance"),
    "reversed, jump": Kind(
        lambda k, was: -0.5, turned, before=40, ticks=5, bound=0.02, why="through zero"
    ),
    # reasons to stop at once, in motion
    "enable released": Kind(held, flag(enable=0), before=40),
    "enable released, ramp down": Kind(down, flag(enable=0), before=40),
    "enable released for a tick": Kind(held, again(0, 0, 1), before=40),
    "enable released for a second": Kind(held, again(0, 0, 50), before=40, ticks=120),
    "second sender": Kind(held, sender(0, 1), before=40, ticks=120, bound=0.02, why=ONE),
    "second sender goes on": Kind(held, sender(0, 999), before=40, bound=0.02, why=ONE),
    "failed send": Kind(held, failed, before=40, ticks=120),
    "loop stalled": Kind(held, stalled, before=40, ticks=120, bound=0.0),
    "loop late by 0.3 s": Kind(
        held, gap, before=40, bound=0.7, why="asked all the time; it is the loop that says so"
    ),
    "emergency stop": Kind(held, flag(stop=1), before=40, only=("remote-forwarder",)),
    "emergency stop for a tick": Kind(
        held, again(1, 0, 1, "stop", 0), before=40, ticks=120, only=("remote-forwarder",)
    ),
    "emergency stop in error": Kind(held, flag(stop=2), before=40, only=("remote-forwarder",)),
    # reasons to stop shaped
    "silence, then no frames": Kind(held, drop(), before=60, ticks=20, bound=0.4, why="stop_s"),
    "silence": Kind(held, drop(), before=60, ticks=250, bound=STOPPED, why="stop_s"),
    "silence, then held again": Kind(
        lambda k, was: was if k > 200 else 0.0,
        drop(0, 30),
        before=40,
        ticks=260,
        bound=0.06,
        why="a gateway without frames: the last one holds",
    ),
    "silence, then at once again": Kind(
        held, drop(0, 20), before=60, ticks=300, bound=STOPPED, why="stop_s"
    ),
    "enable in error": Kind(
        held, enable_code(2), before=60, ticks=250, bound=STOPPED, why="stop_s"
    ),
    "enable not available": Kind(
        held, enable_code(3), before=60, ticks=250, bound=STOPPED, why="stop_s"
    ),
    "enable in error at rest": Kind(up, enable_code(2)),
    "counter stands": Kind(
        held, counter(lambda k: 7), before=60, ticks=250, bound=STOPPED, why="stop_s", only=COUNTED
    ),
    "counter jumps": Kind(
        held,
        counter(lambda k: 5 * k),
        before=60,
        ticks=250,
        bound=STOPPED,
        why="stop_s",
        only=COUNTED,
    ),
    "wrong length": Kind(
        held,
        spoilt(lambda w, f: [f._replace(data=f.data[:-1])]),
        before=60,
        ticks=250,
        bound=STOPPED,
        why="stop_s",
    ),
    "beyond the range": Kind(
        held,
        raw(lambda w, n: 1010 if n == "10" else 245 if n == "8" else -32768),
        before=60,
        ticks=250,
        bound=STOPPED,
        why="stop_s",
    ),
    "code Error": Kind(
        held,
        raw(lambda w, n: {"10": 1022, "8": 254}.get(n, 32766)),
        before=60,
        ticks=250,
        bound=STOPPED,
        why="stop_s",
        only=(*COUNTED, "j1939-forwarder"),
    ),
    "code NotAvailable at rest": Kind(
        up,
        raw(lambda w, n: {"10": 1023, "8": 255}.get(n, 32767)),
        only=(*COUNTED, "j1939-forwarder"),
    ),
    "flags contradict": Kind(
        held,
        flags(0, 1, 1),
        before=60,
        ticks=250,
        bound=STOPPED,
        why="stop_s",
        only=("j1939-forwarder",),
    ),
    "flags neutral, deflected": Kind(up, flags(1, 0, 1), only=("j1939-forwarder",)),
    # frames that are not the joystick's
    "twins say full": Kind(up, spoilt(twin)),
}


def attacked(name: str, kind: Kind) -> tuple[World, dict[str, float]]:
    """Way of every axis since the attack began, of all directions."""
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
    return world, world.way


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("what", KINDS)
def test_goes_no_farther(what: str, name: str) -> None:
    kind = KINDS[what]
    if name not in kind.only:
        pytest.skip("the deployment has no such thing")
    _, way = attacked(name, kind)
    assert max(way.values()) <= kind.bound + 1e-9, way
