"""The scripted operator: joystick strokes over time, repeatable to the last bit.

A stroke is a trapezoid: the stick leaves neutral at its start, reaches its level one ramp later,
is let go at start + duration and is neutral one ramp after that. Strokes of one axis add up, so
two that follow each other without a pause make one straight movement from level to level, a
reversal included. The area under a stroke is level times duration, whatever the ramp.
"""

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from canshaper_sim.crane import AXES, LIFT, NEAR_FAR, SLEW

_HUMAN_RAMP_S = 0.12  # a trained hand moves a stick from neutral to full in 0.1 .. 0.15 s
_PULSE_RAMP_S = 0.10

# name -> (lowest, highest) value of a stroke.
_ALLOWED = {
    "start_s": (0.0, math.inf),
    "duration_s": (0.0, math.inf),
    "level": (-1.0, 1.0),
    "ramp_s": (0.0, 5.0),
}


@dataclass(frozen=True, slots=True)
class Stroke:
    """One movement of one stick axis from neutral to `level` (-1 .. 1) and back."""

    axis: str
    start_s: float
    duration_s: float  # from leaving neutral to letting go; not shorter than the ramp
    level: float
    ramp_s: float = _HUMAN_RAMP_S

    def __post_init__(self) -> None:
        if self.axis not in AXES:
            raise ValueError(f"stroke: axis {self.axis!r}, allowed {', '.join(AXES)}")
        for name, (low, high) in _ALLOWED.items():
            value = getattr(self, name)
            if not (low <= value <= high and math.isfinite(value)):
                raise ValueError(f"stroke: {name} = {value}, allowed {low} .. {high}")
        if self.duration_s < self.ramp_s:
            raise ValueError(
                f"stroke: duration_s = {self.duration_s}, allowed from ramp_s = {self.ramp_s} on"
            )

    @property
    def end_s(self) -> float:
        """When the stick is neutral again."""
        return self.start_s + self.duration_s + self.ramp_s

    def stick(self, time_s: float) -> float:
        """Stick value of this stroke alone."""
        since_press = time_s - self.start_s
        if since_press < 0.0:
            return 0.0
        since_release = since_press - self.duration_s
        if since_release >= self.ramp_s:
            return 0.0
        if since_release > 0.0:
            return self.level * (1.0 - since_release / self.ramp_s)
        if since_press < self.ramp_s:
            return self.level * since_press / self.ramp_s
        return self.level


