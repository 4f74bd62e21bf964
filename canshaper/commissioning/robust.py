"""The robust shaper of an axis: designed for its swing in the file, shown, and written there."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from canshaper.commissioning.filter_file import write_filters
from canshaper.commissioning.stopping import consequences
from canshaper.config.filters import Filter, designed, filter_of
from canshaper.config.limits import Sway
from canshaper.config.source import Place
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
from canshaper.design.tuning.modes import SecondMode, second_mode, second_residual
from canshaper.design.tuning.robust import LEAST_TAP, RobustShaper, least_residual, shortest
from canshaper.design.tuning.verdict import GOOD, Verdict, judge
from canshaper.edit.edit import shortened
from canshaper.errors import DesignError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper.report.console import new_table
from canshaper.shaping.registry import KINDS
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Least taps of a shaper for a range: with a smaller one less of the swing is left, and a tap of the
# joystick may be several movements. Through the limits the smallest is not always the best.
_LEAST_TAPS = (LEAST_TAP, LEAST_TAP / 3.0, 0.0)
# Length of the response in swings: with a range that of ZVD, which is zero twice in its middle.
_SWINGS, _SWINGS_OF_RANGE = 0.77, 1.0
_LONGER = (1.15, 1.3, 1.5, 2.0)  # times the duration of a shaper that leaves too much
_MOST_TAPS = max(one.entries[1] for one in KINDS["robust"].parameters if one.entries)
# Digits of a tap in the file: below a thousandth of the smallest tap that matters.
_DIGITS = 7


@dataclass(frozen=True)
class RobustDesign:
    """A shaper that was designed for an axis.

    Attributes:
        bound: the axis.
        mode: its swing.
        tick_s: its tick.
        range_pct: lengths of the pendulum that it covers, +- %.
        shaper: it.
        measured: what it does through the limits of the machine.
        section: the filter section of the file.
        needed_s: tail that it needs, where that of the file is shorter.
        verdict: whether it damps over its range.
        second: a second mode that it covers too, and the shaper without that.
        lengths_m: shortest and longest pendulum that it was designed for, in place of a range.
        sway: what the file has to have as the swing then, by key.
        at: number of its breakpoint in the gain schedule; None for the axis' own filter.
        rope: what the file has to have as the length that it follows, by key.
    """

    bound: BoundAxis
    mode: SwayMode
    tick_s: float
    range_pct: float
    shaper: RobustShaper
    measured: Evaluation
    section: dict[str, Any]
    needed_s: float | None
    verdict: Verdict
    second: tuple[SecondMode, RobustShaper] | None = None
    lengths_m: tuple[float, float] | None = None
    sway: dict[str, float] = field(default_factory=dict)
    at: int | None = None
    rope: dict[str, float] = field(default_factory=dict)

    @property
    def chosen(self) -> Filter:
        """The filter as the file describes it."""
        return filter_of(**self.section)


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
        second: a second mode as the option --second has it.
        first: taps with which it begins, where it has a duration.

    Raises:
        DesignError: the axis has no sway data.
        UsageError: there is no such shaper.
    """
    bound, sway = swinging_axis(deployment, axis)
    sway = sway if at is None else bound.config.gain_schedule[at].sway
    mode = sway.mode()
    lengths_pct: Sequence[float] = LENGTHS_PCT
    changes: dict[str, float] = {}
    rope: dict[str, float] = {}
    lasts = sway.ends()[1].period_s / mode.period_s if bound.rope else 1.0
    if lengths_m is not None and bound.rope:
        mode, changes = _swing_at(sway, lengths_m[0])
        rope = {"lowest_m": lengths_m[0], "highest_m": lengths_m[1]}
        lasts = math.sqrt(lengths_m[1] / lengths_m[0])
        lengths_m = None
    elif lengths_m is not None:
        mode, range_pct, changes = _between(sway, lengths_m)
        lengths_pct = tuple(part * range_pct for part in (-1.0, -0.5, 0.0, 0.5, 1.0))
    rate, tail_s = bound.config.limits.slowest_per_s, bound.config.limits.tail_s
    tick_ms = bound.period_ticks * deployment.config.tick_ms
    tick_s = tick_ms / 1000.0
    if residual_pct is not None and duration_s is not None:
        raise UsageError("expected one of --duration and --residual, got both")
    requirements: dict[str, Any] = {"tick_s": tick_s, "range_pct": range_pct, "rate_per_s": rate}
    two = _second(second, mode, tick_s, rate)
    swings = _SWINGS_OF_RANGE if lengths_m else _SWINGS
    duration_s = duration_s or round(swings * mode.period_s / tick_s) * tick_s
    machine = Machine.of(bound)

    def design(
        second: SecondMode | None, least_tap: float, seconds: float | None = None
    ) -> RobustShaper:
        if residual_pct is not None and seconds is None:
            return shortest(mode, residual_pct=residual_pct, second=second, **requirements)
        given = requirements | {"duration_s": seconds or duration_s, "least_tap": least_tap}
        return least_residual(mode, second=second, first=first, **given)

    def in_file(one: RobustShaper) -> tuple[dict[str, Any], ShaperFor]:
        made = _section(one, mode, requirements, tick_ms, two)
        return made, shaper_of(filter_of(**made), tick_s, rate)

    def with_tail(tail_s: float) -> Machine:
        limits = replace(machine.limits, tail_s=max(machine.limits.tail_s, tail_s))
        return replace(machine, limits=limits)

    def written(one: RobustShaper) -> Machine:
        """With the tail that is written with a shaper for lengths."""
        return with_tail(one.duration_s) if lengths_m else machine

    def evaluated(one: RobustShaper) -> Evaluation:
        return evaluate(mode, tick_s, in_file(one)[1], written(one), lengths_pct)

    try:
        check_swing(mode)
        shapers = [design(two, one) for one in _LEAST_TAPS[: 3 if lengths_m else 1]]
        without = design(None, LEAST_TAP) if two else shapers[0]
        measures = [(evaluated(one), one) for one in shapers]
        measured, shaper = min(measures, key=lambda one: one[0].worst(range_pct))
        section, shaper_for = in_file(shaper)
        verdict = judge(mode, tick_s, shaper_for, written(shaper), range_pct)
        for times in _LONGER if verdict.word != "good" and residual_pct is None else ():
            seconds = round(times * shaper.duration_s / tick_s) * tick_s
            if round(seconds / tick_s) + 1 > _MOST_TAPS:
                break  # of a file
            shaper_for = in_file(design(two, LEAST_TAP, seconds))[1]
            left = judge(mode, tick_s, shaper_for, with_tail(seconds + 0.1), range_pct).left
            if left <= GOOD:
                verdict = verdict.with_cure(left, f"--duration {seconds:.2g}")
                break
    except ValueError as error:
        raise UsageError(f"axis {axis}: {error}") from None
    return RobustDesign(
        bound,
        mode,
        tick_s,
        range_pct,
        shaper,
        measured,
        section,
        round(lasts * shaper.duration_s + 0.1, 1) if tail_s < lasts * shaper.duration_s else None,
        verdict,
        (two, without) if two else None,
        lengths_m,
        changes,
        at,
        rope,
    )


