"""``canshaper robust``: design the robust shaper of an axis."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import EXIT_USELESS, FILE, PICTURE, REPORT, echo, loader, refuse_shipped

if TYPE_CHECKING:
    from canshaper.commissioning.robust import RobustDesign

GROUP = "design"


def robust(
    file: str = FILE,
    axis: str = typer.Option(..., "--axis", help="Axis to design for."),
    range_pct: float = typer.Option(15.0, "--range", help="Pendulum length error covered, +- %."),
    duration_s: float | None = typer.Option(
        None, "--duration", help="Length of the impulse response in s. Default: 0.77 of a swing."
    ),
    residual_pct: float | None = typer.Option(
        None, "--residual", help="Instead: the shortest that leaves at most this % of the swing."
    ),
    second: str | None = typer.Option(
        None,
        "--second",
        metavar="PERIOD,DAMPING,RANGE",
        help="A second mode too: s, damping ratio, +- % of its length.",
    ),
    write: bool = typer.Option(False, "--write", help="Write filter and tail into the file."),
    force: bool = typer.Option(False, "--force", help="Write what leaves half of the swing too."),
    as_json: bool = typer.Option(False, "--json", help="Print everything as JSON."),
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
) -> None:
    """Design the shaper that leaves least swing over a range of pendulum lengths.

    A non-negative impulse response within the valve's rate, by linear programming, with a least tap
    that makes one movement of a tap of the joystick. Prints what it does, whether that is good and,
    without --write, the lines for the file. Exit code 1 where more than half of the swing is left.

    With --second it leaves a second mode in peace too, such as that of grapple and rotator with
    long logs, and prints what that costs and gains. The picture, with --picture or --report, has
    impulses, step and residual over length next to those of the filter in the file.

    Examples:

      canshaper robust config/forwarder.yaml --axis near_far

      canshaper robust machine.yaml --axis slew --range 30 --duration 2.4 --write

      canshaper robust config/forwarder.yaml --axis near_far --residual 5

      canshaper robust config/forwarder.yaml --axis near_far --second 0.6,0.1,20

      canshaper robust config/forwarder.yaml --axis slew --report slew.html
    """
    from canshaper.cli.results import Results
    from canshaper.commissioning.filter_file import written_line
    from canshaper.commissioning.robust import (
        design_robust,
        figure,
        print_design,
        write_design,
    )
    from canshaper.edit.edit import flow

    deployment = loader(file)()
    results = Results(f"Robust shaper for {axis}", deployment, report, picture, quiet=as_json)
    if write:
        refuse_shipped(file)
    one = design_robust(
        deployment,
        axis,
        range_pct=range_pct,
        duration_s=duration_s,
        residual_pct=residual_pct,
        second=second,
    )
    print_design(deployment, one, results)
    if path := results.picture(None, lambda: figure(one)):
        results.picture_line(path)
    useless = one.verdict.useless and not force
    write = write and not useless
    changed = write_design(deployment, one) if write else []
    if as_json:
        files = {"picture": path, "written": deployment.path if write else None}
        echo(json.dumps(_result(one) | files, indent=2, default=str))
    lines = [*changed, written_line(deployment.path)] if write else [f"filter: {flow(one.section)}"]
    results.print("\n".join(lines), soft_wrap=True)
    results.write()
    if useless:
        raise typer.Exit(EXIT_USELESS)


def _result(one: "RobustDesign") -> dict[str, Any]:
    """Return the design for ``--json``."""
    return {
        "axis": one.bound.name,
        "filter": one.section,
        "residual": one.shaper.residual,
        "mean_delay_s": one.shaper.mean_delay_s,
        "measures": asdict(one.measured),
        "tail_needed_s": one.needed_s,
        "verdict": one.verdict.as_dict(),
    }
