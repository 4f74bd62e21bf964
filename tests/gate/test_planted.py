"""One wrong command reaches no valve: planted in sound drives of every shipped deployment."""

import functools
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.codec.sent import SentMessage
from canshaper.codec.signals import raw_limits
from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded
from canshaper.controller.runner import AxisControl
from canshaper.gate.build import record_of
from canshaper.gate.fields import word_of
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import Reason, State
from canshaper_sim.hand import Hand, Held
from canshaper_sim.plant import PlantNode
from tests.faults import shipped, variants

pytestmark = pytest.mark.slow

MOMENTS = 6  # of each kind, on each deployment
BEGIN_S, MOVE_S, REST_S = 5.0, 8.0, 7.0


@dataclass
class Drive:
    """What comes in, tick by tick, and where its joysticks are.

    Attributes:
        frames: what comes in before each tick; ``released`` and ``pressed`` are the same frames
            with enable released, and with the emergency stop pressed.
        steps: commands to the valves that a sound controller makes, in steps.
    """

    deployment: Deployment
    frames: list[list[Frame]] = field(default_factory=list)
    released: list[list[Frame]] = field(default_factory=list)
    pressed: list[list[Frame]] = field(default_factory=list)
    steps: list[dict[str, int]] = field(default_factory=list)

    @property
    def tick_ns(self) -> int:
        return self.deployment.config.tick_ms * 1_000_000