def _between(
    sway: Sway, lengths_m: tuple[float, float]
) -> tuple[SwayMode, float, dict[str, float]]:
    """The swing in the middle of two lengths, its range in +- %, its keys in the file."""
    low_m, high_m = lengths_m
    length_m = round(0.5 * (low_m + high_m), 4)
    mode, changes = _swing_at(sway, length_m)
    return mode, round(50.0 * (high_m - low_m) / length_m, 1), changes


def _swing_at(sway: Sway, length_m: float) -> tuple[SwayMode, dict[str, float]]:
    """The swing of a pendulum of this length, its keys in the file."""
    if sway.length_m is not None:
        changes = {"length_m": length_m}
    else:
        swing = SwayMode(math.sqrt(GRAVITY_M_S2 / length_m), sway.mode().damping_ratio)
        changes = {"period_s": round(swing.period_s, 4)}
    return sway.model_copy(update=changes).mode(), changes


def summary_line(one: RobustDesign) -> str:
    """How long it takes, and what it leaves."""
    shaper, lengths = one.shaper, f"lengths within ±{one.range_pct:g} %"
    if one.lengths_m:
        lengths = "pendulums of {:g} to {:g} m".format(*one.lengths_m)
    return (
        f"Robust shaper for {one.bound.name}: {shaper.duration_s:.2f} s, mean delay"
        f" {shaper.mean_delay_s:.2f} s; alone it leaves at most {100.0 * shaper.residual:.1f} % of"
        f" the swing at {lengths}."
    )


def print_design(deployment: Deployment, one: RobustDesign, console: Console) -> None:
    """Print the residuals of a shaper, its cost, and the stopping distance with it."""
    console.print(summary_line(one))
    console.print(_table(one))
    if one.second:
        console.print(_second_table(one))
    console.print(f"Verdict: {one.verdict}.", style="bold")
    print_consequences(deployment, one, console)


