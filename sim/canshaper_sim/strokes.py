"""Joystick strokes over time, repeatable to the last bit.

A stroke is a trapezoid: the joystick leaves neutral at its start, reaches its level one ramp later,
is released at start + duration and is neutral one ramp after that. Strokes of one axis add up, so
two strokes without a pause between them make one straight movement from level to level, even if the
level changes its sign. The area under a stroke is level times duration, whatever the ramp.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from canshaper.errors import DesignError
from canshaper_sim.axes import ALL_AXES

_HUMAN_RAMP_S = 0.12  # a trained hand moves a joystick from neutral to full in 0.1 .. 0.15 s

# This long after its end a stroke is over, whatever the rounding of start, duration and ramp.
_PAST_S = 1e-6

# name -> (lowest, highest) value of a stroke.
_ALLOWED = {
    "start_s": (0.0, math.inf),
    "duration_s": (0.0, math.inf),
    "level": (-1.0, 1.0),
    "ramp_s": (0.0, 5.0),
}


@dataclass(frozen=True, slots=True)
class Stroke:
    """One movement of one joystick axis from neutral to `level` (-1 .. 1) and back.

    Raises:
        DesignError: a number outside its range, or a duration shorter than the ramp.
    """

    axis: str  # name in the deployment
    start_s: float
    duration_s: float  # from leaving neutral to letting go; not shorter than the ramp
    level: float
    ramp_s: float = _HUMAN_RAMP_S

    def __post_init__(self) -> None:
        for name, (low, high) in _ALLOWED.items():
            value = getattr(self, name)
            if not (low <= value <= high and math.isfinite(value)):
                raise DesignError(f"stroke: {name}: expected {low} .. {high}, got {value}")
        if self.duration_s < self.ramp_s:
            least = f"{self.ramp_s}, its ramp_s, or more"
            raise DesignError(f"stroke: duration_s: expected {least}, got {self.duration_s}")

    @property
    def end_s(self) -> float:
        """Time in s when the joystick is neutral again."""
        return self.start_s + self.duration_s + self.ramp_s

    def command(self, time_s: float) -> float:
        """Return the joystick value of this stroke alone, -1 .. 1; 0 before and after it."""
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
    """Strokes of the operator in duration_s seconds; the joystick is neutral between strokes.

    Raises:
        DesignError: a stroke ends later.
    """

    name: str
    strokes: tuple[Stroke, ...]
    duration_s: float
    _by_axis: dict[str, tuple[tuple[float, float, Stroke], ...]] = field(
        init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        for stroke in self.strokes:
            # The margin forgives rounding of start + duration + ramp.
            if stroke.end_s > self.duration_s + 1e-9:
                raise DesignError(
                    f"script {self.name}: end of a {stroke.axis} stroke: expected up to"
                    f" duration_s = {self.duration_s}, got {stroke.end_s}"
                )
        in_order = sorted(self.strokes, key=lambda stroke: stroke.start_s)
        by_axis = {
            axis: tuple((s.start_s, s.end_s + _PAST_S, s) for s in in_order if s.axis == axis)
            for axis in self.axes
        }
        object.__setattr__(self, "_by_axis", by_axis)

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that this script moves, in the order of ALL_AXES; axes of other names follow."""
        moved = dict.fromkeys(stroke.axis for stroke in self.strokes)
        known = tuple(axis for axis in ALL_AXES if axis in moved)
        return known + tuple(axis for axis in moved if axis not in ALL_AXES)

    def moving(self, axes: Mapping[str, str]) -> "Script":
        """Return the script with axes in place of coordinates; other strokes are dropped.

        `axes` maps coordinate to axis.
        """
        moved = tuple(replace(s, axis=axes[s.axis]) for s in self.strokes if s.axis in axes)
        return Script(self.name, moved, self.duration_s)

    def of_axis(self, axis: str) -> tuple[tuple[float, float, Stroke], ...]:
        """Return (start, end + 1 us, stroke), times in s, of an axis' strokes in order of start."""
        return self._by_axis.get(axis, ())

    def command(self, axis: str, time_s: float) -> float:
        """Return the sum of the axis' strokes, cut to -1 .. 1; 0 for an axis without strokes."""
        strokes = self._by_axis.get(axis)
        if strokes is None:
            return 0.0
        value = 0.0
        for start_s, past_s, stroke in strokes:
            if time_s < start_s:
                break
            if time_s <= past_s:
                value += stroke.command(time_s)
        return -1.0 if value < -1.0 else 1.0 if value > 1.0 else value
