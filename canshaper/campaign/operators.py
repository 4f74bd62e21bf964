"""Operators and faults of a drive, drawn at random."""

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import TypeVar

import numpy as np

from canshaper.codec.frame import Frame
from canshaper.design.lockstep import Joysticks
from canshaper_sim.axes import WITHOUT_SWAY
from canshaper_sim.operator import random_script, reach_s
from canshaper_sim.strokes import Script, Stroke

# After the last stroke: the dwell of the residual swing, and over one period to measure it in.
REST_S = 5.0
_START_S = 0.5
_RAMP_S = (0.1, 0.4)
_LEVEL = (0.25, 1.2)  # those above 1 are clamped: full deflection is frequent
_RANDOM_S = 15.0

T = TypeVar("T")


class Draw:
    """Uniform random numbers; ``sequence`` is their seed."""

    def __init__(self, sequence: np.random.SeedSequence) -> None:
        self._source = np.random.Generator(np.random.PCG64(sequence))

    def between(self, low: float, high: float) -> float:
        """Draw a number from low to high."""
        return low + (high - low) * float(self._source.random())

    def one_of(self, choices: Sequence[T]) -> T:
        """Draw one of these, all equally likely."""
        return choices[int(self.between(0.0, len(choices)))]


class _Hand:
    """An operator's hand, whose strokes keep the boom within its reach."""

    def __init__(self, draw: Draw, axes: Sequence[str]) -> None:
        self._draw, self._reach_s = draw, reach_s(axes)
        self._travel_s: dict[str, float] = {}
        self.strokes: list[Stroke] = []

    def stroke(self, axis: str, start_s: float, duration_s: float, level: float) -> Stroke:
        """Add a stroke and return it; reverse or shorten one that would leave the reach."""
        low_s, high_s = self._reach_s[axis]
        travel_s = self._travel_s.get(axis, 0.0)
        if not low_s <= travel_s + level * duration_s <= high_s:
            level = -level
        room_s = high_s - travel_s if level > 0.0 else travel_s - low_s
        ramp_s = min(self._draw.between(*_RAMP_S), duration_s)
        duration_s = max(ramp_s, min(duration_s, room_s / abs(level)))
        self._travel_s[axis] = travel_s + level * duration_s
        stroke = Stroke(axis, start_s, duration_s, level, ramp_s)
        self.strokes.append(stroke)
        return stroke

    def level(self) -> float:
        """Draw a deflection in either direction."""
        return min(1.0, self._draw.between(*_LEVEL)) * self._draw.one_of((-1, 1))


def _random(draw: Draw, axes: Sequence[str]) -> Sequence[Stroke]:
    """Plateaus, reversals and pauses of all axes."""
    return random_script(int(draw.between(0.0, 2**31)), _RANDOM_S, axes).strokes


def _taps(draw: Draw, axes: Sequence[str]) -> Sequence[Stroke]:
    """Short strokes of one axis, one after the other."""
    hand, axis, at_s = _Hand(draw, axes), draw.one_of(_swinging(axes)), _START_S
    for _ in range(draw.one_of((2, 3, 4, 5))):
        stroke = hand.stroke(axis, at_s, draw.between(0.12, 0.6), hand.level())
        at_s = stroke.end_s + draw.between(0.2, 1.5)
    return hand.strokes


def _reversals(draw: Draw, axes: Sequence[str]) -> Sequence[Stroke]:
    """To and fro on one axis, without a pause."""
    hand, axis, at_s, level = _Hand(draw, axes), draw.one_of(_swinging(axes)), _START_S, 0.0
    for _ in range(draw.one_of((2, 3, 4))):
        size = abs(hand.level())
        level = -size if level > 0.0 else size
        stroke = hand.stroke(axis, at_s, draw.between(0.5, 1.8), level)
        at_s, level = at_s + stroke.duration_s, stroke.level
    return hand.strokes


def _both(draw: Draw, axes: Sequence[str]) -> Sequence[Stroke]:
    """A stroke of each of two axes, at once or one a little later."""
    hand, at_s = _Hand(draw, axes), _START_S
    for axis in _swinging(axes)[:2]:
        hand.stroke(axis, at_s, draw.between(0.8, 3.0), hand.level())
        at_s = _START_S + draw.between(0.0, 1.2)
    return hand.strokes


def _swinging(axes: Sequence[str]) -> Sequence[str]:
    return [axis for axis in axes if axis not in WITHOUT_SWAY] or axes