def print_consequences(deployment: Deployment, one: RobustDesign, console: Console) -> None:
    """Print the tail that it needs, and the stopping distance with it."""
    axis = one.bound.name
    if one.needed_s is not None:
        tail_s = one.bound.config.limits.tail_s
        console.print(
            f"tail_s is {tail_s:g} s: it ends the run-on early; give {axis} at least"
            f" tail_s: {one.needed_s:.1f}"
        )
    console.print(consequences(deployment, axis, one.chosen, one.needed_s))


def write_design(deployment: Deployment, *designs: RobustDesign) -> list[str]:
    """Write designs for an axis into the file; see ``write_filters``."""
    config, parts = designs[0].bound.config, []
    for one in designs:
        place: Place = () if one.at is None else ("gain_schedule", one.at)
        present = config.filter if one.at is None else config.gain_schedule[one.at].filter
        gone = dict.fromkeys(present.model_dump(exclude_none=True))
        parts.append((place, gone | one.section))
    longest = max(designs, key=lambda one: one.shaper.duration_s)
    name, sway = longest.bound.name, designs[0].sway
    own = {"sway": sway, "rope": designs[0].rope}
    return write_filters(deployment, name, parts, longest.needed_s, "robust", **own)


def figure(one: RobustDesign) -> "Figure":
    """The new filter next to that of the file."""
    from canshaper.design.tuning import robust_plot  # noqa: PLC0415  # pictures alone need it

    rate = one.bound.config.limits.slowest_per_s
    present = one.bound.config.filter
    filters = [
        robust_plot.Candidate("this one", shaper_of(one.chosen, one.tick_s, rate)),
        robust_plot.Candidate(f"in the file, {present.kind}", shaper_of(present, one.tick_s, rate)),
    ]
    return robust_plot.figure(
        one.bound.name,
        one.mode,
        one.tick_s,
        machine=Machine.of(one.bound),
        filters=filters,
        range_pct=one.range_pct,
    )


def _second(
    text: str | None, first: SwayMode, tick_s: float, rate_per_s: float
) -> SecondMode | None:
    """Return the second mode of the option --second."""

    if text is None:
        return None
    try:
        period_s, damping_ratio, range_pct = (float(word) for word in text.split(","))
    except ValueError:
        form = "PERIOD,DAMPING,RANGE, such as 0.6,0.1,20"
        raise UsageError(f"--second: expected {form}, got {text!r}") from None
    try:
        values = (period_s, damping_ratio, range_pct)
        return second_mode(first, *values, tick_s=tick_s, rate_per_s=rate_per_s)
    except DesignError as error:
        raise UsageError(f"--second: {error}") from None


def _section(
    shaper: RobustShaper,
    mode: SwayMode,
    requirements: dict[str, Any],
    tick_ms: int,
    second: SecondMode | None,
) -> dict[str, Any]:
    """The filter section of the file."""

    designed_for: dict[str, Any] = {
        **designed(mode),
        "length_range_pct": requirements["range_pct"],
        "duration_s": round(shaper.duration_s, 4),
        "valve_rate_per_s": requirements["rate_per_s"],
    }
    if second:
        covers = {"length_range_pct": second.range_pct}
        designed_for["second"] = {**designed(second.mode), **covers}
    return {
        "kind": "robust",
        "tick_ms": tick_ms,
        "taps": shortened([round(tap, _DIGITS) for tap in shaper.taps]),
        "designed_for": designed_for,
    }


def _table(one: RobustDesign) -> Table:

    measured = one.measured
    heads = [f"{r.length_pct:+g} %" for r in measured.residuals]
    if one.lengths_m:
        middle_m = 0.5 * sum(one.lengths_m)
        heads = [f"{middle_m * (1.0 + r.length_pct / 100.0):.2f} m" for r in measured.residuals]
    table = new_table("swing left, %", *heads)
    table.add_row("through the machine", *(f"{100 * r.machine:.1f}" for r in measured.residuals))
    table.add_row("shaper alone", *(f"{100 * r.linear:.1f}" for r in measured.residuals))
    return table


def _second_table(one: RobustDesign) -> Table:
    """Return a table of what a second mode costs and gains."""
    assert one.second
    second, without = one.second
    table = new_table("", "run-on, s", "mean delay, s", "first mode, %", "second mode, %")
    for name, shaper in (("without --second", without), ("with it", one.shaper)):
        left = second_residual(shaper.taps, second, one.tick_s)
        numbers = (f"{shaper.duration_s:.2f}", f"{shaper.mean_delay_s:.2f}")
        table.add_row(name, *numbers, f"{100.0 * shaper.residual:.1f}", f"{100.0 * left:.1f}")
    return table
