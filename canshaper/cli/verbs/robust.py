"""``canshaper robust``: design the robust shaper of an axis."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import EXIT_USELESS, FILE, PICTURE, REPORT, loader, refuse_shipped
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from canshaper.commissioning.robust import RobustDesign
    from canshaper.machine.deployment import Deployment

GROUP = "design"


def robust(
    file: str = FILE,
    axis: str | None = typer.Option(None, "--axis", help="Axis to design for."),
    fleet: bool = typer.Option(
        False, "--fleet", help="Design every swinging axis, for the drives of a campaign."
    ),
    range_pct: float = typer.Option(15.0, "--range", help="Pendulum length error covered, +- %."),
    lengths: str | None = typer.Option(
        None,
        "--lengths",
        metavar="LOW:HIGH",
        help="Instead: shortest and longest pendulum in m, for a load without a signal, or of a"
        " rope that the axis follows.",
    ),
    loads: bool = typer.Option(
        False, "--loads", help="Design every breakpoint of the gain schedule."
    ),
    duration_s: float | None = typer.Option(
        None,
        "--duration",
        help="Length of the impulse response in s; with --loads for the shortest swing. Default:"
        " 0.77 of a swing, with --lengths one.",
    ),
    residual_pct: float | None = typer.Option(
        None, "--residual", help="Instead: the shortest that leaves at most this % of the swing."
    ),
    second: str | None = typer.Option(
        None,
        "--second",
        metavar="PERIOD,DAMPING,RANGE",
        help="A second mode too: s, damping ratio, +- % of its length; or none. Default: that"
        " of the filter in the file.",
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

    With --lengths one response holds from an empty grapple to a full one; the swing in the file
    becomes that of the middle. Of several least taps the one counts that leaves least through the
    limits of the axis. Of an axis that follows its rope they are that rope's, and the response is
    that of the shortest, within --range. With --loads the table has what each design leaves with
    the other loads.

    With --fleet the worst of 400 drives, drawn from the file's "uncertainty" as those of a
    campaign, leave least; 1000 others judge it, next to the file, to a box of all lengths, and to
    quicker and slower responses. It takes minutes, and a C compiler.

    With --second it leaves a second mode in peace too, such as that of grapple and rotator with
    long logs or of hook and load, and prints what that costs and gains. The picture, with --picture
    or --report, has impulses, step and residual over length next to those of the filter in the
    file.

    Examples:

      canshaper robust config/forwarder.yaml --axis near_far

      canshaper robust machine.yaml --axis slew --range 30 --duration 2.4 --write

      canshaper robust config/forwarder.yaml --axis near_far --residual 5

      canshaper robust config/forwarder.yaml --axis near_far --lengths 1.2:1.6

      canshaper robust config/forwarder-load.yaml --axis near_far --loads --duration 1.8

      canshaper robust bridge.yaml --axis trolley --lengths 2:30 --range 5

      canshaper robust config/forwarder.yaml --axis near_far --second 0.6,0.1,20

      canshaper robust config/forwarder.yaml --axis slew --report slew.html

      canshaper robust config/forwarder-robust.yaml --fleet --duration 2 --picture front.svg
    """
    from canshaper.cli.results import Results
    from canshaper.commissioning.origins import refuse_scheduled, written_line
    from canshaper.commissioning.robust import design_loads, design_robust
    from canshaper.commissioning.robust_report import (
        figure,
        lines_for_file,
        print_design,
        print_loads,
        write_design,
    )

    deployment = loader(file)()
    if write:
        refuse_shipped(file)
    if fleet:
        others = axis, lengths, loads, residual_pct, second, as_json
        if any(others):
            raise UsageError("--fleet: expected only --duration, --write, --picture, --report")
        for_fleet(deployment, "robust", duration_s, write, report, picture)
        return
    if axis is None:
        raise UsageError("expected --axis AXIS, or --fleet, got neither")
    results = Results(f"Robust shaper for {axis}", deployment, report, picture, quiet=as_json)
    lengths_m = _lengths(lengths)
    if loads and lengths_m:
        raise UsageError("expected one of --lengths and --loads, got both")
    if write and not loads and not lengths_m:
        own = "--lengths LOW:HIGH that while the load is not known"
        refuse_scheduled(deployment, axis, f"--loads writes all of them, {own}")
    options: dict[str, Any] = {"range_pct": range_pct, "residual_pct": residual_pct}
    options |= {"duration_s": duration_s, "second": second}
    if loads:
        designs = design_loads(deployment, axis, **options)
        show = partial(print_loads, deployment, designs)
    else:
        designs = [design_robust(deployment, axis, lengths_m=lengths_m, **options)]
        show = partial(print_design, deployment, designs[0])
    useless = any(one.verdict.useless for one in designs) and not force
    write = write and not useless

    def finish() -> list[str]:
        if not write:
            return lines_for_file(designs)
        return [*write_design(deployment, *designs), written_line(deployment.path)]

    def data(path: Path | None) -> dict[str, Any]:
        data = {"loads": [*map(_result, designs)]} if loads else _result(designs[0])
        return data | {"picture": path, "written": deployment.path if write else None}

    results.conclude(
        show,
        figure=lambda: figure(designs[0]),
        data=data if as_json else None,
        finish=finish,
        code=EXIT_USELESS if useless else 0,
    )


def for_fleet(
    deployment: "Deployment",
    kind: str,
    duration_s: float | None,
    write: bool,
    report: Path | None,
    picture: Path | None,
) -> None:
    """Design the filters of all swinging axes for a fleet, and print them; ``write`` them if asked.

    ``kind`` is robust or gff; ``duration_s`` the length of their responses, None: by the file.
    """
    from canshaper.campaign.fleet import design_fleet
    from canshaper.campaign.fleet_candidates import figure, table, verdict, write_fleet
    from canshaper.cli.results import Results
    from canshaper.commissioning.origins import written_line
    from canshaper.design.parallel import Processes
    from canshaper.edit.edit import flow
    from canshaper.report.console import progress_bar

    results = Results("Filters for a fleet", deployment, report, picture)
    with progress_bar("candidates") as on_progress:
        asked, rows = design_fleet(deployment, kind, duration_s, Processes(), on_progress)

    def finish() -> list[str]:
        if write:
            verb = "tune" if kind == "gff" else kind
            return [*write_fleet(deployment, asked.filters, verb), written_line(deployment.path)]
        return [
            f"axes.{one.axis}:\n  sway: {flow(one.sway)}\n  filter: {flow(one.section)}"
            + (f"\n  limits: {flow({'tail_s': one.tail_s})}" if one.tail_s else "")
            for one in asked.filters
        ]

    def show(to: Results) -> None:
        to.print(table(asked, rows))
        to.print(verdict(asked, rows), soft_wrap=True)

    results.conclude(show, figure=lambda: figure(rows), finish=finish)


def _lengths(text: str | None) -> tuple[float, float] | None:
    """Return the shortest and the longest pendulum of the option --lengths, m; None without it."""
    if text is None:
        return None
    try:
        low_m, high_m = (float(word) for word in text.split(":"))
    except ValueError:
        raise UsageError(
            f"--lengths: expected LOW:HIGH in m, such as 1.2:1.6, got {text}"
        ) from None
    if not 0.05 <= low_m <= high_m <= 150.0:
        most = min(high_m, 150.0)
        raise UsageError(f"--lengths: expected LOW of 0.05 to {most:g} m, up to HIGH, got {text}")
    return low_m, high_m


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
