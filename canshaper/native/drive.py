"""A random drive of any deployment, and the inner state of its controller: to compare Python and C.

A drive has joystick frames, most of them good, some with a fault. It needs no simulated crane. The
same seed gives the same drive.
"""

import random
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

from canshaper.codec.frame import Frame, MessageKey
from canshaper.codec.velocity import VelocitySignal
from canshaper.controller.axis_control import AxisControl
from canshaper.controller.controller import Controller
from canshaper.controller.couplings import MotionControl
from canshaper.gate.cycle import Standstill
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.machine.joysticks import BoundJoystick
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.limit_aware import LimitAware
from canshaper.shaping.shapers.smoothing import FirstOrder, SCurve

# Time from the arrival of a frame to the next tick.
READ_NS = 1_000
BEGIN_NS = 1_000_000_000


@dataclass
class Tick:
    """One tick of a drive: what happened since the tick before.

    Attributes:
        now_ns: time of the tick.
        missed: number of ticks that were left out before it.
        frames: received frames in order, each ``READ_NS`` before the tick.
        stalled: the loop stood still before the tick, as the daemon finds it.
        failed: valve frame of the tick before that could not be sent, or None.
    """

    now_ns: int
    missed: int
    frames: list[Frame]
    stalled: bool = False
    failed: Frame | None = None


@dataclass
class _Hand:
    """An operator's hand on one joystick, and the state of the joystick's sender."""

    wanted: dict[str, float]
    held: dict[str, float] = field(default_factory=dict)
    silent: int = 0  # number of messages still to leave out
    resting: int = 0  # ticks still to rest in neutral
    count: int = 0
    enable: int = 1
    reset: int = 0
    off: int = 0


class Driven(Protocol):
    """A controller in any language."""

    def stalled(self) -> None:
        """Note that the loop stood still: no input is trusted until it comes again."""

    def send_failed(self, frame: Frame, /) -> None:
        """Note that a valve frame could not be sent."""

    def receive(self, frame: Frame, now_ns: int, /) -> object:
        """Take a received frame."""

    def tick(self, now_ns: int, missed: int = 0) -> Iterable[Frame]:
        """Return the frames to send now; ``missed`` ticks were left out before."""


def play(tick: Tick, controller: Driven) -> list[Frame]:
    """Give a tick of a drive to a controller; return the frames that it sends."""
    if tick.failed is not None:
        controller.send_failed(tick.failed)
    if tick.stalled:
        controller.stalled()
    for frame in tick.frames:
        controller.receive(frame, tick.now_ns - READ_NS)
    return list(controller.tick(tick.now_ns, tick.missed))


def valve_keys(deployment: Deployment) -> list[MessageKey]:
    """Return (bus, id, extended) of each valve message once, in the order of the axes."""
    return list(dict.fromkeys(axis.valve.message.key for axis in deployment.axes.values()))


def random_drive(deployment: Deployment, seed: str, ticks: int) -> Iterator[Tick]:
    """Yield so many ticks of a drive, which is the same for the same seed."""
    source = random.Random(seed)
    tick_ns = deployment.config.tick_ms * 1_000_000
    hands = {
        name: _Hand(dict.fromkeys((one.name for one in bound.velocities), 0.0))
        for name, bound in deployment.joysticks.items()
    }
    radii = [one.radius for one in deployment.motions.values() if one.radius]
    middles = {
        one.key: 0.5 * ((one.signal.minimum or 0) + (one.signal.maximum or 0)) for one in radii
    }
    valves, standstill = valve_keys(deployment), Standstill(deployment)
    most = standstill.limit_ns // tick_ns  # ticks from one to the next that are no standstill
    now_ns, late, stands = BEGIN_NS, 0, False
    for _ in range(ticks):
        late = 60 if source.random() < 0.001 else max(late - 1, 0)
        missed = source.choice((0, 0, 1, 2) if late else (0,) * 300 + (1, 2, 5))
        if stands:
            missed = source.choice((most - 1, most, 500))
        now_ns += tick_ns * (1 + missed)
        stalled, standstill.last_ns = standstill.over(now_ns), now_ns
        frames = []
        for name, bound in deployment.joysticks.items():
            frames += _joystick_frames(source, bound, hands[name])
        for radius in radii:
            if source.random() < 0.97:
                middles[radius.key] += source.uniform(-0.01, 0.01)
                code = round((middles[radius.key] - radius.signal.offset) / radius.signal.scale)
                if source.random() < 0.003:
                    code = source.getrandbits(radius.signal.length - 1)
                frames.append(_frame(radius, {radius.signal.name: code}))
        frames += _strange_frames(source, deployment)
        source.shuffle(frames)
        failed = Frame(*source.choice(valves), b"") if source.random() < 0.0003 else None
        stands = source.random() < 0.0002
        yield Tick(now_ns, missed, frames, stalled, failed)


