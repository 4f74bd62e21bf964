"""``canshaper identify``: period, damping and full speed of the swing, from what a person has."""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import (
    EXIT_NOT_ENOUGH_DATA,
    PICTURE,
    PROCESSES,
    REPORT,
    SCHEDULER,
    engine,
    loader,
    os_errors,
    refuse_shipped,
)
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from canshaper.cli.results import Results
    from canshaper.commissioning.identification.report import Advice
    from canshaper.commissioning.identification.verdict import SwingFinding
    from canshaper.machine.deployment import Deployment

GROUP = "measure"

TITLES = ("Swing, identified", "Pump, measured")


def identify(
    logs: list[str] | None = typer.Argument(
        None,
        metavar="[LABEL=]LOG...",
        help="CAN logs, as replay reads them, or tables (.csv) of a phone or logger.",
    ),
    file: str | None = typer.Option(
        None, "--file", help="Deployment: its DBC files, axes, commands and grapple signal."
    ),
    signal: list[str] | None = typer.Option(
        None, "--signal", metavar="AXIS=NAME", help="MESSAGE.SIGNAL of the DBC, or CSV column."
    ),
    axis: str | None = typer.Option(None, "--axis", help="Axis of a phone or a stopwatch."),
    dbc: list[Path] | None = typer.Option(
        None, "--dbc", help="DBC file of the signals, instead of those of the deployment."
    ),
    channel: str | None = typer.Option(
        None, "--channel", help="Bus of the log, where it has more."
    ),
    about_s: float | None = typer.Option(
        None, "--about", min=0.3, max=25.0, help="Period as far as it is known, s."
    ),
    swings: float | None = typer.Option(None, "--swings", help="Stopwatch: full swings counted."),
    seconds: float | None = typer.Option(None, "--seconds", help="Stopwatch: time they took."),
    first_deg: float | None = typer.Option(
        None, "--first", help="Stopwatch: amplitude at the start, degrees to one side."
    ),
    last_deg: float | None = typer.Option(None, "--last", help="Stopwatch: amplitude at the end."),
    together: bool = typer.Option(
        False, "--together", help="Measure the pump; each --signal is the speed of an axis."
    ),
    out: Path = typer.Option(Path("out/identify"), "--out", help="Directory for the picture."),
    write: bool = typer.Option(False, "--write", help="Write the sway data into the deployment."),
    as_json: bool = typer.Option(False, "--json", help="Print everything as JSON."),
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
    processes: int | None = PROCESSES,
    scheduler: str | None = SCHEDULER,
) -> None:
    """Find period and damping of the swing, and the full speed of the tip, from logs.

    Finds free swings by itself: by the commands in the log where the deployment names them, else by
    the shape of the signal. Intervals are of 95 %. Draws OUT/identify.png. Exit code 1 where the
    data of an axis is not enough, with what to do; 2 where a file or an option is wrong.

    LABEL= says what hangs on the crane: logs of one label count together, several labels are
    compared. A label that is a number is the value of the grapple's signal. Of a folder every log
    in it and below is identified by itself, a folder in it is a machine, and one table says it of
    all and where a period has drifted; exit code 1 where a log cannot be read.

    With --together the logs show two axes alone and at once, without anti-sway, each held for two
    seconds at full deflection: the flow of the pump, as of canshaper calibrate --together.

    Examples:

      canshaper identify drive.log --file machine.yaml --write

      canshaper identify drive.blf --file machine.yaml --dbc imu.dbc --signal slew=IMU.RollRate

      canshaper identify Gyroscope.csv --file machine.yaml --axis slew

      canshaper identify empty=a.log empty=b.log loaded=c.log --file machine.yaml

      canshaper identify logs/ --file machine.yaml

      canshaper identify logger.csv --signal "near_far=Lift pressure (bar)" --about 2.4

      canshaper identify --swings 10 --seconds 23.6 --first 20 --last 5 --file machine.yaml
        --axis slew --write
    """
    # Its matrices are small: threads of the linear algebra would only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from canshaper.cli.log_folders import check_only_folders, identified, run_fleet, show_periods
    from canshaper.cli.results import Results
    from canshaper.commissioning.identification.canlog import messages_of
    from canshaper.commissioning.identification.data import (
        axis_named,
        logged,
        measured_in,
        signals_named,
        timed_by_hand,
    )
    from canshaper.commissioning.identification.report import advice_on
    from canshaper.report.console import progress_bar

    deployment = loader(file)() if file else None
    if write and (deployment is None or file is None):
        raise UsageError("--write: expected --file too, the deployment to write to, got none")
    if write and file:
        refuse_shipped(file)
    results = Results(TITLES[together], deployment, report, picture, quiet=as_json, soft_wrap=True)
    options: dict[str, Any] = {"axis": axis, "channel": channel, "about_s": about_s}
    timed = {"--swings": swings, "--seconds": seconds, "--first": first_deg, "--last": last_deg}
    by_hand = {name: value for name, value in timed.items() if value is not None}
    if logs and Path(logs[0]).is_dir():
        folders = [*map(Path, logs)]
        of_one = {"--write": write, "--json": as_json, "--picture": picture, "--together": together}
        check_only_folders(folders, of_one | dict.fromkeys(by_hand, True))
        work = partial(identified, file, signal or [], dbc or [], options)
        run_fleet(engine(processes, scheduler), work, folders, show_periods, out, results)
        return
    if together:
        if deployment is None or as_json or picture:
            raise UsageError("--together: expected --file, and neither --json nor --picture")
        pump = _pump(deployment, logs or [], signal or [], channel, write)
        results.conclude(lambda to: to.print("\n".join(pump)))
        return
    with os_errors(out):
        if by_hand:
            findings = [timed_by_hand(timed, logs or [], axis_named(axis, deployment))]
        else:
            named = signals_named(signal or [], deployment), deployment
            with progress_bar("") as on_progress:
                messages = messages_of(dbc or [], deployment)
                findings = logged(logs or [], *named, messages, **options, on_progress=on_progress)
        advice = advice_on(findings, deployment)
        origin = measured_in(logs or [], messages_of(dbc or [], deployment)) if write else None
    _conclude(results, findings, advice, deployment, origin, out / "identify.png", as_json)


