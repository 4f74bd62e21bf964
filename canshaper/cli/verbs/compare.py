"""``canshaper compare``: every filter on the same work."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import echo, loader, picture, picture_line

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from canshaper.design.comparison.summary import Row


def compare(
    file: str = typer.Argument("forwarder.yaml", help="Deployment file; by default a shipped one."),
    axis: str = typer.Option("near_far", "--axis", help="Axis that is driven."),
    out: Path = typer.Option(Path("out/compare"), "--out", help="Directory for picture and data."),
    as_json: bool = typer.Option(False, "--json", help="Print the rows as JSON, no table."),
    processes: int | None = typer.Option(
        None, "--processes", min=1, help="Processes; by default one a processor."
    ),
) -> None:
    """Drive every filter through the same manoeuvres and say which to take.

    Pulse, partial stroke, early release, reversal, double tap and loading cycle at -30 to +30 %
    pendulum length, random sticks of twelve seeds and a start with swing, on the simulated crane
    with the valves' lag, deadband, rate limit and resolution, under the output limits of the
    file. Below the table it says for every other shaper which of ours stops at least as soon and
    leaves less swing within 30 % length. Writes compare-AXIS.png and compare-AXIS.json. Takes
    about a minute.

    Examples:

      canshaper compare

      canshaper compare config/forwarder.yaml --axis slew

      canshaper compare --json --processes 1
    """
    from canshaper.design.comparison.candidates import candidates, nominal_mode
    from canshaper.design.comparison.manoeuvres import manoeuvres
    from canshaper.design.comparison.measure import measure_all
    from canshaper.design.comparison.summary import recommendations, rows
    from canshaper.report.console import SafeConsole, progress_bar

    console = SafeConsole(stderr=as_json)
    deployment = loader(file)()
    found = candidates(deployment, axis)
    tasks = manoeuvres(axis)
    try:
        with progress_bar(f"{len(found)} filters, {len(tasks)} manoeuvres") as on_progress:
            outcomes = measure_all(
                deployment.path, axis, found, tasks, on_progress=on_progress, processes=processes
            )
    except KeyboardInterrupt:
        echo("interrupted", err=True)
        raise typer.Exit(130) from None
    table = rows(found, outcomes)
    advice = recommendations(table, nominal_mode(deployment, axis).period_s)
    data = {
        "axis": axis,
        "rows": [asdict(row) for row in table],
        "recommendations": {k: {"filter": r.name, "why": why} for k, (r, why) in advice.items()},
    }
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps({**data, "outcomes": [asdict(o) for o in outcomes]}, indent=2)
    (out / f"compare-{axis}.json").write_text(text + "\n", encoding="utf-8")
    if as_json:
        echo(json.dumps(data, indent=2))
    else:
        _print_rows(table, [why for _, why in advice.values()], console, slew=axis == "slew")

    def draw(path: Path) -> None:
        from canshaper.design.comparison.limits import limits_for
        from canshaper.report.pareto import Point
        from canshaper.report.pareto import draw as draw_points

        points = [Point(r.name, r.ours, r.stop_s, r.rise_s, r.worst_30_deg) for r in table]
        draw_points(points, limits_for(deployment, axis, outcomes), title, path)

    off = next(row for row in table if row.name == "off")
    calm = advice["calm"][0]
    title = (
        f"{axis.replace('_', '-').capitalize()}: {calm.name} leaves {calm.worst_30_deg:.1f}°"
        f" of {off.worst_30_deg:.1f}° in the worst case"
    )
    console.print(picture_line(picture(out / f"compare-{axis}.png", draw)))


def _print_rows(table: "list[Row]", advice: list[str], console: "Console", *, slew: bool) -> None:
    """Table, recommendations, and which of ours beats each of the others."""
    from canshaper.design.comparison.summary import beaten_by

    console.print(_table(table, slew=slew))
    for why in advice:
        console.print(f"- {why}.")
    for row in table:
        if row.name != "off" and not row.ours:
            better = beaten_by(row, table)
            text = f"beaten by {better.name}" if better else "not beaten by any of ours"
            console.print(f"  {row.name}: {text}", style="dim")


def _table(table: "list[Row]", *, slew: bool) -> "Table":
    from canshaper.report.console import new_table

    heads = ["stop\ns"] + ([] if slew else ["rise\ns"])
    heads += ["res.\ndeg", "15 %\ndeg", "30 %\ndeg", "rand.\ndeg"]
    heads += ["other\ndeg"] if slew else []
    heads += ["peak\ndeg", "dip\n%"] + ([] if slew else ["re-\nrise"])
    drawn = new_table("filter", *heads)
    for row in table:
        cells = [f"{row.stop_s:.2f}"] + ([] if slew else [f"{row.rise_s:.2f}"])
        cells += [f"{row.residual_deg:.2f}", f"{row.worst_15_deg:.1f}", f"{row.worst_30_deg:.1f}"]
        cells += [f"{row.random_deg:.2f}"]
        cells += [f"{row.cross_deg:.2f}"] if slew else []
        cells += [f"{row.peak_deg:.1f}", f"{100 * row.dip:.0f}"]
        cells += [] if slew else [f"{100 * row.re_rise:.0f}"]
        drawn.add_row(row.name, *cells, style="bold" if row.ours else None)
    return drawn