def _joystick_frames(source: random.Random, bound: BoundJoystick, hand: _Hand) -> list[Frame]:
    """Return the frames of one joystick in a tick: none, one or two."""
    config = bound.config
    if hand.silent > 0:
        hand.silent -= 1
        return []
    hand.count += 1
    if source.random() < 0.001:  # the switches change while no message comes
        hand.silent, hand.enable = source.randint(1, 15), source.choice((0, 1, 1))
        hand.count += source.randint(0, 9)
        return []
    _move(source, hand)
    if source.random() < 0.003:
        hand.count += source.choice((-1, 1, 2, 3, 7, 100))
        hand.enable = source.choice((0, 1, 1, 1))
    if source.random() < 0.002:
        hand.enable = source.choice((0, 1, 1, 2, 3))
    elif hand.enable != 1 and source.random() < 0.1:
        hand.enable = 1
    hand.off ^= source.random() < 0.003
    hand.reset ^= source.random() < 0.01
    raw: dict[str, Any] = {}
    for one in bound.velocities:
        assert isinstance(one, VelocitySignal)  # an export has no other kind
        signal = bound.message.get_signal_by_name(one.name)
        raw[one.name] = round((hand.held[one.name] * one.full - one.offset) / one.scale)
        if source.random() < 0.001:
            low = -(1 << (signal.length - 1)) if signal.is_signed else 0
            any_code = source.randint(low, low + (1 << signal.length) - 1)
            raw[one.name] = source.choice((low, any_code, *list(one.special)[:2]))
    raw |= {config.reset: hand.reset} if config.reset else {}
    raw |= {config.anti_sway_off: hand.off} if config.anti_sway_off else {}
    raw |= {bound.enable: hand.enable} if bound.enable else {}
    if bound.protection.counter:
        raw[bound.protection.counter] = hand.count % bound.protection.counts
    frame = _frame(bound, raw)
    if source.random() < 0.002:
        frame = frame._replace(data=frame.data[: source.randint(0, 7)])
    return [frame] * (2 if source.random() < 0.002 else 1)


def _move(source: random.Random, hand: _Hand) -> None:
    """Move a joystick as an operator does: strokes, taps with a pause after them, a jerk."""
    hand.resting = max(0, hand.resting - 1)
    if source.random() < 0.004:
        hand.resting = source.randint(20, 150)
    for name, wanted in hand.wanted.items():
        if not hand.resting and source.random() < 0.03:
            some = source.choice((source.uniform(-1.0, 1.0), source.uniform(-0.1, 0.1)))
            hand.wanted[name] = source.choice((0.0, 0.0, 1.0, -1.0, some, some))
        elif hand.resting:
            tap = source.random() < 0.02
            hand.wanted[name] = source.uniform(-0.5, 0.5) if tap else 0.0
        before = hand.held.get(name, 0.0)
        hand.held[name] = before + max(-0.2, min(0.2, wanted - before))


