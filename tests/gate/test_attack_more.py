"""Wrong outputs that need more than a stick: motion, reloads, liars, limits that are set."""

from collections.abc import Callable, Iterable

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.guarded import Guarded
from tests.gate.attacker import CONFIG, TICK_MS, Evil, World, loaded
from tests.gate.kinds import MOTION, NAMES, RATE, REST

pytestmark = pytest.mark.slow
ONE_STICK = [name for name in NAMES if name not in MOTION]


def rested(name: str) -> World:
    world = World(name)
    world.go(REST)
    world.way = dict.fromkeys(world.axes, 0.0)
    return world


def ramped(world: World, speed: float, ticks: int, axes: Iterable[str] = ()) -> None:
    """A wrong controller that moves axes by the rates up to a speed, whatever was refused."""
    signs = {axis: (-1) ** i for i, axis in enumerate(world.axes)}
    for k in range(ticks):
        at = min(speed, RATE * (k + 1))
        world.step(world.commands(**{axis: signs[axis] * at for axis in axes or world.axes}))


@pytest.mark.parametrize("name", ONE_STICK)
def test_another_axis_than_that_of_the_stick(name: str) -> None:
    """Swapped axes, and the other crane."""
    axes = list(World(name).axes)
    for i, moved in enumerate(axes):
        world = rested(name)
        world.stick = {moved: 0.8 * (-1) ** i}
        others = [axis for axis in axes if axis != moved]
        ramped(world, 0.7, 20, others)
        assert not any(world.way[axis] for axis in others), world.way


@pytest.mark.parametrize("name", NAMES)
def test_a_trip_stays_after_a_reload(name: str) -> None:
    world = rested(name)
    world.go(30, **{axis: 0.6 * (-1) ** i for i, axis in enumerate(world.axes)})
    world.enable = 0
    world.step()
    reloads(world)
    world.enable = 1
    ramped(world, 0.5, 60)
    world.go(5)  # enable was pressed before: after the reload, so that resets
    assert not any(world.way.values()), world.way


