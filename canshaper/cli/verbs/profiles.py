"""``canshaper profiles``: what each profile of a deployment does."""

import json
from dataclasses import asdict

import typer

from canshaper.cli.common import echo, loader
from canshaper.errors import DesignError, UsageError

GROUP = "measure"


def profiles(
    file: str = typer.Argument(
        "j1939-profiles.yaml", help="Deployment file; by default a shipped one."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print the figures as JSON, no table."),
) -> None:
    """Measure what each profile of a deployment does with a full press of 3 s.

    On the simulated crane, with the file's limits: how long the grapple swings after release (until
    still_deg of the file), how long and far the axis runs on, the
    largest swing, and what is left of it with the right pendulum length and with one that is 15 %
    longer or shorter. "normal" is the axis' own filter.

    Examples:

      canshaper profiles

      canshaper profiles machine.yaml --json
    """
    from canshaper.design.profiles import figures
    from canshaper.report.console import SafeConsole, new_table

    deployment = loader(file)()
    try:
        results = list(figures(deployment))
    except DesignError as error:
        raise UsageError(f"{deployment.path}: {error}") from None
    if as_json:
        echo(json.dumps([asdict(one) for one in results], indent=2))
        return
    heads = ("still, s", "run-on, s", "travel, s", "swing, deg", "left, deg", "±15 %, deg")
    table = new_table("axis, profile", *heads)
    for one in results:
        table.add_row(
            f"{one.axis}, {one.profile}",
            f"{'>' * one.swings_on}{one.still_s:.1f}",
            f"{one.run_on_s:.2f}",
            f"{one.run_on_travel_s:.2f}",
            f"{one.peak_deg:.1f}",
            f"{one.residual_deg:.2f}",
            f"{one.residual_wrong_deg:.1f}",
        )
    SafeConsole().print(table)