def _frame(bound: BoundInput, raw: dict[str, Any]) -> Frame:
    """Return a frame of a message; signals without a value are 0."""
    whole = dict.fromkeys((signal.name for signal in bound.message.signals), 0)
    return Frame(*bound.key, bound.layout.encode(whole | raw))


def _strange_frames(source: random.Random, deployment: Deployment) -> list[Frame]:
    """Return frames with unknown ids; seldom one with the id of a valve message."""
    frames, bus = [], next(iter(deployment.config.buses))
    if source.random() < 0.01:
        frames.append(Frame(bus, source.randint(0x500, 0x6FF), False, source.randbytes(8)))
    if source.random() < 0.0005:
        axis = source.choice([*deployment.axes.values()])
        frames.append(Frame(*axis.valve.message.key, bytes(axis.valve_message.length)))
    return frames


# fmt: off
NAMES = (
    "state", "reason", "stopping", "was_enabled", "was_reset", "angle", "rate", "twin_angle",
    "twin_rate", "unlimited", "value", "slope", "offset", "joins", "bypassed", "steps", "setpoint",
    "path", "applied", "commanded", "command", "ramp", "own_ramp", "carry", "dropped_at", "ran",
    "side", "due", "left", "no_run_on", "crossed", "added_left", "rested", "asked", "unattended",
    "recent_low", "recent_high", "demanded_low", "demanded_high", "added",
)
# fmt: on
# The C stops counting ticks here: no counter overflows while a machine rests for years.
MOST_TICKS = 1_000_000_000


def rows(controller: Controller) -> list[list[float]]:
    """Return a row of inner state for each axis, by ``NAMES``, then a row for each motion."""
    return [*map(_axis_row, controller.axes.values()), *map(_motion_row, controller.motions)]


def _axis_row(control: AxisControl) -> list[float]:
    axis = control.axis
    states, transfer, stage = axis.states, axis.transfer, axis.stage
    shaper, sway, output, small = transfer.shaper, axis.sway, axis.output, stage.small
    twin = shaper._twin if isinstance(shaper, LimitAware) else None
    value = shaper._command if isinstance(shaper, Gff) else 0.0
    if isinstance(shaper, FirstOrder | SCurve):
        value = shaper._value
    row: list[float] = [
        states.state,
        states.reason,
        states._stopping,
        states._was_enabled,
        states._was_reset,
        sway.angle if sway else 0.0,
        sway.rate if sway else 0.0,
        twin.angle if twin else 0.0,
        twin.rate if twin else 0.0,
        shaper._unlimited if isinstance(shaper, LimitAware) else 0.0,
        value,
        shaper._slope if isinstance(shaper, SCurve) else 0.0,
        transfer.offset,
        transfer._joins,
        transfer._bypassed,
        output.steps,
        output.setpoint,
        output.path,
        output.applied,
        output.commanded,
        axis.demand,
        stage.ramp,
        stage._own_ramp,
        stage._carry,
        stage._dropped_at,
        stage._ran,
        stage._side,
        small._due,
        small._left,
        max(stage._no_run_on, -MOST_TICKS),
        min(stage._crossed, MOST_TICKS),
        max(axis.added_time._left, -MOST_TICKS),
        min(axis.added_time._rested, MOST_TICKS),
        axis.added_time.asked,
        axis.added_time.unattended,
        stage._recent.low,
        stage._recent.high,
        stage._demanded.low,
        stage._demanded.high,
        control.added,
    ]
    return [float(one) for one in row]


def _motion_row(control: MotionControl) -> list[float]:
    motion = control.motion
    radius = motion._radius_m
    row = [motion._weight, -1.0 if radius is None else radius]
    for one in (motion.slew, motion.near_far):
        row += [one.added, one.reached, one.way, one.ahead_s, one.joins] if one else [0.0] * 5
    return [float(one) for one in row]
