"""Print, draw and write a design for a fleet."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.table import Table

from canshaper.campaign.fleet import BOX, FILE, FLEET, JUDGING, OTHER, Driven, Rows
from canshaper.campaign.fleet_filters import FleetFilter
from canshaper.campaign.statistics import quantile
from canshaper.campaign.summary import bounded
from canshaper.commissioning.filter_file import filter_changes
from canshaper.edit.edit import Change, change
from canshaper.machine.deployment import Deployment
from canshaper.report.console import new_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def table(asked: Driven, rows: Rows) -> Table:
    """Return the table: residual swing of each row, deg; lengths are parts of those in the file."""
    made = new_table("left, deg", "run-on, s", "lengths", "worst 5 %", "p50", "p99")
    for name, row in ((name, row) for name, own in rows.items() for row in own):
        of = row.candidate
        made.add_row(
            name,
            f"{_run_on(row):.2f}",
            f"{of.low:.2f}..{of.high:.2f}" if of else "",
            f"{row.worst_deg:.1f}",
            f"{quantile(row.left_deg, 0.5).value:.1f}",
            bounded(quantile(row.left_deg, 0.99)),
            style="bold" if row is asked else None,
        )
    return made


def verdict(asked: Driven, rows: Rows) -> str:
    """Return the text that compares the worst drives of the design with those of the others."""
    chosen, count = asked.worst_deg, len(asked.left_deg)
    named = {FILE: "the file", BOX: "a box of all lengths", OTHER: "robust shapers for the fleet"}
    left = {name: [row.worst_deg for row in rows[name]] for name in named}
    texts = [f"with {text} {deg:.1f}" for name, text in named.items() for deg in left[name]]
    text = f"The worst twentieth of {count} drives that it has not seen leaves {chosen:.1f} deg"
    text += f"; {', '.join(texts)}"
    if any(deg <= chosen for deg in left[OTHER]):
        text += ": G_FF buys nothing here"
    absent = f"{len(JUDGING) - count} drives are left out: with a fault, or of parts that C lacks"
    return f"{text}. {absent}."


def write_fleet(deployment: Deployment, filters: Sequence[FleetFilter], verb: str) -> list[str]:
    """Write the filters into the file, all or none; return the changed lines and the notes."""
    changes, notes = list[Change](), list[str]()
    for one in filters:
        gone = dict.fromkeys(deployment.axes[one.axis].config.filter.model_dump(exclude_none=True))
        parts = [((), gone | one.section)]
        own, noted = filter_changes(deployment, one.axis, parts, one.tail_s, verb, sway=one.sway)
        changes += own
        notes += noted
    return [*change(deployment.path, changes), *notes]


def figure(rows: Rows) -> "Figure":
    """Return the picture: residual swing of the worst drives against run-on."""
    from canshaper.report.style import RAW_COLOUR, SHAPED_COLOUR, new_figure  # noqa: PLC0415

    drawn = new_figure(700, 450)
    axes = drawn.subplots()
    drawn.subplots_adjust(left=0.1, bottom=0.18, right=0.97, top=0.96)
    front = rows[FLEET]
    x = [*map(_run_on, front)]
    for style, what, of in (("-", "p99", _p99), ("--", "worst 5 %", _worst)):
        axes.plot(x, [*map(of, front)], f"o{style}", color=SHAPED_COLOUR, label=f"fleet, {what}")
    for name, mark in ((FILE, "o"), (BOX, "s"), (OTHER, "D")):
        colour = RAW_COLOUR if name == FILE else "black"
        for row in rows[name]:
            axes.plot(_run_on(row), _p99(row), mark, color=colour, label=f"{name}, p99")
    axes.set(xlabel="run-on, s", ylabel="swing left, deg", ylim=(0, None))
    axes.legend()
    return drawn


def _run_on(row: Driven) -> float:
    return quantile(row.run_on_s, 0.5).value


def _p99(row: Driven) -> float:
    return quantile(row.left_deg, 0.99).value


def _worst(row: Driven) -> float:
    return row.worst_deg