def reloads(world: World) -> None:
    """The file is read again."""
    before = world.guarded
    evil = Evil(loaded(CONFIG / f"{world.name}.yaml")[2])
    evil.carry_over(world.evil)
    world.evil, world.guarded = evil, Guarded(evil)
    world.guarded.carry_over(before)
    world.way = dict.fromkeys(world.axes, 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_a_reload_in_motion(name: str) -> None:
    """Held on: nothing moves until neutral was seen."""
    world = rested(name)
    world.go(30, **{axis: 0.6 * (-1) ** i for i, axis in enumerate(world.axes)})
    reloads(world)
    ramped(world, 0.5, 60)
    assert not any(world.way.values()), world.way


@pytest.mark.parametrize("name", NAMES)
def test_what_stands_in_the_place_of_a_refused_frame(name: str) -> None:
    world = rested(name)
    keys = {world.valve(axis): axis for axis in world.axes}
    world.evil.substitute = lambda frame: frame._replace(
        data=world.encode(keys[frame[:3]], frame.data, 0.5)
    )
    ramped(world, 0.5, 40)
    assert not any(world.way.values()), world.way


@pytest.mark.parametrize("name", NAMES)
def test_frames_that_are_of_no_tick(name: str) -> None:
    """Neither tick nor gateway has sent the frame; the stick is held, so a speed is asked for."""
    world = rested(name)
    world.go(30, **{axis: 0.6 * (-1) ** i for i, axis in enumerate(world.axes)})
    now = world.n * TICK_MS * 1_000_000
    for axis in world.axes:
        frame = next(one for one in world.left if one[:3] == world.valve(axis))
        for speed in (0.9, -0.5, 0.2):
            wrong = frame._replace(data=world.encode(axis, frame.data, speed))
            assert not world.guarded.passes(wrong, now), (axis, speed)


@pytest.mark.parametrize("name", NAMES)
def test_last_frames_move_nothing(name: str) -> None:
    world = rested(name)
    world.go(30, **{axis: 0.6 * (-1) ** i for i, axis in enumerate(world.axes)})
    frames = world.guarded.neutral_frames()
    keys = {world.valve(axis): axis for axis in world.axes}
    sound = world.evil.neutral_frames
    world.evil.neutral_frames = (
        lambda: [  # type: ignore[method-assign]
            frame._replace(data=world.encode(keys[frame[:3]], frame.data, 0.3)) for frame in sound()
        ]
    )
    assert not [one for one in world.guarded.neutral_frames() if one[:3] in keys], frames


@pytest.mark.parametrize("name", NAMES)
def test_a_maximum_that_was_set_binds(name: str) -> None:
    world = rested(name)
    for axis in world.axes:
        world.guarded._gate.axes[axis].of.ranges = {"limits.max_pct": (20.0, 80.0)}
    world.guarded.set({f"axes.{axis}.limits.max_pct": 40.0 for axis in world.axes})
    world.stick = {axis: 1.0 * (-1) ** i for i, axis in enumerate(world.axes)}
    top = 0.0
    signs = {axis: (-1) ** i for i, axis in enumerate(world.axes)}
    for k in range(30):
        at = min(0.6, RATE * (k + 1))
        world.step(world.commands(**{axis: signs[axis] * at for axis in world.axes}))
        top = max(top, *map(abs, world.seen.values()))
    assert top <= 0.4 + 0.013


@pytest.mark.parametrize("name", ["forwarder-robust", "j1939-forwarder"])
def test_a_frozen_stick_stops(name: str) -> None:
    world = rested(name)
    world.go(990, **{axis: 0.6 * (-1) ** i for i, axis in enumerate(world.axes)})
    world.go(20, **world.stick)
    world.way = dict.fromkeys(world.axes, 0.0)
    ramped(world, 0.6, 400)
    assert max(world.way.values()) <= 2.6 * 0.65, world.way


Added = Callable[[int], float]
ADDED: dict[str, tuple[str, str, Added, float, float]] = {
    # stick on, moved without one, speed by tick, bound in s of full speed: robust, sensor
    "more than it may add": ("slew", "near_far", lambda k: min(0.6, 0.05 * k), 0.8, 1.1),
    "in without end": ("slew", "near_far", lambda k: min(0.24, 0.02 * k), 0.8, 1.1),
    "lift": ("slew", "lift", lambda k: min(0.2, 0.02 * k), 0.0, 0.0),
}  # fmt: skip


@pytest.mark.parametrize("name", MOTION)
@pytest.mark.parametrize("what", ADDED)
def test_what_is_added(what: str, name: str) -> None:
    held, moved, speed, *bounds = ADDED[what]
    world = rested(name)
    world.stick = {held: 0.8}
    for k in range(600):
        world.step(world.commands(**{moved: speed(k)}))
    assert world.way[moved] <= bounds[MOTION.index(name)], world.way


@pytest.mark.parametrize("name", MOTION)
def test_nothing_is_added_against_a_stick(name: str) -> None:
    world = rested(name)
    world.stick = {"slew": 0.8, "near_far": 0.4}
    for k in range(30):
        world.step(world.commands(near_far=-min(0.2, 0.05 * (k + 1))))
    assert not world.way["near_far"]


@pytest.mark.parametrize("name", NAMES)
def test_garbage_received_raises_nothing(name: str) -> None:
    world = rested(name)
    for number in (0, 0x7FF, 0x1FFFFFFF, 272, 273, 0x110, 0x190, 0x0CFDD633):
        for extended in (False, True):
            for n in (0, 1, 7, 8, 12, 64):
                for bus in (*world.file["buses"], "nowhere"):
                    world.receive(Frame(bus, number, extended, b"\xff" * n))
    world.go(3)


ENDLESS = {
    # stick on, moved without one, speed by tick
    "slew": ("near_far", lambda k: min(0.24, 0.02 * (k % 250)) if k % 250 < 248 else 0.0),
    "near_far": ("slew", lambda k: 0.2 * (1 if k // 50 % 2 else -1)
                 * min(1, k % 50 / 6, (50 - k % 50) / 6)),
}  # fmt: skip


@pytest.mark.parametrize("moved", ENDLESS)
def test_what_is_added_ends_after_its_time(moved: str) -> None:
    """With pauses of a frame, by hand of one who holds the other stick: 6 s of 0.25 at most."""
    held, speed = ENDLESS[moved]
    world = rested("forwarder-robust")
    world.stick = {held: 0.8}
    for k in range(850):
        world.step(world.commands(**{moved: speed(k)}))
    assert world.way[moved] <= 1.6, world.way


def test_a_saw_tooth_after_a_tap_goes_no_farther() -> None:
    """A tap of 0.12 s: 1.62 s of full speed and a fall, as after any other tap."""
    world = rested("forwarder-robust")
    world.go(6, slew=1.0)
    world.stick = {}
    speed = world.seen["slew"]
    for k in range(150):
        if k < 12 and speed < 0.9:
            speed = min(1.0, speed + 0.095)
        else:
            speed = speed - 0.1 if k % 2 else min(1.0, speed + 0.1)
        world.step(world.commands(slew=speed))
    assert world.way["slew"] <= 1.75, world.way


@pytest.mark.parametrize(("name", "bit"), [("forwarder-robust", "AntiSwayOff"),
                                           ("j1939-forwarder", "Button3")])  # fmt: skip
def test_a_tap_with_anti_sway_off_goes_no_farther(name: str, bit: str) -> None:
    world = rested(name)
    world.raw = {"left": {bit: 1}}
    world.go(5)
    world.go(10, slew=1.0)
    world.stick, speed = {}, world.seen["slew"]
    for k in range(150):
        world.step(world.commands(slew=min(1.0, speed + RATE * (k + 1))))
    assert world.way["slew"] <= 1.85, world.way


@pytest.mark.parametrize("name", ["j1939-forwarder", "canopen-forwarder"])
def test_after_the_valves_timeout_speed_rises_from_rest(name: str) -> None:
    """No frame for 0.3 s, the stick held: the valve stands, and is opened at once."""
    world = rested(name)
    world.go(100, slew=1.0)
    for _ in range(15):
        world.step(lambda frames: [one for one in frames if one[:3] != world.valve("slew")])
    assert not world.seen["slew"]
    world.step()
    assert world.seen["slew"] <= 0.12
