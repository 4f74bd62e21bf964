"""``canshaper tune``: design the G_FF filter of an axis."""

from functools import partial
from pathlib import Path
from typing import Any

import typer

from canshaper.cli.common import EXIT_USELESS, FILE, PICTURE, REPORT, loader, refuse_shipped
from canshaper.errors import UsageError

GROUP = "design"


def tune(
    file: str = FILE,
    axis: str | None = typer.Option(None, "--axis", help="Axis to tune."),
    fleet: bool = typer.Option(
        False, "--fleet", help="Tune every swinging axis, for the drives of a campaign."
    ),
    method: str = typer.Option(
        "optimal", "--method", help="optimal, or manual: the rule of the paper."
    ),
    preference: float | None = typer.Option(
        None, "--preference", help="Instead of weights: 0 quickest to 1 calmest; prints a table."
    ),
    q: str | None = typer.Option(
        None, "--q", help="Weight Q of swing angle and rate: Q, Q11,Q22, or rows of the matrix."
    ),
    r: float | None = typer.Option(None, "--r", help="Weight R of the rise to 95 %."),
    s: float | None = typer.Option(None, "--s", help="Weight S of the distance from the joystick."),
    p: float | None = typer.Option(None, "--p", help="Weight P of changes of the output."),
    states: str | None = typer.Option(
        None, "--states", help="What Q weighs: sway (default), deviation, companion, none."
    ),
    horizon_s: float | None = typer.Option(
        None, "--horizon", help="Seconds of the step response that count (3)."
    ),
    pole_distance: str | None = typer.Option(
        None, "--pole-distance", help="Eq. 14e: text (at least 5 times), printed (at most), off."
    ),
    within_command: bool | None = typer.Option(
        None,
        "--within-command/--beyond-command",
        help="Whether the output may exceed the command. Default: allow_faster of the axis.",
    ),
    max_jump: float | None = typer.Option(
        None, "--max-jump", help="Largest part of a step that the output may jump at once."
    ),
    max_rate: float | None = typer.Option(
        None,
        "--max-rate",
        help="Rate of the valve, full speeds/s, inf: no limit. Default: the axis' rise and fall.",
    ),
    third_pole: bool | None = typer.Option(
        None, "--third-pole/--two-poles", help="Use a third pole: the output never jumps."
    ),
    max_run_on_s: float | None = typer.Option(
        None, "--max-run-on", help="Longest time until a step has settled to 5 %, s."
    ),
    length_range_pct: float | None = typer.Option(
        None,
        "--length-range",
        help="Instead of Eq. 15: least worst swing for lengths of -X to +X %, within tail_s.",
    ),
    starts: int = typer.Option(3, "--starts", help="Number of starts of the solver."),
    out: Path = typer.Option(Path("out/tune"), "--out", help="Directory for the picture."),
    write: bool = typer.Option(False, "--write", help="Write filter and tail into the file."),
    force: bool = typer.Option(
        False, "--force", help="Write the filter even if it leaves more than half of the swing."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print everything as JSON."),
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
) -> None:
    """Find the best poles of an axis' G_FF, show what they do, write them on request.

    It prints the new filter next to that of the file, the swing left when the pendulum is up to
    30 % longer or shorter, the constraints that bound the optimum, and a verdict. It draws
    OUT/AXIS.png. An option that is not given has the value with which the file's filter was tuned.
    Exit code 1 when more than half of the swing is left; 2 when no filter meets all constraints:
    the error names those that conflict.

    With --fleet it tunes all swinging axes together, as canshaper robust --fleet designs them,
    within the run-on of --max-run-on (2.25 s), and compares them with robust shapers of that
    length.

    Examples:

      canshaper tune config/forwarder.yaml --axis slew

      canshaper tune config/forwarder.yaml --axis slew --preference 0.3

      canshaper tune machine.yaml --axis near_far --third-pole --write

      canshaper tune config/forwarder.yaml --axis slew --length-range 15 --max-run-on 1.9

      canshaper tune config/forwarder.yaml --axis near_far --q 1 --r 2 --s 0 --p 0.03

      canshaper tune config/forwarder.yaml --axis slew --method manual

      canshaper tune config/forwarder-gff.yaml --fleet --max-run-on 2.3
    """
    from canshaper.cli.results import Results
    from canshaper.cli.verbs.robust import for_fleet
    from canshaper.commissioning.origins import refuse_scheduled, written_line
    from canshaper.commissioning.tuned import (
        as_dict,
        design_tuned,
        figure,
        print_tuned,
        write_tuned,
    )
    from canshaper.report.console import progress_bar

    deployment = loader(file)()
    if write:
        refuse_shipped(file)
    given: dict[str, Any] = {"preference": preference, "q": _numbers(q), "r": r, "s": s, "p": p}
    given |= {"states": states, "horizon_s": horizon_s, "pole_distance": pole_distance}
    given |= {"within_command": within_command, "max_jump": max_jump, "max_rate_per_s": max_rate}
    given |= {"third_pole": third_pole, "max_run_on_s": max_run_on_s}
    given |= {"length_range_pct": length_range_pct}
    given = {name: value for name, value in given.items() if value is not None}
    if fleet:
        if axis or as_json or method != "optimal" or given.keys() - {"max_run_on_s"}:
            raise UsageError("--fleet: expected only --max-run-on, --write, --picture, --report")
        for_fleet(deployment, "gff", max_run_on_s, write, report, picture)
        return
    if axis is None:
        raise UsageError("expected --axis AXIS, or --fleet, got neither")
    results = Results(f"Filter for {axis}", deployment, report, picture, quiet=as_json)
    if write:
        refuse_scheduled(deployment, axis, "robust --loads --write designs one for each")
    try:
        with progress_bar(axis) as on_progress:

            def show(done: float, what: str) -> None:
                on_progress(done, f"{axis}: {what}")

            one = design_tuned(deployment, axis, given, method=method, starts=starts, report=show)
    except ValueError as error:
        raise UsageError(f"axis {axis}: {error}") from None
    useless = one.verdict.useless and not force
    written, changed = deployment.path if write and not useless else None, list[str]()

    def finish() -> list[str]:
        if not written:
            return []
        changed.extend(write_tuned(deployment, one))
        return [*changed, written_line(written)]

    def data(path: Path | None) -> dict[str, Any]:
        return as_dict(one) | {"picture": path, "written": written, "changed": changed}

    results.conclude(
        partial(print_tuned, deployment, one),
        figure=lambda: figure(one),
        path=out / f"{axis}.png",
        data=data if as_json else None,
        finish=finish,
        code=EXIT_USELESS if useless else 0,
    )


def _numbers(text: str | None) -> list[float] | None:
    """Return the numbers of --q, None without it; UsageError where a word is no number."""
    try:
        return None if text is None else [float(word) for word in text.split(",")]
    except ValueError:
        form = "Q, Q11,Q22 or Q11,Q12,Q21,Q22"
        raise UsageError(f"--q: expected {form}, got {text!r}") from None
