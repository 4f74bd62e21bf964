"""Task of a robust shaper: swing, lengths and second mode that it has to hold for."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

from canshaper.config.filters import designed, filter_of
from canshaper.config.limits import Sway
from canshaper.design.tuning.evaluate import Machine, ShaperFor, shaper_of
from canshaper.design.tuning.modes import SecondMode, second_mode
from canshaper.design.tuning.robust import RobustShaper
from canshaper.edit.edit import shortened
from canshaper.errors import DesignError, UsageError
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode

# Digits of a tap in the file: below a thousandth of the smallest tap that matters.
_DIGITS = 7


@dataclass(frozen=True)
class RobustTask:
    """Requirements of a robust shaper.

    Attributes:
        bound: its axis.
        at: number of its breakpoint in the gain schedule; None for the axis' own filter.
        mode: the swing.
        tick_ms: tick of the axis.
        range_pct: lengths of the pendulum that it covers, +- %.
        lengths_m: shortest and longest pendulum that it covers, in place of a range.
        sway: keys of the section sway that the file needs with the shaper.
        second: a second mode that it covers too.
        rope: keys of the section sway.length that the file needs with the shaper.
        lasts: factor of its duration on the longest rope that it follows.
    """

    bound: BoundAxis
    at: int | None
    mode: SwayMode
    tick_ms: int
    range_pct: float
    lengths_m: tuple[float, float] | None = None
    sway: dict[str, float] = field(default_factory=dict)
    second: SecondMode | None = None
    rope: dict[str, float] = field(default_factory=dict)
    lasts: float = 1.0

    @property
    def tick_s(self) -> float:
        """Tick of the axis, s."""
        return self.tick_ms / 1000.0

    @property
    def rate_per_s(self) -> float:
        """Slower of rise and fall of the axis' limits, full speeds per second."""
        return self.bound.config.limits.slowest_per_s

    def requirements(self) -> dict[str, Any]:
        """Return the arguments that ``least_residual`` and ``shortest`` have in common."""
        names = "tick_s", "range_pct", "rate_per_s", "second"
        return {name: getattr(self, name) for name in names}

    def machine(self, tail_s: float = 0.0) -> Machine:
        """Return valve and limits of the axis, with this tail where that of the file is shorter."""
        own = Machine.of(self.bound)
        return replace(own, limits=replace(own.limits, tail_s=max(own.limits.tail_s, tail_s)))

    def machine_of(self, shaper: RobustShaper) -> Machine:
        """Return valve and limits; with lengths the tail is at least as long as the shaper."""
        return self.machine(shaper.duration_s if self.lengths_m else 0.0)

    def section(self, shaper: RobustShaper) -> dict[str, Any]:
        """Return the filter section of the file."""
        designed_for: dict[str, Any] = {
            **designed(self.mode),
            "length_range_pct": self.range_pct,
            "duration_s": round(shaper.duration_s, 4),
            "valve_rate_per_s": self.rate_per_s,
        }
        if second := self.second:
            covers = {"length_range_pct": second.range_pct}
            designed_for["second"] = {**designed(second.mode), **covers}
        return {
            "kind": "robust",
            "tick_ms": self.tick_ms,
            "taps": shortened([round(tap, _DIGITS) for tap in shaper.taps]),
            "designed_for": designed_for,
        }

    def in_file(self, shaper: RobustShaper) -> ShaperFor:
        """Return the shaper as the file describes it, with rounded taps."""
        return shaper_of(filter_of(**self.section(shaper)), self.tick_s, self.rate_per_s)


def between(task: RobustTask, sway: Sway, lengths_m: tuple[float, float]) -> RobustTask:
    """Return the task for the swing in the middle of two lengths, with its range and keys."""
    low_m, high_m = lengths_m
    length_m = round(0.5 * (low_m + high_m), 4)
    range_pct = round(50.0 * (high_m - low_m) / length_m, 1)
    return replace(_at(task, sway, length_m), range_pct=range_pct, lengths_m=lengths_m)


def following(task: RobustTask, sway: Sway, lengths_m: tuple[float, float] | None) -> RobustTask:
    """Return the task for the shortest rope: of the file, or of given lengths with their keys."""
    if lengths_m is None:
        return replace(task, lasts=sway.ends()[1].period_s / task.mode.period_s)
    rope = {"lowest_m": lengths_m[0], "highest_m": lengths_m[1]}
    lasts = math.sqrt(lengths_m[1] / lengths_m[0])
    return replace(_at(task, sway, lengths_m[0]), rope=rope, lasts=lasts)


def _at(task: RobustTask, sway: Sway, length_m: float) -> RobustTask:
    """Return the task for the swing of a pendulum of this length, with its keys."""
    changes = keys_of_length(sway, length_m)
    return replace(task, mode=sway.model_copy(update=changes).mode(), sway=changes)


def keys_of_length(sway: Sway, length_m: float) -> dict[str, float]:
    """Return the keys of the section sway that a pendulum of this length changes."""
    if sway.length_m is not None:
        return {"length_m": length_m}
    swing = SwayMode(math.sqrt(GRAVITY_M_S2 / length_m), sway.mode().damping_ratio)
    return {"period_s": round(swing.period_s, 4)}


def second_of(text: str | None, task: RobustTask) -> SecondMode | None:
    """Return the mode of --second, None for "none"; without it that of the file's filter, if any.

    Raises:
        UsageError: it has another form, does not fit the task, or the axis follows its rope.
    """
    config, at = task.bound.config, task.at
    design = (config if at is None else config.gain_schedule[at]).filter.design()
    if text is None and design and (own := design.second):
        text = f"{own.period_s},{own.damping_ratio},{own.length_range_pct}"
    if text is None or text == "none":
        return None
    if task.bound.rope:
        text = "its period does not go with the rope's; for one length, write sway without length"
        raise UsageError(f"--second: expected an axis that follows no rope: {text}")
    try:
        period_s, damping_ratio, range_pct = (float(word) for word in text.split(","))
    except ValueError:
        form = "PERIOD,DAMPING,RANGE, such as 0.6,0.1,20, or none"
        raise UsageError(f"--second: expected {form}, got {text!r}") from None
    try:
        values = (period_s, damping_ratio, range_pct)
        return second_mode(task.mode, *values, tick_s=task.tick_s, rate_per_s=task.rate_per_s)
    except DesignError as error:
        raise UsageError(f"--second: {error}") from None
