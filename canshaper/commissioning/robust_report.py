"""Robust shapers of an axis: printed, drawn, written into the file."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from canshaper.commissioning.origins import filter_changes
from canshaper.commissioning.robust import RobustDesign
from canshaper.commissioning.stopping import consequences
from canshaper.config.source import Place
from canshaper.design.tuning.evaluate import shaper_of, swing_left
from canshaper.design.tuning.modes import second_residual
from canshaper.edit.edit import change, flow
from canshaper.machine.deployment import Deployment
from canshaper.report.console import new_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def summary_line(one: RobustDesign) -> str:
    """Return a line: how long a shaper takes, and what it leaves."""
    shaper, lengths = one.shaper, f"lengths within ±{one.task.range_pct:g} %"
    if one.task.lengths_m:
        lengths = "pendulums of {:g} to {:g} m".format(*one.task.lengths_m)
    return (
        f"Robust shaper for {one.bound.name}: {shaper.duration_s:.2f} s, mean delay"
        f" {shaper.mean_delay_s:.2f} s; alone it leaves at most {100.0 * shaper.residual:.1f} % of"
        f" the swing at {lengths}."
    )


def print_design(deployment: Deployment, one: RobustDesign, console: Console) -> None:
    """Print the residuals of a shaper, its cost, and the stopping distance with it."""
    console.print(summary_line(one))
    console.print(_table(one))
    if one.task.second:
        console.print(_second_table(one))
    console.print(f"Verdict: {one.verdict}.", style="bold")
    _print_consequences(deployment, one, console)


def _print_consequences(deployment: Deployment, one: RobustDesign, console: Console) -> None:
    """Print the tail that a shaper needs, and the stopping distance with it."""
    axis = one.bound.name
    if one.needed_s is not None:
        tail_s = one.bound.config.limits.tail_s
        console.print(
            f"tail_s is {tail_s:g} s: it ends the run-on early; give {axis} at least"
            f" tail_s: {one.needed_s:.1f}"
        )
    if one.reversal_s is not None:
        console.print(
            "A reversal cuts the response off and makes the second mode swing; what lets it end:"
            f" reversal: brake_shaped, reversal_s: {one.reversal_s:.1f}"
        )
    console.print(consequences(deployment, axis, one.chosen, one.needed_s))


def print_loads(deployment: Deployment, designs: Sequence[RobustDesign], console: Console) -> None:
    """Print what each design leaves with each load; the stopping distance with the longest."""
    bound = designs[0].bound
    loads = {f"{one.breakpoint:g}": one.sway.mode() for one in bound.config.gain_schedule}
    names = [*(f"for {name}" for name in loads), "own"]
    table = new_table("swing left, %", *(f"with {name}" for name in loads))
    for one in designs:
        name = names[-1 if one.task.at is None else one.task.at]
        console.print(f"{name}: {summary_line(one)}")
        task, trues = one.task, [*loads.values()]
        left = swing_left(task.mode, task.tick_s, task.in_file(one.shaper), task.machine(), trues)
        table.add_row(name, *(f"{100.0 * part:.1f}" for part in left))
    console.print(table)
    longest = max(designs, key=lambda one: one.shaper.duration_s)
    _print_consequences(deployment, longest, console)


def write_design(deployment: Deployment, *designs: RobustDesign) -> list[str]:
    """Write the designs of an axis, and their lengths; return changed lines and notes."""
    config, parts = designs[0].bound.config, []
    for one in designs:
        at = one.task.at
        place: Place = () if at is None else ("gain_schedule", at)
        present = config if at is None else config.gain_schedule[at]
        gone = dict.fromkeys(present.filter.model_dump(exclude_none=True))
        parts.append((place, gone | one.section))
    longest = max(designs, key=lambda one: one.shaper.duration_s)
    name, task = longest.bound.name, designs[0].task
    own = {"sway": task.sway, "rope": task.rope}
    changes, notes = filter_changes(deployment, name, parts, longest.needed_s, "robust", **own)
    return [*change(deployment.path, changes), *notes]


def lines_for_file(designs: Sequence[RobustDesign]) -> list[str]:
    """Return the sections of the file that the designs need, a line each."""
    tasks = [one.task for one in designs]
    sways = [one.sway | ({"length": one.rope} if one.rope else {}) for one in tasks]
    lines = [f"sway: {flow(sway)}" for sway in sways if sway]
    return lines + [f"filter: {flow(one.section)}" for one in designs]


def figure(one: RobustDesign) -> "Figure":
    """Draw the new filter next to that of the file."""
    from canshaper.design.tuning import robust_plot  # noqa: PLC0415  # pictures alone need it

    task, present = one.task, one.bound.config.filter
    other = shaper_of(present, task.tick_s, task.rate_per_s)
    filters = [
        robust_plot.Candidate("this one", task.in_file(one.shaper)),
        robust_plot.Candidate(f"in the file, {present.kind}", other),
    ]
    setup, width = (one.bound.name, task.mode, task.tick_s), task.range_pct
    return robust_plot.figure(*setup, machine=task.machine(), filters=filters, range_pct=width)


def _table(one: RobustDesign) -> Table:
    measured = one.measured
    heads = [f"{r.length_pct:+g} %" for r in measured.residuals]
    if one.task.lengths_m:
        middle_m = 0.5 * sum(one.task.lengths_m)
        heads = [f"{middle_m * (1.0 + r.length_pct / 100.0):.2f} m" for r in measured.residuals]
    table = new_table("swing left, %", *heads)
    table.add_row("through the machine", *(f"{100 * r.machine:.1f}" for r in measured.residuals))
    table.add_row("shaper alone", *(f"{100 * r.linear:.1f}" for r in measured.residuals))
    return table


def _second_table(one: RobustDesign) -> Table:
    """Return a table of what a second mode costs and gains."""
    second = one.task.second
    assert second
    table = new_table("", "run-on, s", "mean delay, s", "first mode, %", "second mode, %")
    for name, shaper in (("without --second", one.without), ("with it", one.shaper)):
        left = second_residual(shaper.taps, second, one.task.tick_s)
        numbers = (f"{shaper.duration_s:.2f}", f"{shaper.mean_delay_s:.2f}")
        table.add_row(name, *numbers, f"{100.0 * shaper.residual:.1f}", f"{100.0 * left:.1f}")
    return table