def _resting(
    strokes: Callable[[Draw, Sequence[str]], Sequence[Stroke]],
) -> "Callable[[Draw, Sequence[str], str], Script]":
    """Return a function that makes a script of these strokes and a rest at the end."""

    def script(draw: Draw, axes: Sequence[str], name: str) -> Script:
        drawn = tuple(strokes(draw, axes))
        end_s = max((stroke.end_s for stroke in drawn), default=0.0)
        return Script(name, drawn, end_s + REST_S)

    return script


OPERATORS: Mapping[str, Callable[[Draw, Sequence[str], str], Script]] = {
    "random": _resting(_random),
    "taps": _resting(_taps),
    "reversals": _resting(_reversals),
    "both": _resting(_both),
}
"""Operators by name; each takes the random numbers, the axes of the crane and the script's name."""


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes:
        name: kind of fault; "" for none.
        disturb: puts a disturbed bus behind the joysticks; None for a good bus.
        sensor: parameters of the sway sensors that the fault changes.
    """

    name: str
    disturb: Callable[[Joysticks], Joysticks] | None = None
    sensor: dict[str, float] = field(default_factory=dict)


class _Disturbed:
    """Joysticks behind a bus that is disturbed for a part of the drive.

    Args:
        joysticks: source of the frames.
        kind: lost, late (by a tick) or garbled (a wrong bit): what happens to a disturbed frame.
        share: share of the frames that are disturbed.
        ms: begin and end of the disturbance.
        seed: seed of the choice of frames.
    """

    def __init__(
        self, joysticks: Joysticks, kind: str, share: float, ms: tuple[float, float], seed: int
    ) -> None:
        self._joysticks, self._kind, self._share, self._ms = joysticks, kind, share, ms
        self._random = random.Random(seed)
        self._late: list[Frame] = []

    def frames_of_tick(self, time_ms: int, tick_ms: int) -> Sequence[Frame]:
        """Return the frames that came since the last tick, in order; the late ones first."""
        arrived, self._late = self._late, []
        for frame in self._joysticks.frames_of_tick(time_ms, tick_ms):
            hit = self._random.random() < self._share
            if not hit or not self._ms[0] <= time_ms < self._ms[1]:
                arrived.append(frame)
            elif self._kind == "late":
                self._late.append(frame)
            elif self._kind == "garbled":
                bit = self._random.randrange(8 * len(frame.data))
                value = int.from_bytes(frame.data, "little") ^ (1 << bit)
                data = value.to_bytes(len(frame.data), "little")
                arrived.append(frame._replace(data=data))
        return arrived


class Numbered:
    """Joystick frames whose id is their number and whose bits are all 0, the same in every drive.

    Behind a disturbed bus they show which frames arrive, and which bits of them are inverted.

    Args:
        joysticks: give the times and lengths of the frames.
    """

    def __init__(self, joysticks: Joysticks) -> None:
        self._joysticks, self._numbers = joysticks, count()
        self._by_tick: list[list[Frame]] = []

    def frames_of_tick(self, time_ms: int, tick_ms: int) -> Sequence[Frame]:
        """Return the numbered frames that came since the last tick, in order."""
        while (at_ms := len(self._by_tick) * tick_ms) <= time_ms:
            sent = self._joysticks.frames_of_tick(at_ms, tick_ms)
            self._by_tick.append(
                [Frame("", next(self._numbers), False, bytes(len(one.data))) for one in sent]
            )
        return self._by_tick[time_ms // tick_ms]


def bus_fault(draw: Draw, duration_s: float) -> Fault:
    """Draw a bus fault: joystick frames are lost, late by a tick, have a wrong bit, or all stop."""
    kind = draw.one_of(("silent", "lost", "late", "garbled"))
    share, begin_s = draw.between(0.02, 0.5), draw.between(0.0, 0.8 * duration_s)
    long_s, seed = draw.between(0.1, 0.5), int(draw.between(0.0, 2**31))
    if kind == "silent":
        share, end_s = 1.0, begin_s + 2.0 * long_s
    else:
        end_s = begin_s + long_s * duration_s
    ms = 1000.0 * begin_s, 1000.0 * end_s
    what = "lost" if kind == "silent" else kind
    return Fault(f"joystick {kind}", lambda joysticks: _Disturbed(joysticks, what, share, ms, seed))


def sensor_fault(draw: Draw, duration_s: float) -> Fault:
    """Draw a fault of the sway sensor, and when in the drive it begins."""
    kind = draw.one_of(("lost", "stuck", "reversed", "jump"))
    return Fault(f"sensor {kind}", sensor={f"{kind}_s": draw.between(0.0, duration_s)})
