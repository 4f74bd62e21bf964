"""Candidates of a design for a fleet: their filters, their drives, and how these are shown."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from rich.table import Table

from canshaper.campaign.statistics import quantile
from canshaper.commissioning.origins import filter_changes
from canshaper.commissioning.robust import design_robust
from canshaper.commissioning.robust_task import keys_of_length
from canshaper.commissioning.tuned import design_tuned
from canshaper.config.filters import filter_of
from canshaper.config.limits import Sway
from canshaper.edit.edit import Change, change
from canshaper.errors import DesignError
from canshaper.machine.deployment import Deployment
from canshaper.machine.stop_distance import stop_fault
from canshaper.report.console import new_table
from canshaper.shaping.sway import GRAVITY_M_S2

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Seeds of the drives that choose a candidate, and of those that judge it; a campaign begins at 0.
CHOOSING = range(1_000_000, 1_000_400)
JUDGING = range(2_000_000, 2_001_000)
# Share of the drives that count as the worst.
_WORST = 0.05
ROBUST, GFF = "robust", "gff"


class Candidate(NamedTuple):
    """Filters of all swinging axes.

    Attributes:
        kind: robust or gff.
        low, high: shortest and longest pendulum they cover, as parts of the length in the file.
        duration_s: length of the impulse response; of G_FF the time until a step settles to 5 %.
    """

    kind: str
    low: float
    high: float
    duration_s: float


@dataclass(frozen=True)
class FleetFilter:
    """Designed filter of an axis.

    Attributes:
        axis: name of the axis.
        section: its section ``filter``.
        sway: keys of its section ``sway`` that the filter was designed for.
        tail_s: tail that the filter needs; None where that of the file is long enough, or a longer
            one would exceed the stopping distance.
    """

    axis: str
    section: dict[str, Any]
    sway: dict[str, float]
    tail_s: float | None = None


def swinging(deployment: Deployment) -> dict[str, Sway]:
    """Return the axes with sway data, and the data.

    Raises:
        DesignError: no axis has any, or one has several filters or a rope.
    """
    axes = {}
    for name, axis in deployment.axes.items():
        if sway := axis.config.sway:
            if axis.rope or axis.config.gain_schedule or axis.config.profiles:
                text = "expected one filter, got a rope, gain_schedule or profiles"
                raise DesignError(f"--fleet: axis {name}: {text}")
            axes[name] = sway
    if not axes:
        raise DesignError("expected an axis with sway data, got none")
    return axes


def designed(deployment: Deployment, name: str, candidate: Candidate) -> FleetFilter:
    """Design the filter of an axis.

    Raises:
        InfeasibleError: no filter keeps the run-on of the candidate.
    """
    config = deployment.axes[name].config
    assert config.sway
    length_m = GRAVITY_M_S2 / config.sway.mode().omega_rad_s ** 2
    low_m, high_m = candidate.low * length_m, candidate.high * length_m
    if candidate.kind == ROBUST:
        robust = design_robust(
            deployment, name, lengths_m=(low_m, high_m), duration_s=candidate.duration_s
        )
        return FleetFilter(name, robust.section, robust.task.sway)
    sway = keys_of_length(config.sway, round(0.5 * (low_m + high_m), 4))
    range_pct = round(100.0 * (high_m - low_m) / (high_m + low_m), 1)
    given = {"length_range_pct": range_pct, "max_run_on_s": candidate.duration_s}
    own = FleetFilter(name, config.filter.model_dump(), sway)
    tuned = design_tuned(fitted(deployment, [own]), name, given)
    tail_s = tuned.longer_tail[0] if tuned.longer_tail else None
    limits = config.limits.model_copy(update={"tail_s": tail_s})
    if tail_s and stop_fault(deployment, name, config.model_copy(update={"limits": limits})):
        tail_s = None
    return FleetFilter(name, tuned.section, sway, tail_s)


def fitted(deployment: Deployment, filters: Sequence[FleetFilter]) -> Deployment:
    """Return the machine with these filters and with the sway data that they were designed for."""
    axes = dict(deployment.axes)
    for one in filters:
        config = axes[one.axis].config
        assert config.sway
        limits = {"tail_s": one.tail_s} if one.tail_s else {}
        changes = {
            "filter": filter_of(**one.section),
            "sway": config.sway.model_copy(update=one.sway),
            "limits": config.limits.model_copy(update=limits),
        }
        axes[one.axis] = replace(axes[one.axis], config=config.model_copy(update=changes))
    return replace(deployment, axes=axes)


@dataclass(frozen=True)
class Driven:
    """Drives of a candidate.

    Attributes:
        candidate: the candidate; None for the file as it is.
        filters: one for each swinging axis.
        left_deg: residual swing of each drive; its largest swing where the grapple swung over.
        run_on_s: run-on of each drive, until the tip stands.
        why: why no filters meet the candidate, which then has no drives; "" where they do.
    """

    candidate: Candidate | None
    filters: Sequence[FleetFilter] = ()
    left_deg: list[float] = field(default_factory=list)
    run_on_s: list[float] = field(default_factory=list)
    why: str = ""

    @property
    def worst_deg(self) -> float:
        """Mean residual swing of the worst twentieth of the drives, deg."""
        count = math.ceil(_WORST * len(self.left_deg))
        return math.fsum(sorted(self.left_deg)[-count:]) / count


FILE, BOX, FLEET, OTHER = "the file", "box of lengths", "for the fleet", "fleet, robust"
Rows = Mapping[str, Sequence[Driven]]
"""Rows of the table by name: the file, the box of all lengths, the best candidate of each run-on,
and for G_FF the best robust shapers. A row may be empty.
"""


def table(asked: Driven, rows: Rows) -> Table:
    """Return the table: residual swing, deg, lengths as parts of the file's; ``asked`` is bold."""
    made = new_table("left, deg", "run-on, s", "lengths", "worst 5 %", "p50", "p99")
    for name, row in ((name, row) for name, own in rows.items() for row in own):
        of = row.candidate
        made.add_row(
            name,
            f"{_run_on(row):.2f}",
            f"{of.low:.2f}..{of.high:.2f}" if of else "",
            f"{row.worst_deg:.1f}",
            f"{quantile(row.left_deg, 0.5).value:.1f}",
            str(quantile(row.left_deg, 0.99)),
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
    """Write the filters that ``verb`` designed, all or none; return changed lines and notes."""
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
    worst_deg = [row.worst_deg for row in front]
    axes.plot(x, [*map(_p99, front)], "o-", color=SHAPED_COLOUR, label="fleet, p99")
    axes.plot(x, worst_deg, "o--", color=SHAPED_COLOUR, label="fleet, worst 5 %")
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