@functools.cache
def drive(name: str) -> Drive:
    """A drive of random strokes, and a long rest behind it."""
    if name in shipped.NAMES:
        deployment = load_deployment(shipped.CONFIG / f"{name}.yaml")
    else:
        deployment = variants.machine(name)[1]
    made, rng = Drive(deployment), random.Random(name)
    hands = Hand(deployment), Hand(deployment)
    plant = None if name == "two-cranes" else PlantNode(deployment)
    controller = Controller(deployment)
    joysticks, until = dict.fromkeys(deployment.axes, 0.0), dict.fromkeys(deployment.axes, BEGIN_S)
    stop = deployment.emergency_stop
    presses = (
        SentMessage(stop.config.bus, stop.message, None, stop.protection).sender() if stop else None
    )
    feedback: list[Frame] = []
    tick_ms = deployment.config.tick_ms
    for number in range(round((BEGIN_S + MOVE_S + REST_S) * 1000) // tick_ms):
        time_ms, now_ns = number * tick_ms, number * made.tick_ns
        for axis in joysticks:
            if time_ms >= 1000 * until[axis]:
                joysticks[axis] = rng.choice((0.0, rng.uniform(-1, 1), 1.0, -1.0))
                until[axis] += rng.uniform(0.3, 1.5)
            if time_ms >= 1000 * (BEGIN_S + MOVE_S):
                joysticks[axis] = 0.0
        frames = [*hands[0].frames(time_ms, Held(joysticks, enable=True)), *feedback]
        made.frames.append(frames)
        made.released.append([*hands[1].frames(time_ms, Held(joysticks, enable=False)), *feedback])
        others = [f for f in frames if not stop or f.can_id != stop.message.frame_id]
        if presses and stop and len(others) < len(frames):
            others.insert(0, presses.frame({stop.config.signal: 1}))
        made.pressed.append(others)
        left = [f for f in (controller.receive(f, now_ns) for f in frames) if f]
        left += controller.tick(now_ns)
        made.steps.append({n: runner.axis.raw for n, runner in controller.axes.items()})
        feedback = []
        if plant:
            for frame in left:
                plant.receive(frame)
            plant.advance(tick_ms / 1000.0)
            feedback = plant.feedback()
    return made


Wrong = Callable[[dict[str, Any], AxisControl], None]


class Planted:
    """A drive up to a moment, with one wrong command from then on."""

    def __init__(self, made: Drive, axis: str, at: int, frames: list[list[Frame]]) -> None:
        self.made, self.at, self.frames = made, at, frames
        self.controller = Controller(made.deployment)
        self.runner = self.controller.axes[axis]
        self.guarded = Guarded(self.controller)
        self.left: list[Frame] = []

    def run(self, wrong: Wrong) -> list[Frame]:
        """Plant it with the next command; frames of this valve that leave with it and behind it."""
        codec = self.runner.bound.valve
        sound, key = self.runner._put, codec.message.key

        def put(raw: dict[str, Any], steps: int) -> None:
            self.runner._put = sound
            sound(raw, steps)
            wrong(raw, self.runner)

        try:
            for number in range(self.at + 3):
                now_ns = number * self.made.tick_ns
                if number == self.at:
                    self.left.clear()
                frames = self.frames if number >= self.at else self.made.frames
                passed = [self.guarded.receive(f, now_ns) for f in frames[number]]
                if number == self.at:
                    self.runner._put = put
                    passed = []
                self.left += [f for f in passed if f]
                self.left += self.guarded.tick(now_ns)
        finally:
            self.runner._put = sound
        return [frame for frame in self.left if frame[:3] == key]

    def caught(self, wrong: Wrong) -> bool:
        """Whether no frame has moved the axis, and it tripped for that."""
        codec = self.runner.bound.valve
        layout = codec.message.fields.layout
        for frame in self.run(wrong):
            assert codec.read(layout.decode(frame.data)) == 0
        assert self.controller.counters.last_fault is FrameFault.OUTPUT_REFUSED
        assert sum("output=refused" in event.text for event in self.controller.events) == 1
        axis = self.runner.axis
        return axis.state is State.TRIPPED and axis.reason in (
            Reason.OUTPUT_REFUSED,
            Reason.ENABLE_LOST,
            Reason.EMERGENCY_STOP,
        )


def _put(steps: int) -> Wrong:
    return lambda raw, runner: runner.bound.valve.put(raw, steps)


def _signal(runner: AxisControl) -> Any:
    name = runner.bound.config.valve.signal
    return next(s for s in runner.bound.valve_message.signals if s.name == name)


def _full(rng: random.Random, made: Drive, axis: str, at: int) -> Wrong | None:
    """Full speed in one step, from rest or nearly so."""
    full = made.deployment.axes[axis].valve.steps
    return _put(rng.choice((-full, full))) if abs(made.steps[at][axis]) < 0.3 * full else None


def _beyond(rng: random.Random, made: Drive, axis: str, at: int) -> Wrong | None:
    """Beyond the range of the DBC, where the bits of the signal reach farther."""
    valve = made.deployment.axes[axis].valve

    def wrong(raw: dict[str, Any], runner: AxisControl) -> None:
        signal = _signal(runner)
        valve.put(raw, valve.steps)
        room = raw_limits(signal)[1] - raw[signal.name]
        if room > 0:
            raw[signal.name] += rng.randint(1, min(room, valve.steps))

    return wrong


def _against(_rng: random.Random, made: Drive, axis: str, at: int) -> Wrong | None:
    """The sign the other way round."""
    steps = made.steps[at][axis]
    fast = abs(steps) > 0.4 * made.deployment.axes[axis].valve.steps
    return _put(-steps) if fast else None


def _stale(rng: random.Random, made: Drive, axis: str, at: int) -> Wrong | None:
    """A command, however small, when no one has commanded anything within the tail."""
    full = made.deployment.axes[axis].valve.steps
    rests = at * made.tick_ns > (BEGIN_S + MOVE_S + 3.5) * 1e9
    return _put(rng.choice((-1, 1)) * rng.randint(1, full)) if rests else None


def _goes_on(_rng: random.Random, made: Drive, axis: str, at: int) -> Wrong | None:
    """What moves goes on, with enable released or the emergency stop pressed."""
    steps = made.steps[at - 1][axis]
    due = made.frames[at] != made.pressed[at] or not made.deployment.emergency_stop
    return _put(steps) if due and steps and made.steps[at][axis] else None


def _flip(rng: random.Random, made: Drive, axis: str, at: int) -> Wrong | None:
    """A bit of the command is wrong, and it means far more or less speed, or the other way."""
    valve = made.deployment.axes[axis].valve

    def wrong(raw: dict[str, Any], runner: AxisControl) -> None:
        signal, before = _signal(runner), valve.read(raw)
        bits = [1 << n for n in range(signal.length)]
        rng.shuffle(bits)
        low, high = raw_limits(signal)
        for bit in bits:
            flipped = {**raw, signal.name: raw[signal.name] ^ bit}
            if not low <= flipped[signal.name] <= high:  # the highest of one with a sign
                flipped[signal.name] += -2 * bit if flipped[signal.name] > high else 2 * bit
            after = valve.read(flipped)
            if after is None or (
                before is not None and abs(after) > abs(before) + 0.3 * valve.steps
            ):
                raw.update(flipped)
                return
        valve.put(raw, valve.steps)  # all bits together

    return wrong if abs(made.steps[at][axis]) < 0.3 * valve.steps else None


KINDS = {f.__name__[1:]: f for f in (_full, _beyond, _against, _stale, _flip)}
CASES = [(name, kind) for name in (*shipped.NAMES, "protected") for kind in KINDS]
# In a gateway a frame with enable released is neutral whatever the axes have put.
CASES += [(name, "released") for name in (*shipped.NAMES, "protected") if "gateway" not in name]
CASES += [("protected", "pressed")]


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_a_wrong_command_is_caught(name: str, kind: str) -> None:
    made, rng = drive(name), random.Random(f"{name} {kind}")
    choose = KINDS.get(kind, _goes_on)
    frames = {"released": made.released, "pressed": made.pressed}.get(kind, made.frames)
    planted = 0
    for _ in range(5000):
        if planted == MOMENTS:
            break
        axis = rng.choice(list(made.deployment.axes))
        at = rng.randrange(round(BEGIN_S * 1e9) // made.tick_ns, len(made.frames) - 3)
        if (at + 1) % made.deployment.axes[axis].period_ticks:
            continue
        if wrong := choose(rng, made, axis, at):
            planted += 1
            assert Planted(made, axis, at, frames).caught(wrong), (axis, at)
    assert planted == MOMENTS


class Spoiled(Controller):
    """Whose frames to one valve are spoilt from a moment on, behind all that computes them.

    Attributes:
        spoil: what leaves in the place of a frame.
    """

    spoil: Callable[[Frame], list[Frame]] | None = None

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        for frame in super().tick(now_ns, missed):
            yield from self.spoil(frame) if self.spoil else [frame]

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        passed = super().receive(frame, arrived_ns)
        return self.spoil(passed)[-1] if self.spoil and passed else passed


def _free_bit(deployment: Deployment, frame: Frame) -> int:
    """A bit of a valve frame that no signal of ours has; the lowest one."""
    valve = record_of(deployment).valves[frame[:3]]
    free = ~valve.ours & (1 << 8 * valve.length) - 1
    return free & -free


def _spoilt(kind: str, deployment: Deployment, frame: Frame) -> list[Frame]:
    bus, can_id, extended, data = frame
    if kind == "shorter":
        return [frame._replace(data=data[:-1])]
    if kind == "longer":
        return [frame._replace(data=data + bytes(1))]
    if kind == "another bit":
        word = int.from_bytes(data, "little") ^ _free_bit(deployment, frame)
        return [frame._replace(data=word.to_bytes(len(data), "little"))]
    if kind == "another bus":
        return [Frame(f"{bus}-2", can_id, extended, data)]
    return [Frame(bus, can_id ^ 0x1000, True, data)]


SPOILT = ("shorter", "longer", "another bit", "another bus", "another identifier")


@pytest.mark.parametrize("kind", SPOILT)
@pytest.mark.parametrize("name", shipped.NAMES)
def test_a_frame_that_is_not_ours_does_not_leave(name: str, kind: str) -> None:
    made = drive(name)
    keys = {axis.valve.message.key for axis in made.deployment.axes.values()}
    free = {key: ~valve.ours for key, valve in record_of(made.deployment).valves.items()}
    lengths = {key: valve.length for key, valve in record_of(made.deployment).valves.items()}
    moving = [n for n, steps in enumerate(made.steps) if all(steps.values()) and n > 300]
    moving = moving or [n for n, steps in enumerate(made.steps) if any(steps.values())][100:]
    at = random.Random(f"{name} {kind}").choice(moving)
    controller = Spoiled(made.deployment)
    guarded = Guarded(controller)
    for number in range(at + 4):
        now_ns = number * made.tick_ns
        if number == at:

            def spoil(frame: Frame) -> list[Frame]:
                if frame[:3] not in keys:
                    return [frame]
                if (
                    kind == "another bit"
                    and not free[frame[:3]] & (1 << 8 * lengths[frame[:3]]) - 1
                ):
                    return [frame]  # all of them are ours
                return _spoilt(kind, made.deployment, frame)

            controller.spoil = spoil
        left = [f for f in (guarded.receive(f, now_ns) for f in made.frames[number]) if f]
        left += guarded.tick(now_ns)
        if number >= at:
            for frame in left:
                assert frame[:3] in {*keys, *guarded._gate.record.others}
                if frame[:3] in keys:
                    assert len(frame.data) == lengths[frame[:3]]
                    _, axes = guarded._gate.valves[frame[:3]]
                    steps = {axis.of.command.steps(word_of(frame.data)) for axis in axes}
                    assert steps == {0} or kind == "another bit"


@pytest.mark.parametrize("name", [*shipped.NAMES, "protected"])
def test_what_a_sound_controller_sends_passes(name: str) -> None:
    made = drive(name)
    deployment = load_deployment(made.deployment.path)  # whose messages keep nothing of before
    controller = Controller(deployment)
    guarded = Guarded(controller)
    for number, frames in enumerate(made.frames):
        now_ns = number * made.tick_ns
        for frame in frames:
            guarded.receive(frame, now_ns)
        for _ in guarded.tick(now_ns):
            pass
    assert controller.counters.last_fault is not FrameFault.OUTPUT_REFUSED
    moved = {n for steps in made.steps for n, s in steps.items() if s}
    assert moved == made.deployment.axes.keys()
