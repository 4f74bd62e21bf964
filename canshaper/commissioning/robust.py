"""The robust shaper of an axis: designed for its swing in the file, or for each load."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from canshaper.config.filters import Filter, designed, filter_of
from canshaper.config.limits import Sway
from canshaper.design.profiles import swinging_axis
from canshaper.design.tuning.evaluate import (
    LENGTHS_PCT,
    Evaluation,
    Machine,
    ShaperFor,
    evaluate,
    shaper_of,
)
from canshaper.design.tuning.formulation import check_swing
from canshaper.design.tuning.modes import SecondMode, second_mode
from canshaper.design.tuning.robust import LEAST_TAP, RobustShaper, least_residual, shortest
from canshaper.design.tuning.verdict import GOOD, Verdict, judge
from canshaper.edit.edit import shortened
from canshaper.errors import DesignError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.registry import KINDS
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode

# Least taps of a shaper for lengths. A smaller one leaves less of the swing, but a tap of the
# joystick may become several movements; through the limits the smallest is not always the best.
_LEAST_TAPS = (LEAST_TAP, LEAST_TAP / 3.0, 0.0)
# Length of the response in swings: with a range that of ZVD, which is zero twice in its middle.
_SWINGS, _SWINGS_OF_RANGE = 0.77, 1.0
_LONGER = (1.15, 1.3, 1.5, 2.0)  # times the duration of a shaper that leaves too much
_MOST_TAPS = max(one.entries[1] for one in KINDS["robust"].parameters if one.entries)
# Digits of a tap in the file: below a thousandth of the smallest tap that matters.
_DIGITS = 7
# The responses for several loads begin alike for so long: a load that becomes known so late in a
# movement then changes no output. It costs the longer ones next to nothing.
_ALIKE_S = 0.5


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
        """Tick of the axis."""
        return self.tick_ms / 1000.0

    @property
    def rate_per_s(self) -> float:
        """Rate of the valve, full speeds per second."""
        return self.bound.config.limits.slowest_per_s

    def requirements(self) -> dict[str, Any]:
        """Return the arguments of ``least_residual`` and ``shortest``."""
        names = "tick_s", "range_pct", "rate_per_s", "second"
        return {name: getattr(self, name) for name in names}

    def machine(self, tail_s: float = 0.0) -> Machine:
        """Return valve and limits of the axis, with this tail where that of the file is shorter."""
        own = Machine.of(self.bound)
        return replace(own, limits=replace(own.limits, tail_s=max(own.limits.tail_s, tail_s)))

    def machine_of(self, shaper: RobustShaper) -> Machine:
        """Return valve and limits with the tail that is written with a shaper for lengths."""
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


@dataclass(frozen=True)
class RobustDesign:
    """A robust shaper that was designed for an axis.

    Attributes:
        task: its requirements.
        shaper: the shaper.
        measured: what it leaves through the limits of the machine.
        without: shaper of the same task without its second mode.
        first: taps with which it had to begin.
        shortest: whether a residual set its duration.
    """

    task: RobustTask
    shaper: RobustShaper
    measured: Evaluation
    without: RobustShaper
    first: Sequence[float] = ()
    shortest: bool = False

    @cached_property
    def verdict(self) -> Verdict:
        """Whether it damps over its range, and otherwise a longer one that does."""
        task, shaper = self.task, self.shaper
        setup = task.mode, task.tick_s, task.in_file(shaper), task.machine_of(shaper)
        verdict = judge(*setup, task.range_pct)
        if verdict.word == "good" or self.shortest:
            return verdict
        return _with_longer(task, shaper, verdict, self.first)

    @property
    def bound(self) -> BoundAxis:
        """Its axis."""
        return self.task.bound

    @property
    def section(self) -> dict[str, Any]:
        """The filter section of the file."""
        return self.task.section(self.shaper)

    @property
    def chosen(self) -> Filter:
        """The filter as the file describes it."""
        return filter_of(**self.section)

    @property
    def needed_s(self) -> float | None:
        """Tail that it needs, where that of the file is shorter."""
        lasts_s = self.task.lasts * self.shaper.duration_s
        return round(lasts_s + 0.1, 1) if self.bound.config.limits.tail_s < lasts_s else None

    @property
    def reversal_s(self) -> float | None:
        """Reversal that its second mode needs, where that of the file cuts the response off."""
        design = self.chosen.design()
        return design.reversal_s(self.bound.config.limits) if design else None


def design_robust(
    deployment: Deployment,
    axis: str,
    *,
    at: int | None = None,
    range_pct: float = 15.0,
    lengths_m: tuple[float, float] | None = None,
    duration_s: float | None = None,
    residual_pct: float | None = None,
    second: str | None = None,
    first: Sequence[float] = (),
) -> RobustDesign:
    """Design the shaper of an axis.

    Args:
        deployment: the machine.
        axis: name of an axis with sway data.
        at: number of a breakpoint in the gain schedule; None for the axis' own filter.
        range_pct: lengths of the pendulum that it covers, +- %.
        lengths_m: instead: shortest and longest pendulum that it covers; of a rope that it
            follows, which it is designed for at its shortest.
        duration_s: length of its impulse response; None for 0.77 of a swing, one with lengths.
        residual_pct: instead: the shortest that leaves at most this.
        second: a second mode as the option --second has it; None for that of the filter in the
            file.
        first: taps with which it begins, where it has a duration.

    Raises:
        DesignError: the axis has no sway data.
        UsageError: there is no such shaper.
    """
    bound, sway = swinging_axis(deployment, axis)
    sway = sway if at is None else bound.config.gain_schedule[at].sway
    tick_ms = bound.period_ticks * deployment.config.tick_ms
    task = RobustTask(bound, at, sway.mode(), tick_ms, range_pct)
    if bound.rope:
        task, lengths_m = _following(task, sway, lengths_m), None
    if lengths_m is not None:
        task = _between(task, sway, lengths_m)
    if residual_pct is not None and duration_s is not None:
        raise UsageError("expected one of --duration and --residual, got both")
    task = replace(task, second=_second(second, task))
    mode, tick_s, range_pct = task.mode, task.tick_s, task.range_pct
    swings = _SWINGS_OF_RANGE if lengths_m else _SWINGS
    length_s = duration_s or round(swings * mode.period_s / tick_s) * tick_s

    def design(task: RobustTask, least_tap: float) -> RobustShaper:
        given = task.requirements()
        if residual_pct is not None:
            return shortest(mode, residual_pct=residual_pct, **given)
        return least_residual(mode, duration_s=length_s, least_tap=least_tap, first=first, **given)

    lengths_pct = [0.5 * k * range_pct for k in range(-2, 3)] if lengths_m else LENGTHS_PCT
    try:
        check_swing(mode)
        shapers = [design(task, one) for one in _LEAST_TAPS[: 3 if lengths_m else 1]]
        without = design(replace(task, second=None), LEAST_TAP) if task.second else shapers[0]
        measures = [
            evaluate(mode, tick_s, task.in_file(one), task.machine_of(one), lengths_pct)
            for one in shapers
        ]
    except ValueError as error:
        raise UsageError(f"axis {axis}: {error}") from None
    best = min(range(len(shapers)), key=lambda k: measures[k].worst(range_pct))
    is_shortest = residual_pct is not None
    return RobustDesign(task, shapers[best], measures[best], without, first, is_shortest)


def _with_longer(
    task: RobustTask, shaper: RobustShaper, verdict: Verdict, first: Sequence[float]
) -> Verdict:
    """Return the verdict, which names the shortest longer response that is good."""
    for times in _LONGER:
        seconds = round(times * shaper.duration_s / task.tick_s) * task.tick_s
        if round(seconds / task.tick_s) + 1 > _MOST_TAPS:
            break  # of a file
        given = task.requirements()
        longer = least_residual(task.mode, duration_s=seconds, first=first, **given)
        machine = task.machine(seconds + 0.1)
        judged = judge(task.mode, task.tick_s, task.in_file(longer), machine, task.range_pct)
        if judged.left <= GOOD:
            return verdict.with_cure(judged.left, f"--duration {seconds:.2g}")
    return verdict


def _between(task: RobustTask, sway: Sway, lengths_m: tuple[float, float]) -> RobustTask:
    """Return the task for the swing in the middle of two lengths, with its range and keys."""
    low_m, high_m = lengths_m
    length_m = round(0.5 * (low_m + high_m), 4)
    range_pct = round(50.0 * (high_m - low_m) / length_m, 1)
    return replace(_at(task, sway, length_m), range_pct=range_pct, lengths_m=lengths_m)


def _following(task: RobustTask, sway: Sway, lengths_m: tuple[float, float] | None) -> RobustTask:
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


def _second(text: str | None, task: RobustTask) -> SecondMode | None:
    """Return the second mode of the option --second; without it that of the file's filter."""
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


def design_loads(
    deployment: Deployment, axis: str, *, duration_s: float | None, **options: Any
) -> list[RobustDesign]:
    """Design the filter of every breakpoint of an axis, and its own where that is of another kind.

    ``duration_s`` is for the shortest swing; others get more in proportion. See ``design_robust``.

    Raises:
        UsageError: there is no gain schedule, or no such shaper.
    """
    bound, own = swinging_axis(deployment, axis)
    config = bound.config
    if not config.gain_schedule:
        raise UsageError(f"--loads: expected a gain_schedule with the swing of each load at {axis}")
    swings: dict[int | None, Sway] = {None: own} if config.filter.kind != "robust" else {}
    swings |= {i: one.sway for i, one in enumerate(config.gain_schedule)}
    periods_s = {at: sway.mode().period_s for at, sway in swings.items()}
    first: Sequence[float] = ()
    designs = []
    for at, period_s in sorted(periods_s.items(), key=lambda one: one[1]):
        lasts_s = duration_s and duration_s * period_s / min(periods_s.values())
        one = design_robust(deployment, axis, at=at, duration_s=lasts_s, first=first, **options)
        first = first or one.shaper.taps[: round(_ALIKE_S / one.task.tick_s)]
        designs.append(one)
    return designs
