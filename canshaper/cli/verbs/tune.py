"""``canshaper tune``: the optimal filter of an axis, shown, drawn and written on request."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import FILE, PICTURE, REPORT, echo, loader, refuse_shipped
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from canshaper.cli.results import Results
    from canshaper.config.limits import Sway
    from canshaper.design.tuning.deploy import Setting
    from canshaper.design.tuning.evaluate import Machine
    from canshaper.design.tuning.formulation import Task
    from canshaper.design.tuning.optimal import Tuning
    from canshaper.machine.deployment import Deployment
    from canshaper.machine.valves import BoundAxis

GROUP = "design"


def tune(
    file: str = FILE,
    axis: str = typer.Option(..., "--axis", help="Axis to tune."),
    method: str = typer.Option("optimal", "--method", help="optimal, or the paper's manual rule."),
    q: float = typer.Option(1.0, "--q", help="Weight Q of swing angle and rate."),
    r: float = typer.Option(1.0, "--r", help="Weight R of the rise to 95 %."),
    s: float = typer.Option(3.0, "--s", help="Weight S of the distance from the joystick."),
    p: float = typer.Option(1.0, "--p", help="Weight P of changes of the output."),
    states: str = typer.Option(
        "sway", "--states", help="What Q weighs: sway, deviation, companion, none."
    ),
    horizon_s: float = typer.Option(3.0, "--horizon", help="Seconds that a step is watched."),
    pole_distance: str = typer.Option(
        "text", "--pole-distance", help="Eq. 14e: text (at least 5 times), printed (at most), off."
    ),
    within_command: bool | None = typer.Option(
        None,
        "--within-command/--beyond-command",
        help="Output never above the command. Default: as allow_faster of the axis says.",
    ),
    max_jump: float | None = typer.Option(
        None, "--max-jump", help="Largest part of a step that comes out at once."
    ),
    max_rate: float | None = typer.Option(
        None,
        "--max-rate",
        help="Rate of the valve, full speeds/s, inf for none. Default: rise and fall of the axis.",
    ),
    third_pole: bool = typer.Option(
        False, "--third-pole", help="A third pole, so that no part of a step comes out at once."
    ),
    max_run_on_s: float | None = typer.Option(
        None, "--max-run-on", help="Seconds until a step has settled to 5 %."
    ),
    length_range_pct: float | None = typer.Option(
        None,
        "--length-range",
        help="Instead of Eq. 15: least worst swing for lengths of -X to +X %. Run-on: tail_s.",
    ),
    starts: int = typer.Option(3, "--starts", help="Starts of the solver."),
    out: Path = typer.Option(Path("out/tune"), "--out", help="Directory for the picture."),
    write: bool = typer.Option(False, "--write", help="Write filter and tail into the file."),
    as_json: bool = typer.Option(False, "--json", help="Print everything as JSON."),
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
) -> None:
    """Find the best poles of an axis' G_FF, show what they do, write them on request.

    Prints the setting next to the one in the file, how much swing is left when the pendulum is up
    to 30 % longer or shorter, and what holds the optimum; draws OUT/AXIS.png. Exit code 2 where
    nothing fits, with what conflicts.

    Examples:

      canshaper tune config/forwarder.yaml --axis slew

      canshaper tune machine.yaml --axis near_far --third-pole --write

      canshaper tune config/forwarder.yaml --axis slew --length-range 15 --max-run-on 1.9

      canshaper tune config/forwarder.yaml --axis near_far --q 1 --r 2 --s 0 --p 0.03

      canshaper tune config/forwarder.yaml --axis slew --method manual
    """
    from canshaper.cli.results import Results
    from canshaper.design.profiles import swinging_axis
    from canshaper.report.console import progress_bar

    deployment = loader(file)()
    results = Results(f"Filter for {axis}", deployment, report, picture, quiet=as_json)
    if write:
        refuse_shipped(file)
    bound, sway = swinging_axis(deployment, axis)
    try:
        required: dict[str, Any] = {
            "max_jump": max_jump,
            "max_rate_per_s": max_rate,
            "max_run_on_s": max_run_on_s,
            "third_pole": third_pole,
        }
        beyond = length_range_pct is not None or any(required.values())
        required |= {"pole_distance": pole_distance, "within_command": within_command}
        task = _task(
            deployment,
            bound,
            sway,
            (q, r, s, p),
            required,
            states=states,
            horizon_s=horizon_s,
            length_range_pct=length_range_pct,
        )
        with progress_bar(axis) as on_progress:

            def show(done: float, what: str) -> None:
                on_progress(done, f"{axis}: {what}")

            tuning = _solve(task, method, starts, show, beyond=beyond)
        _report(deployment, bound, task, tuning, out, results, write=write, as_json=as_json)
    except ValueError as error:
        raise UsageError(f"axis {axis}: {error}") from None


def _task(
    deployment: "Deployment",
    bound: "BoundAxis",
    sway: "Sway",
    weights: tuple[float, float, float, float],
    required: dict[str, Any],
    **options: Any,
) -> "Task":
    """Return the task of the tuner: the options, else the values of the deployment."""
    from canshaper.design.tuning.formulation import Requirements, Task, Weights

    limits = bound.config.limits
    if required["max_rate_per_s"] is None:
        required["max_rate_per_s"] = limits.slowest_per_s
    elif required["max_rate_per_s"] == float("inf"):
        required["max_rate_per_s"] = None
    if required["within_command"] is None:
        required["within_command"] = not limits.allow_faster
    if options["length_range_pct"] is not None and required["max_run_on_s"] is None:
        required["max_run_on_s"] = limits.tail_s
    q, r, s, p = weights
    return Task(
        mode=sway.mode(),
        tick_s=deployment.config.tick_ms / 1000.0 * bound.period_ticks,
        weights=Weights((q, q), r, s, p),
        require=Requirements(**required),
        **options,
    )


def _solve(
    task: "Task", method: str, starts: int, report: Callable[[float, str], None], *, beyond: bool
) -> "Tuning":
    from canshaper.design.tuning.optimal import manual

    if method == "manual":
        if beyond:
            raise UsageError(
                "the manual rule knows the damping of the sway only; limits, a third pole and"
                " a length range are for --method optimal"
            )
        return manual(task.mode)
    if method != "optimal":
        raise UsageError(f"--method: expected optimal or manual, got {method}")
    report(0.0, "loading the solver")
    from canshaper.design.tuning.optimal import tune as optimal

    return optimal(task, starts, report)


def _report(
    deployment: "Deployment",
    bound: "BoundAxis",
    task: "Task",
    tuning: "Tuning",
    out: Path,
    results: "Results",
    *,
    write: bool,
    as_json: bool,
) -> None:
    """Measure, draw, write, print."""
    from canshaper.commissioning.stopping import consequences
    from canshaper.design.tuning import deploy
    from canshaper.design.tuning.deploy import table
    from canshaper.design.tuning.evaluate import Machine

    machine = Machine.of(bound)
    setting = deploy.deployed(tuning, task.mode, task.tick_s, machine)
    before = None
    if bound.config.filter.kind == "gff":
        parameters = bound.config.filter.parameters()
        before = deploy.from_parameters(parameters, task.mode, task.tick_s, machine)
    best_tail = deploy.tail_for(setting, task.mode, task.tick_s, machine)
    tail = best_tail if best_tail and best_tail[0] > bound.config.limits.tail_s else None
    sentence = deploy.recommendation(bound.name, setting, tail)
    drawn = results.picture(
        out / f"{bound.name}.png", lambda: _figure(bound, task, setting, before, machine)
    )
    changed = _write(deployment, bound, task, setting, best_tail) if write else []
    if as_json:
        result = deploy.as_dict(tuning, setting) | {
            "axis": bound.name,
            "in_file": deploy.measures_dict(before.measures) if before else None,
            "recommendation": sentence,
            "tail_needed_s": tail[0] if tail else None,
            "picture": str(drawn) if drawn else None,
            "written": str(deployment.path) if write else None,
            "changed": changed,
        }
        echo(json.dumps(result, indent=2))
    results.print(table(setting, before, tuning.method))
    if tuning.method == "optimal":
        results.print("\n".join(deploy.optimum_lines(tuning)))
    stop = consequences(deployment, bound.name, setting.filter, tail[0] if tail else None)
    results.print(f"\n{sentence}", style="bold")
    results.print(stop)
    results.picture_line(drawn)
    if write and not as_json:
        from canshaper.commissioning.filter_file import written_line

        echo("\n".join([*changed, written_line(deployment.path)]))
    results.write()


def _figure(
    bound: "BoundAxis",
    task: "Task",
    setting: "Setting",
    before: "Setting | None",
    machine: "Machine",
) -> "Figure":
    from canshaper.design.tuning.plot import figure

    assert bound.config.sway is not None
    speed = bound.config.sway.full_speed_m_s
    return figure(
        axis=bound.name,
        setting=setting,
        mode=task.mode,
        tick_s=task.tick_s,
        machine=machine,
        full_speed_m_s=speed,
        before=before,
    )


def _write(
    deployment: "Deployment",
    bound: "BoundAxis",
    task: "Task",
    setting: "Setting",
    tail: tuple[float, float] | None,
) -> list[str]:
    from canshaper.commissioning.filter_file import write_filters
    from canshaper.config.filters import designed
    from canshaper.edit.edit import FileValue

    designed_for = designed(task.mode)
    if task.length_range_pct is not None:
        designed_for["length_range_pct"] = task.length_range_pct
    tail_s = tail[0] if tail else None
    if tail_s is not None:
        designed_for["duration_s"] = tail_s
    if task.require.max_rate_per_s is not None:
        designed_for["valve_rate_per_s"] = task.require.max_rate_per_s
    values: dict[str, FileValue] = {
        "kind": "gff",
        **setting.values(),
        "designed_for": designed_for,
    }
    gone = bound.config.filter.model_dump(exclude_none=True).keys() - values.keys()
    return write_filters(
        deployment, bound.name, [((), dict.fromkeys(sorted(gone)) | values)], tail_s, "tune"
    )
