"""``canshaper compare``: drive every filter through the same work and compare them."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import PICTURE, REPORT, echo, end_interrupted, engine, loader
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

    from canshaper.cli.results import Results
    from canshaper.design.comparison.manoeuvres import Candidate
    from canshaper.design.comparison.summary import Least, Row
    from canshaper.machine.deployment import Deployment

GROUP = "design"

# Columns of the first table: head and kind of work.
_WORKS = {
    "pulse": "pulse",
    "tap": "tap",
    "rev.": "reversal",
    "both": "both",
    "rand.": "random",
    "cycle": "cycle",
    "load": "load",
    "slow": "gain",
    "pump": "pump",
    "end": "end",
    "start": "start",
}


def compare(
    file: str = typer.Argument(
        "forwarder-robust.yaml", help="Deployment file; by default a shipped one."
    ),
    out: Path = typer.Option(Path("out/compare"), "--out", help="Directory for picture and data."),
    as_json: bool = typer.Option(False, "--json", help="Print the rows as JSON, no table."),
    work: bool = typer.Option(
        False, "--work", help="Measure the seconds a move of a model operator too; takes minutes."
    ),
    fleet: bool = typer.Option(
        False,
        "--fleet",
        help="Add the file's filters, and robust ones for its fleet; takes a minute.",
    ),
    seeds: int = typer.Option(6, "--seeds", min=1, help="Working cycles with each filter."),
    processes: int | None = typer.Option(
        None, "--processes", min=1, help="Processes; by default one a processor."
    ),
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
) -> None:
    """Drive every filter through the same manoeuvres and say which to take.

    Each filter is put on slew and near-far of the file. The simulated crane is driven with the
    output limits and the two-axis motion of the file: pulses, taps and reversals of each axis,
    strokes of both, random joysticks, a loading cycle, a load picked up on the way, a slow valve,
    a small pump, an end stop, and a start with swing, each with pendulums of -30 to +30 % length.

    The tables have the largest swing left, what the operator feels, the worst case of each filter,
    a filter of ours that stops as soon and leaves less, and the limits of any shaper. A file whose
    sway sensors damp gets rows with them. It writes compare.png and compare.json, and takes one to
    two minutes.

    With --work the operator of canshaper work who catches the swing works with each filter, at
    30 cm and 6 degrees and where only the tip counts: seconds a move, empty grapple / log. Ctrl-C
    shows the results so far. --fleet adds two rows: the file's own filters, and those that
    canshaper robust --fleet designs.

    For a crane with a rope it prints one table: the swing left by rope length and work, compared
    with ZVD for one length and ZV by length; a filter for two modes is compared with ZV of both.

    Examples:

      canshaper compare

      canshaper compare config/forwarder-sensor.yaml

      canshaper compare config/forwarder.yaml

      canshaper compare --work

      canshaper compare --json --processes 1
    """
    from canshaper.cli.results import Results
    from canshaper.design.comparison.manoeuvres import candidates, manoeuvres
    from canshaper.design.comparison.measure import measure_all
    from canshaper.design.comparison.ropes import on_rope
    from canshaper.design.comparison.summary import AXIS, least, limits_for, recommendations, rows
    from canshaper.design.profiles import swinging_axis
    from canshaper.report.console import progress_bar

    deployment = loader(file)()
    results = Results("Comparison of filters", deployment, report, picture, quiet=as_json)
    if on_rope(deployment):
        if work or fleet:
            raise UsageError("--work, --fleet: expected slew and near-far, got a rope")
        _ropes(deployment, results, out, processes, as_json=as_json)
        return
    out.mkdir(parents=True, exist_ok=True)  # an error here comes before minutes of driving
    tasks = manoeuvres()
    filters = candidates(deployment)
    if fleet:
        filters += _for_fleet(deployment, processes)
    with progress_bar(f"{len(filters)} filters, {len(tasks)} manoeuvres") as on_progress:
        outcomes = measure_all(
            deployment.path, filters, tasks, on_progress=on_progress, processes=processes
        )
        limits = least(deployment)
    table = rows(filters, outcomes)
    advice = recommendations(table, swinging_axis(deployment, AXIS)[1].mode().period_s)
    data: dict[str, Any] = {
        "rows": [asdict(row) for row in table],
        "recommendations": {k: {"filter": r.name, "why": why} for k, (r, why) in advice.items()},
        "limits": [asdict(limit) for limit in limits],
    }
    tables = [_residuals(table), _felt(table), _worst(table), _limits(limits)]
    interrupted = ""
    if work:
        shown, data["work"], interrupted = _work(deployment, filters, seeds, processes)
        tables.insert(0, shown)
    text = json.dumps({**data, "outcomes": [asdict(o) for o in outcomes]}, indent=2)
    (out / "compare.json").write_text(text + "\n", encoding="utf-8")
    if as_json:
        echo(json.dumps(data, indent=2))
    for shown in tables:
        results.print(shown)
    for _, why in advice.values():
        results.print(f"- {why}.")

    def figure() -> "Figure":
        from canshaper.report.pareto import Point
        from canshaper.report.pareto import figure as of_points

        points = [Point(r.name, r.ours, r.stop_s, r.rise_s, r.worst_30_deg) for r in table]
        return of_points(points, limits_for(deployment, outcomes), title)

    off = next(row for row in table if row.name == "off")
    calm = advice["calm"][0]
    title = f"{calm.name} leaves {calm.worst_30_deg:.1f}° of {off.worst_30_deg:.1f}° at worst"
    results.picture_line(results.picture(out / "compare.png", figure))
    results.write()
    end_interrupted(interrupted)


def _ropes(
    deployment: "Deployment",
    results: "Results",
    out: Path,
    processes: int | None,
    *,
    as_json: bool,
) -> None:
    """Compare the filters of a crane with a rope, print the table and write it."""
    from canshaper.design.comparison.ropes import compare_ropes
    from canshaper.report.console import new_table, progress_bar

    with progress_bar("ropes") as on_progress:
        table = compare_ropes(deployment, on_progress, processes)
    cells = [*next(iter(table.values()))]
    shown = new_table("left, deg", *(cell.replace(" m ", " m\n") for cell in cells))
    for name, row in table.items():
        shown.add_row(name, *(f"{row[cell]:.2f}" for cell in cells))
    out.mkdir(parents=True, exist_ok=True)
    (out / "compare.json").write_text(
        json.dumps({"ropes": table}, indent=2) + "\n", encoding="utf-8"
    )
    if as_json:
        echo(json.dumps({"ropes": table}, indent=2))
    results.print(shown)
    results.write()


def _for_fleet(deployment: "Deployment", processes: int | None) -> "list[Candidate]":
    """Return two candidates: the filters of the file, and robust ones for its fleet."""
    from canshaper.campaign.fleet import design_fleet
    from canshaper.campaign.fleet_candidates import FLEET, ROBUST
    from canshaper.config.filters import filter_of
    from canshaper.design.comparison.manoeuvres import AXES, Candidate
    from canshaper.design.parallel import Processes
    from canshaper.report.console import progress_bar

    with progress_bar("for the fleet") as on_progress:
        workers = Processes(processes)
        made, _ = design_fleet(deployment, ROBUST, None, workers, on_progress, front=False)
    fleet = {one.axis: filter_of(**one.section) for one in made.filters if one.axis in AXES}
    sway = {one.axis: one.sway for one in made.filters}
    own = {axis: deployment.axes[axis].config.filter for axis in fleet}
    return [
        Candidate("the file's", own, ours=True),
        Candidate(FLEET, fleet, ours=True, sway=sway),
    ]


def _work(
    deployment: "Deployment", filters: "list[Candidate]", seeds: int, processes: int | None
) -> "tuple[Table, dict[str, Any], str]":
    """Return seconds a move with each filter: table, data, and where Ctrl-C ended it, or ""."""
    from canshaper.campaign.run import Source
    from canshaper.campaign.work import SetUp
    from canshaper.campaign.work_results import OFF, TASKS, as_data, at_work, choice
    from canshaper.report.console import progress_bar

    source = Source.of(deployment, deployment.config.uncertainty)
    set_ups = [OFF, *(SetUp(one.name, candidate=one) for one in filters if one.name != OFF.name)]
    tasks = {name: TASKS[name] for name in ("loading", "tip only")}
    with progress_bar("operators at work") as on_progress:
        workers = engine(processes, None)
        moves, interrupted = at_work(workers, source, set_ups, tasks, on_progress, seeds=seeds)
    return choice("seconds a move", tasks, moves)[0], as_data(moves), interrupted


def _residuals(table: "list[Row]") -> "Table":
    """Return a table of the largest swing left, degrees, by kind of work."""
    from canshaper.report.console import new_table

    drawn = new_table("left, deg", *_WORKS)
    for row in table:
        left = [row.worst_deg[work] for work in _WORKS.values()]
        cells = [f"{deg:.2f}" if deg < 9.995 else f"{deg:.1f}" for deg in left]
        drawn.add_row(row.name, *cells, style="bold" if row.ours else None)
    return drawn


def _felt(table: "list[Row]") -> "Table":
    """Return a table of what the operator feels of each filter."""
    from canshaper.report.console import new_table

    heads = ["still\ns", "rise\ns", "stop\ns", "stop\nm", "slew\nm", "dip,re-\nrise %"]
    drawn = new_table("felt", *heads, "peak\ndeg", "tap %,\nmoves", "way\n%")
    for row in table:
        seconds = [f"{'>' * row.swings_on}{row.still_s:.1f}"]
        seconds += [f"{value:.2f}" for value in (row.rise_s, row.stop_s)]
        metres = [f"{value:.2f}" for value in (row.run_on_m, row.slew_run_on_m)]
        feel = [f"{100 * row.dip:.0f}/{100 * row.re_rise:.0f}", f"{row.peak_deg:.1f}"]
        ways = [f"{100 * row.tap_part:.0f}/{row.tap_movements}", f"{100 * row.path_part:.0f}"]
        cells = (*seconds, *metres, *feel, *ways)
        drawn.add_row(row.name, *cells, style="bold" if row.ours else None)
    return drawn


def _worst(table: "list[Row]") -> "Table":
    """Return a table of the most swing left with wrong lengths, and which of ours beats that."""
    from canshaper.design.comparison.summary import beaten_by
    from canshaper.report.console import new_table

    drawn = new_table("worst, deg", "15 %", "30 %", "in", "beaten by")
    for row in table:
        better = None if row.ours or row.name == "off" else beaten_by(row, table)
        degrees = (f"{row.worst_15_deg:.1f}", f"{row.worst_30_deg:.1f}")
        name = better.name if better else ""
        drawn.add_row(row.name, *degrees, row.worst_case, name, style="bold" if row.ours else None)
    return drawn


def _limits(limits: "list[Least]") -> "Table":
    """Return a table of the least swing, %, that any shaper of near-far leaves, by its duration."""
    from canshaper.report.console import new_table

    heads = ("ours\n±15 %", "no dip\n±15 %", "any\n±15 %", "no dip\n±30 %")
    drawn = new_table("limit, % of swing", *heads)
    for least in limits:
        parts = (least.ours_15, least.no_dip_15, least.any_15, least.no_dip_30)
        drawn.add_row(f"{least.duration_s:.1f} s", *(f"{100 * part:.1f}" for part in parts))
    return drawn