def _conclude(
    results: "Results",
    findings: list["SwingFinding"],
    advice: list["Advice"],
    deployment: "Deployment | None",
    origin: dict[str, Any] | None,
    path: Path,
    as_json: bool,
) -> None:
    """Show what the logs showed; with an ``origin`` write both into the deployment file."""
    from canshaper.commissioning.identification.report import as_dict, headlines, write_sway

    seen = [one for one in findings if one.free or one.driven]
    written: list[str] = []

    def figure() -> "Figure":
        from canshaper.commissioning.identification.plot import figure as of_swings

        return of_swings(seen, headlines(findings, advice))

    def finish() -> list[str]:
        if origin and deployment:
            written.extend(write_sway(deployment, findings, advice, origin))
        return _next_steps(advice, deployment, written) if deployment else []

    def data(picture: Path | None) -> dict[str, Any]:
        return as_dict(findings, advice) | {"picture": picture, "written": written}

    results.conclude(
        partial(_print, findings, advice),
        figure=figure if seen else None,
        path=path,
        data=data if as_json else None,
        finish=finish,
        code=0 if all(one.usable for one in findings) else EXIT_NOT_ENOUGH_DATA,
    )


def _pump(
    deployment: "Deployment",
    logs: list[str],
    signals: list[str],
    channel: str | None,
    write: bool,
) -> list[str]:
    """Return the flow of the pump as lines, from logs of two axes; with ``write`` also write it."""
    from canshaper.commissioning.calibration.pump import drives_in, pair_of, pump_lines
    from canshaper.commissioning.identification.data import measured_in, paths_of, signals_named

    speeds = signals_named(signals, deployment)
    axes = pair_of(deployment, [*speeds])
    drives = drives_in(deployment, paths_of(logs), axes, speeds, channel)
    origin = measured_in(logs, deployment.messages)
    return pump_lines(deployment, axes, drives, origin if write else None)


def _print(
    findings: Sequence["SwingFinding"], advice: Sequence["Advice"], results: "Results"
) -> None:
    from canshaper.commissioning.identification.report import lines, set_lines

    for finding in findings:
        results.print("\n".join(lines(finding)))
    for one in advice:
        results.print(f"\n{one.text}", style="bold")
        if one.gain_schedule:
            results.print("\n".join(set_lines(one)))


def _next_steps(
    advice: Sequence["Advice"], deployment: "Deployment", written: Sequence[str]
) -> list[str]:
    """Return lines that say what was written, and which command designs each filter again."""
    from canshaper.commissioning.origins import written_line
    from canshaper.shaping.registry import KINDS

    lines = [written_line(deployment.path)] if written else []
    for one in advice:
        axis = deployment.axes[one.axis].config
        if one.axis in written and axis.gain_schedule:
            lines.append(
                f"{one.axis} has a gain schedule, which stays as it is: change it by hand."
            )
        if one.sway and (keeps := KINDS[axis.filter.kind].designed_by):
            of_axis = f"{deployment.path} --axis {one.axis}"
            covers = f" --range {one.cover_pct}" if one.cover_pct else ""
            lines.append(f"Then fit the filter: canshaper robust {of_axis}{covers}")
            if keeps != "robust":
                replaced = f"that replaces the filter {axis.filter.kind}"
                lines.append(f"  {replaced}, which canshaper {keeps} {of_axis} keeps")
    return lines