@dataclass(frozen=True, slots=True)
class Script:
    """What the operator does in duration_s seconds; neutral before, between and after."""

    name: str
    strokes: tuple[Stroke, ...]
    duration_s: float
    _by_axis: dict[str, tuple[Stroke, ...]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for stroke in self.strokes:
            # The margin forgives rounding of start + duration + ramp.
            if stroke.end_s > self.duration_s + 1e-9:
                raise ValueError(
                    f"script {self.name}: a {stroke.axis} stroke ends at {stroke.end_s} s, "
                    f"allowed up to duration_s = {self.duration_s}"
                )
        by_axis = {
            axis: tuple(
                sorted((s for s in self.strokes if s.axis == axis), key=lambda s: s.start_s)
            )
            for axis in self.axes
        }
        object.__setattr__(self, "_by_axis", by_axis)

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes this script moves, in the order of AXES."""
        moved = {stroke.axis for stroke in self.strokes}
        return tuple(axis for axis in AXES if axis in moved)

    def stick(self, axis: str, time_s: float) -> float:
        """Stick value -1 .. 1 of one axis; neutral for an axis the script does not move."""
        value = 0.0
        for stroke in self._by_axis.get(axis, ()):
            if time_s < stroke.start_s:
                break
            value += stroke.stick(time_s)
        return max(-1.0, min(1.0, value))


def random_script(seed: int, duration_s: float = 30.0, axes: Sequence[str] = AXES) -> Script:
    """A script `random-<seed>`: plateaus and reversals, about 40 % of the time neutral.

    Ramps last 0.1 .. 0.4 s, plateaus 0.4 .. 2.5 s. The same arguments always give the same script.
    Strokes that would carry near_far or lift away from the start pose of the default crane are
    turned round or cut short. The last second is neutral.
    """
    strokes: list[Stroke] = []
    for axis in axes:
        if axis not in AXES:
            raise ValueError(f"random script: axis {axis!r}, allowed {', '.join(AXES)}")
        # A source for each axis: its strokes do not depend on which other axes move. A string
        # seeds the same way in every Python version.
        source = random.Random(f"canshaper operator {seed} {axis}")
        strokes += _random_strokes(source, axis, duration_s - 1.0)
    return Script(f"random-{seed}", tuple(strokes), duration_s)


# How far from the start the strokes of an axis may add up to, in seconds of full speed, and the
# largest level. With more reach or faster slewing an unshaped grapple swings above the horizontal,
# where no operator takes it and the model ends; the default crane's stops are farther away.
_REACH_S = {SLEW: (-math.inf, math.inf), NEAR_FAR: (-0.6, 1.0), LIFT: (-1.8, 1.8)}
_LARGEST_LEVEL = {SLEW: 0.6, NEAR_FAR: 1.0, LIFT: 1.0}
# Share of pauses among the segments that makes the stick neutral 40 % of the time: pauses last
# longer than strokes, and so do the rests at both ends.
_PAUSE_SHARE = 0.33


def _random_strokes(source: random.Random, axis: str, end_s: float) -> list[Stroke]:
    strokes: list[Stroke] = []
    low_s, high_s = _REACH_S[axis]
    travel_s = 0.0
    start_s = source.uniform(0.2, 1.0)
    # One ramp for all strokes up to the next pause, so that level to level is one movement.
    ramp_s = source.uniform(0.1, 0.4)
    while True:
        duration_s = source.uniform(0.4, 2.5)
        if source.random() < _PAUSE_SHARE:
            ramp_s = source.uniform(0.1, 0.4)
            start_s += duration_s + 0.4  # the stick first needs the ramp to get to neutral
            continue
        # A fifth of the strokes is full stick.
        level = _LARGEST_LEVEL[axis] * min(1.0, source.uniform(0.25, 1.2))
        level *= source.choice((-1.0, 1.0))
        if not low_s <= travel_s + level * duration_s <= high_s:
            level = math.copysign(level, 0.5 * (low_s + high_s) - travel_s)
            if not low_s <= travel_s + level * duration_s <= high_s:
                duration_s = 0.4
        if start_s + duration_s + ramp_s > end_s:
            return strokes
        strokes.append(Stroke(axis, start_s, duration_s, level, ramp_s))
        travel_s += level * duration_s
        start_s += duration_s


def _pulse(axis: str) -> Script:
    # 3 s of full stick and 5 s of rest: the test input of the paper's section 4.
    return Script(f"pulse-{axis}", (Stroke(axis, 0.5, 3.0, 1.0, _PULSE_RAMP_S),), 8.5)


_DEMO = Script(
    "demo",
    (
        # Slewing comes first, close to the pillar: swing grows with the radius.
        Stroke(SLEW, 0.5, 3.0, 1.0),
        Stroke(NEAR_FAR, 8.0, 3.0, 1.0),
        # A piece of a loading cycle: back over the bunk, in and down, with corrections.
        Stroke(SLEW, 15.0, 1.5, -0.4),
        Stroke(NEAR_FAR, 15.3, 1.5, -0.6),
        Stroke(LIFT, 15.5, 0.5, 0.6),
        Stroke(LIFT, 16.0, 0.9, -0.8),
        Stroke(SLEW, 16.8, 0.5, -0.3),
        Stroke(SLEW, 17.3, 0.4, 0.3),
        Stroke(NEAR_FAR, 17.0, 0.5, 0.3),
        Stroke(LIFT, 17.4, 0.7, -0.4),
        Stroke(NEAR_FAR, 17.8, 0.5, -0.4),
    ),
    19.5,
)

_LOADING = Script(
    "loading",
    (
        # Out to the pile, the boom a little down on the way, a correction at the log.
        Stroke(SLEW, 0.5, 3.0, 0.6),
        Stroke(NEAR_FAR, 1.0, 2.9, 0.7),
        Stroke(LIFT, 2.5, 1.8, -0.7),
        Stroke(NEAR_FAR, 4.4, 0.6, -0.4),
        Stroke(NEAR_FAR, 5.2, 0.4, 0.3),
        Stroke(LIFT, 5.0, 0.9, -0.5),
        # Gripping: sticks neutral. Then up, in, and back over the bunk.
        Stroke(LIFT, 8.0, 2.4, 0.9),
        Stroke(NEAR_FAR, 9.0, 2.2, -0.6),
        Stroke(SLEW, 10.0, 2.8, -0.6),
        Stroke(SLEW, 13.0, 0.4, -0.35),
        Stroke(SLEW, 13.4, 0.4, 0.25),
        # Lower the log into the bunk, a correction, release, up again.
        Stroke(LIFT, 14.0, 1.6, -0.6),
        Stroke(NEAR_FAR, 14.6, 0.5, 0.4),
        Stroke(LIFT, 17.5, 1.5, 0.8),
        # The second log lies farther out; a reversal in the middle of the slew.
        Stroke(SLEW, 18.5, 2.4, 0.6),
        Stroke(SLEW, 20.9, 0.6, -0.3),
        Stroke(NEAR_FAR, 18.8, 3.2, 0.7),
        Stroke(LIFT, 21.0, 1.6, -0.8),
        Stroke(NEAR_FAR, 22.6, 0.5, -0.3),
        Stroke(LIFT, 23.4, 0.7, -0.4),
        Stroke(LIFT, 26.0, 2.0, 1.0),
        Stroke(NEAR_FAR, 26.8, 3.0, -0.6),
        Stroke(SLEW, 27.6, 2.8, -0.5),
        Stroke(SLEW, 31.0, 0.5, -0.3),
        Stroke(LIFT, 31.4, 1.4, -0.7),
        Stroke(NEAR_FAR, 32.0, 0.6, -0.35),
        Stroke(LIFT, 34.5, 1.2, 0.8),
        Stroke(NEAR_FAR, 35.5, 0.8, 0.5),
        Stroke(SLEW, 36.5, 0.8, 0.6),
    ),
    40.0,
)

SCRIPTS: dict[str, Script] = {
    script.name: script for script in (_pulse(NEAR_FAR), _pulse(SLEW), _DEMO, _LOADING)
}


def script_named(name: str) -> Script:
    """A built-in script, or `random-<seed>` of 30 s; ValueError lists the names for any other."""
    script = SCRIPTS.get(name)
    if script is not None:
        return script
    kind, _, seed = name.partition("-")
    if kind == "random" and seed.isdecimal():
        return random_script(int(seed))
    raise ValueError(f"script {name!r}, allowed {', '.join(SCRIPTS)}, random-<seed>")
