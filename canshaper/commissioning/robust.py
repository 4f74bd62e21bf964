"""The robust shaper of an axis: designed for its swing in the file, shown, and written there."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from canshaper.commissioning.filter_file import write_filter
from canshaper.commissioning.stopping import consequences
from canshaper.config.filters import Filter, designed, filter_of
from canshaper.config.section import shortened
from canshaper.design.profiles import swinging_axis
from canshaper.design.tuning.evaluate import (
    Evaluation,
    Machine,
    ShaperFor,
    evaluate,
    shaper_of,
)
from canshaper.design.tuning.formulation import check_swing
from canshaper.design.tuning.modes import SecondMode, second_mode, second_residual
from canshaper.design.tuning.robust import RobustShaper, least_residual, shortest
from canshaper.design.tuning.verdict import GOOD, Verdict, judge
from canshaper.errors import DesignError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper.report.console import new_table
from canshaper.shaping.sway import SwayMode

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LONGER = (1.15, 1.3, 1.5, 2.0)  # times the duration of a shaper that leaves too much
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

    @property
    def chosen(self) -> Filter:
        """The filter as the file describes it."""
        return filter_of(**self.section)


def design_robust(
    deployment: Deployment,
    axis: str,
    *,
    range_pct: float = 15.0,
    duration_s: float | None = None,
    residual_pct: float | None = None,
    second: str | None = None,
) -> RobustDesign:
    """Design the shaper of an axis.

    Args:
        deployment: the machine.
        axis: name of an axis with sway data.
        range_pct: lengths of the pendulum that it covers, +- %.
        duration_s: length of its impulse response; None for 0.77 of a swing.
        residual_pct: instead: the shortest that leaves at most this.
        second: a second mode as the option --second has it.

    Raises:
        DesignError: the axis has no sway data.
        UsageError: there is no such shaper.
    """
    bound, sway = swinging_axis(deployment, axis)
    mode, rate = sway.mode(), bound.config.limits.slowest_per_s
    tick_ms = bound.period_ticks * deployment.config.tick_ms
    tick_s = tick_ms / 1000.0
    if residual_pct is not None and duration_s is not None:
        raise UsageError("expected one of --duration and --residual, got both")
    requirements: dict[str, Any] = {"tick_s": tick_s, "range_pct": range_pct, "rate_per_s": rate}
    two = _second(second, mode, tick_s, rate)
    machine = Machine.of(bound)
    try:
        check_swing(mode)
        without = _designed(mode, None, duration_s, residual_pct, requirements)
        shaper = _designed(mode, two, duration_s, residual_pct, requirements) if two else without

        def in_file(one: RobustShaper) -> tuple[dict[str, Any], ShaperFor]:
            made = _section(one, mode, requirements, tick_ms, two)
            return made, shaper_of(filter_of(**made), tick_s, rate)

        section, shaper_for = in_file(shaper)
        measured = evaluate(mode, tick_s, shaper_for, machine)
        verdict = judge(mode, tick_s, shaper_for, machine, range_pct)
        for times in _LONGER if verdict.word != "good" and residual_pct is None else ():
            seconds = round(times * shaper.duration_s / tick_s) * tick_s
            shaper_for = in_file(_designed(mode, two, seconds, None, requirements))[1]
            tail_s = max(machine.limits.tail_s, seconds + 0.1)
            longer = replace(machine, limits=replace(machine.limits, tail_s=tail_s))
            left = judge(mode, tick_s, shaper_for, longer, range_pct).left
            if left <= GOOD:
                verdict = verdict.with_cure(left, f"--duration {seconds:.2g}")
                break
    except ValueError as error:
        raise UsageError(f"axis {axis}: {error}") from None
    tail_s = bound.config.limits.tail_s
    return RobustDesign(
        bound,
        mode,
        tick_s,
        range_pct,
        shaper,
        measured,
        section,
        round(shaper.duration_s + 0.1, 1) if tail_s < shaper.duration_s else None,
        verdict,
        (two, without) if two else None,
    )


def summary_line(one: RobustDesign) -> str:
    """How long it takes, and what it leaves."""
    shaper = one.shaper
    return (
        f"Robust shaper for {one.bound.name}: {shaper.duration_s:.2f} s, mean delay"
        f" {shaper.mean_delay_s:.2f} s; alone it leaves at most {100.0 * shaper.residual:.1f} % of"
        f" the swing at lengths within ±{one.range_pct:g} %."
    )


def print_design(deployment: Deployment, one: RobustDesign, console: Console) -> None:
    """Print the residuals of a shaper, its cost, and the stopping distance with it."""
    axis = one.bound.name
    console.print(summary_line(one))
    console.print(_table(one.measured))
    if one.second:
        console.print(_second_table(one))
    console.print(f"Verdict: {one.verdict}.", style="bold")
    if one.needed_s is not None:
        tail_s = one.bound.config.limits.tail_s
        console.print(
            f"tail_s is {tail_s:g} s: it ends the run-on early; give {axis} at least"
            f" tail_s: {one.needed_s:.1f}"
        )
    console.print(consequences(deployment, axis, one.chosen, one.needed_s))


def write_design(deployment: Deployment, one: RobustDesign) -> list[str]:
    """Write it into the file; see ``write_filter``."""
    gone = dict.fromkeys(one.bound.config.filter.model_dump(exclude_none=True))
    return write_filter(deployment, one.bound.name, gone | one.section, one.needed_s, "robust")


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


def _designed(
    mode: SwayMode,
    second: SecondMode | None,
    duration_s: float | None,
    residual_pct: float | None,
    requirements: dict[str, Any],
) -> RobustShaper:

    if residual_pct is not None:
        return shortest(mode, residual_pct=residual_pct, second=second, **requirements)
    tick_s = requirements["tick_s"]
    seconds = duration_s or round(0.77 * mode.period_s / tick_s) * tick_s
    return least_residual(mode, duration_s=seconds, second=second, **requirements)


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


def _table(measured: Evaluation) -> Table:

    table = new_table("swing left, %", *(f"{r.length_pct:+g} %" for r in measured.residuals))
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
