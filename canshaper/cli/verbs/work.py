"""``canshaper work``: seconds a move that anti-sway saves a model operator."""

import math
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import typer

from canshaper.cli.common import PICTURE, PROCESSES, REPORT, SET, engine, loader
from canshaper.errors import UsageError

GROUP = "design"

_CM, _DEG = (1.0, 300.0), (0.5, 90.0)


def work(
    file: str = typer.Argument(
        "forwarder-robust.yaml", help="Deployment file; by default a shipped one."
    ),
    tolerance: tuple[float, float] = typer.Option(
        (30.0, 6.0),
        "--tolerance",
        help="Distance of the tip from the target, cm, and swing, degrees (90: any).",
    ),
    seeds: int = typer.Option(12, "--seeds", min=2, help="Working cycles of each operator."),
    operators: list[str] | None = typer.Option(
        None,
        "--operator",
        metavar="NAME=VALUE",
        help="Change an operator, such as novice.reaction_s=0.4.",
    ),
    processes: int | None = PROCESSES,
    changes: list[str] | None = SET,
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
) -> None:
    """Let model operators load logs, anti-sway off and on, and compare the seconds a move.

    An operator moves the empty grapple out to the pile and a log back, ten moves in all. A move
    ends when tip and load were within the tolerance for 0.3 s. There are three operators: a skilled
    one who catches the swing, a skilled one who waits until it has decayed, and a novice. Each
    practises with anti-sway off and on, and then works with its fastest technique. Off and on use
    the same seeds; the bounds come from the bootstrap. It takes minutes.

    Examples:

      canshaper work

      canshaper work forwarder.yaml --tolerance 50 12

      canshaper work --tolerance 30 90  # only the tip counts

      canshaper work --set pump_flow=1.2 --operator novice.reaction_s=0.4
    """
    from canshaper.campaign.run import Source
    from canshaper.campaign.work import SetUp
    from canshaper.campaign.work_results import do_all, figure, practised, table
    from canshaper.cli.results import Results
    from canshaper.report.console import progress_bar
    from canshaper_sim.operator_model import Operators
    from canshaper_sim.parameters import changed, changed_parameters

    people = changed(Operators(), operators or [], "--operator")
    for given, (low, high), unit in zip(tolerance, (_CM, _DEG), ("cm", "degrees"), strict=True):
        if not low <= given <= high:
            expected = f"expected {low:g} .. {high:g} {unit}"
            raise UsageError(f"--tolerance: {expected}, got {given:g}")
    deployment = loader(file)()
    changed_parameters(changes or [], deployment)  # a wrong one is reported before the work
    results = Results("Seconds a move", deployment, report, picture)
    source = Source.of(deployment, deployment.config.uncertainty, changes or [])
    within = tolerance[0] / 100.0, tolerance[1] if tolerance[1] < _DEG[1] else math.inf
    set_ups = [SetUp(bypass=bypass) for bypass in (True, False)]
    by_name = {one.name: getattr(people, one.name) for one in fields(people)}
    with progress_bar("practice") as on_progress:
        do = partial(do_all, engine(processes, None), source, on_progress)
        plans = practised(source, set_ups, by_name, within, do)
        on_progress(0.0, "work")
        done = do([replace(one, seed=str(seed)) for seed in range(seeds) for one in plans])
    results.print(table(done))
    shown = [next(one for one in done if one.set_up == set_up) for set_up in set_ups]
    if path := results.picture(None, lambda: figure(source, shown)):
        results.picture_line(path)
    results.write()
