"""``canshaper profiles``: what each profile of a deployment does."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import PROCESSES, SET, echo, end_interrupted, engine, loader
from canshaper.errors import DesignError, UsageError

if TYPE_CHECKING:
    from rich.table import Table

    from canshaper.machine.deployment import Deployment

GROUP = "measure"

_ALMOST = 0.95  # a response counts as over when 5 % are left


def profiles(
    file: str = typer.Argument(
        "forwarder-load.yaml", help="Deployment file; by default a shipped one."
    ),
    work: bool = typer.Option(
        True, "--work/--no-work", help="Measure the seconds a move too; takes minutes."
    ),
    seeds: int = typer.Option(6, "--seeds", min=2, help="Working cycles with each profile."),
    processes: int | None = PROCESSES,
    changes: list[str] | None = SET,
    as_json: bool = typer.Option(False, "--json", help="Print the figures as JSON, no table."),
) -> None:
    """Measure what each profile of a deployment does, and which is the right one for a tolerance.

    The simulated crane gets a full deflection of 3 s, with the file's limits. The first table has:
    how long the grapple swings after release (until still_deg of the file), how long and how far
    the axis runs on, the largest swing, and the swing left with the right pendulum length and with
    one that is 15 % longer or shorter. "normal" is the axis' own filter, "off" is anti-sway off.

    The second table has the seconds a move, empty grapple / log, of the operators of canshaper
    work: one who waits, at 30 cm and 2 degrees, and one who catches the swing, at 30 cm and 6
    degrees, at 60 cm and 20 degrees, and where only the tip counts. Bold: the tasks for which the
    profiles precise, loading (or the own filter) and rough are meant. Red: slower than off, or a
    response shorter than half a swing.

    Examples:

      canshaper profiles

      canshaper profiles machine.yaml --no-work

      canshaper profiles --set grapple.l2_m=1.4  # 0.2 m longer

      canshaper profiles machine.yaml --json
    """
    from canshaper.design.profiles import figures
    from canshaper.report.console import SafeConsole, new_table
    from canshaper_sim.parameters import changed_parameters

    deployment = loader(file)()
    crane = changed_parameters(changes or [], deployment)
    try:
        results = list(figures(deployment, crane))
    except DesignError as error:
        raise UsageError(f"{deployment.path}: {error}") from None
    faults, data, interrupted = [*_too_short(deployment)], dict[str, Any](), ""
    if work:
        data, at_work, slower, interrupted = _work(deployment, changes or [], seeds, processes)
        faults += slower
    if as_json:
        presses = [asdict(one) for one in results]
        echo(json.dumps({"presses": presses, "work": data, "faults": faults}, indent=2))
        end_interrupted(interrupted)
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
    console = SafeConsole()
    console.print(table)
    if data:
        console.print(at_work)
    for fault in faults:
        console.print(fault, style="red")
    end_interrupted(interrupted)


def _too_short(deployment: "Deployment") -> Iterator[str]:
    """Yield a fault for each filter that calms a swing but is over before half a swing."""
    from canshaper.design.tuning.evaluate import Machine, evaluate, shaper_of
    from canshaper.machine.filters import every_filter
    from canshaper.shaping.registry import KINDS

    for axis, bound in deployment.axes.items():
        tick_s = bound.period_ticks * deployment.config.tick_ms / 1000.0
        for place, chosen, sway in every_filter((axis,), bound.config):
            if sway is None or not KINDS[chosen.kind].needs_sway:
                continue
            mode, machine = sway.mode(), Machine.of(bound)
            shaper_for = shaper_of(chosen, tick_s, bound.config.limits.slowest_per_s)
            lasts_s = evaluate(mode, tick_s, shaper_for, machine, (0,)).run_on_s
            half_s = 0.5 * mode.period_s
            if lasts_s < _ALMOST * half_s:
                name = ".".join(map(str, place))
                expected = f"expected half a swing, {half_s:.2f} s, or longer"
                yield f"{name}: {expected}, got {lasts_s:.2f} s"


def _work(
    deployment: "Deployment", changes: list[str], seeds: int, processes: int | None
) -> "tuple[dict[str, Any], Table, list[str], str]":
    """Return the seconds a move by task and profile, as data and table, faults, and an end.

    A profile that is slower than off is a fault. The end says where Ctrl-C interrupted, else "".
    """
    from canshaper.campaign.run import Source
    from canshaper.campaign.work import SetUp
    from canshaper.campaign.work_results import OFF, TASKS, as_data, at_work, choice
    from canshaper.inputs.value import profile_names
    from canshaper.report.console import progress_bar

    source = Source.of(deployment, deployment.config.uncertainty, changes)
    set_ups = [OFF, *map(SetUp, profile_names(deployment.config))]
    with progress_bar("operators at work") as on_progress:
        workers = engine(processes, None)
        moves, interrupted = at_work(workers, source, set_ups, TASKS, on_progress, seeds=seeds)
    return as_data(moves), *choice("seconds a move", TASKS, moves), interrupted
