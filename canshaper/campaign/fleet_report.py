"""A design for a fleet, printed and drawn."""

from typing import TYPE_CHECKING

from rich.table import Table

from canshaper.campaign.fleet import JUDGING, FleetDesign, FleetRow
from canshaper.campaign.summary import bounded
from canshaper.report.console import new_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def table(design: FleetDesign) -> Table:
    """Swing left by each row, in degrees; its lengths are parts of those in the file."""
    made = new_table("left, deg", "run-on, s", "lengths", "worst 5 %", "p50", "p99")
    for row in design.rows:
        of = row.candidate
        made.add_row(
            row.name,
            f"{of.duration_s:.2f}" if of else "",
            f"{of.low:.2f}..{of.high:.2f}" if of else "",
            f"{row.worst_deg:.1f}",
            f"{row.p50_deg.value:.1f}",
            bounded(row.p99_deg),
        )
    return made


def verdict(design: FleetDesign) -> str:
    """How much less the worst drives leave, and which drives those are."""
    file, box = (row.worst_deg for row in design.rows[:2])
    chosen = design.asked.worst_deg
    count = len(JUDGING) - design.left_out
    text = f"The worst twentieth of {count} drives that it has not seen leaves {chosen:.1f} deg"
    absent = f"{design.left_out} drives are left out: with a fault, or of parts that C lacks"
    return f"{text}; with the file {file:.1f}, with a box of all lengths {box:.1f}. {absent}."


def figure(design: FleetDesign) -> "Figure":
    """The front of run-on against what the worst drives leave."""
    from canshaper.report.style import RAW_COLOUR, SHAPED_COLOUR, new_figure  # noqa: PLC0415

    drawn = new_figure(700, 450)
    axes = drawn.subplots()
    drawn.subplots_adjust(left=0.1, bottom=0.18, right=0.97, top=0.96)
    file, box, *front = design.rows
    for style, what, of in (("-", "p99", _p99), ("--", "worst 5 %", _worst)):
        x = [row.candidate.duration_s for row in front if row.candidate]
        axes.plot(x, [*map(of, front)], f"o{style}", color=SHAPED_COLOUR, label=f"fleet, {what}")
        axes.axhline(of(file), linestyle=style, color=RAW_COLOUR, label=f"the file, {what}")
    if box.candidate:
        axes.plot(box.candidate.duration_s, _p99(box), "ks", label="box of lengths, p99")
    axes.set(xlabel="run-on, s", ylabel="swing left, deg", ylim=(0, None))
    axes.legend()
    return drawn


def _p99(row: FleetRow) -> float:
    return row.p99_deg.value


def _worst(row: FleetRow) -> float:
    return row.worst_deg
