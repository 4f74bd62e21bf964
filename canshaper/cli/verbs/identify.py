"""``canshaper identify``: period, damping and full speed of the swing, from what a person has."""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import echo, loader, os_errors, picture, picture_line, refuse_shipped
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from canshaper.commissioning.identification.recommend import Advice
    from canshaper.commissioning.identification.verdict import Finding
    from canshaper.machine.deployment import Deployment

EXIT_TOO_POOR = 1


def identify(
    logs: list[str] | None = typer.Argument(
        None,
        metavar="[LABEL=]LOG...",
        help="CAN logs (candump .log, .asc, .blf, .mf4) or tables (.csv) of a phone or logger.",
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
        None, "--about", min=0.3, max=12.0, help="Period as far as it is known, s."
    ),
    swings: float | None = typer.Option(None, "--swings", help="Stopwatch: full swings counted."),
    seconds: float | None = typer.Option(None, "--seconds", help="Stopwatch: time they took."),
    first_deg: float | None = typer.Option(
        None, "--first", help="Stopwatch: amplitude at the start, degrees to one side."
    ),
    last_deg: float | None = typer.Option(None, "--last", help="Stopwatch: amplitude at the end."),
    out: Path = typer.Option(Path("out/identify"), "--out", help="Directory for the picture."),
    write: bool = typer.Option(False, "--write", help="Write the sway data into the deployment."),
    as_json: bool = typer.Option(False, "--json", help="Print everything as JSON."),
) -> None:
    """Find period and damping of the swing, and the full speed of the tip, from logs.

    Finds free swings by itself: by the commands in the log where the deployment names them, else by
    the shape of the signal. Intervals are of 95 %. Draws OUT/identify.png. Exit code 1 where the
    data of an axis is too poor, with what to do; 2 where a file or an option is wrong.

    LABEL= tells what hangs on the crane: logs of one label count together, several labels are
    compared. A label that is a number is the value of the grapple's signal.

    Examples:

      canshaper identify drive.log --file machine.yaml --write

      canshaper identify drive.blf --file machine.yaml --dbc imu.dbc --signal slew=IMU.RollRate

      canshaper identify Gyroscope.csv --file machine.yaml --axis slew

      canshaper identify empty=a.log empty=b.log loaded=c.log --file machine.yaml

      canshaper identify logger.csv --signal "near_far=Lift pressure (bar)" --about 2.4

      canshaper identify --swings 10 --seconds 23.6 --first 20 --last 5 --file machine.yaml \\
        --axis slew --write
    """
    # Its matrices are small: threads of the linear algebra would only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from canshaper.cli.identify_data import (
        axis_named,
        logged,
        messages_of,
        signals_named,
        timed_by_hand,
    )
    from canshaper.commissioning.identification.recommend import advise

    deployment = loader(file)() if file else None
    if write and (deployment is None or file is None):
        raise UsageError("--write: expected --file too, the deployment to write to, got none")
    if write and file:
        refuse_shipped(file)
    with os_errors(out):
        timed = {"--swings": swings, "--seconds": seconds, "--first": first_deg, "--last": last_deg}
        if any(v is not None for v in timed.values()):
            findings = [timed_by_hand(timed, logs or [], axis_named(axis, deployment))]
        else:
            findings = logged(
                logs or [],
                signals_named(signal or [], deployment),
                deployment,
                messages_of(dbc or [], deployment),
                axis=axis,
                channel=channel,
                about_s=about_s,
            )
        names = list(dict.fromkeys(f.axis for f in findings))
        advice = [
            advise(
                name,
                [f for f in findings if f.axis == name],
                _speed(deployment, name),
                has_grapple=bool(deployment and deployment.load_state),
            )
            for name in names
        ]
        drawn = _draw(findings, advice, out)
        written = _write(deployment, findings, advice) if write and deployment else []
    _print_result(findings, advice, deployment, drawn, written, as_json=as_json)
    if not all(f.usable for f in findings):
        raise typer.Exit(EXIT_TOO_POOR)


def _speed(deployment: "Deployment | None", axis: str) -> float | None:
    """Full speed that the deployment has."""
    sway = deployment.axes[axis].config.sway if deployment else None
    return sway.full_speed_m_s if sway else None


def _draw(
    findings: Sequence["Finding"], advice: Sequence["Advice"], out: Path
) -> tuple[Path | None, str]:
    """Draw the picture, and a line that names it; empty where there is nothing to draw."""
    seen = [f for f in findings if f.free or f.driven]
    if not seen:
        return None, ""

    def draw(path: Path) -> None:
        from canshaper.commissioning.identification.plot import draw as draw_swings

        draw_swings(path, seen, [a.text for a in advice])

    path = picture(out / "identify.png", draw)
    return path, picture_line(path)


def _write(
    deployment: "Deployment", findings: Sequence["Finding"], advice: Sequence["Advice"]
) -> list[str]:
    """Write what is known of each axis; the axes that were written."""
    from canshaper.commissioning.identification.recommend import flow
    from canshaper.config.edit import Value, set_values
    from canshaper.config.sway import Sway
    from canshaper.machine.stopping import stop_fault

    usable = [a for a in advice if all(f.usable for f in findings if f.axis == a.axis)]
    for one in usable:
        config = deployment.axes[one.axis].config
        if config.sway is None:
            raise UsageError(
                f"axis {one.axis}: expected a section sway to write to, got none; put in sway:"
                f" {flow(one.sway)}"
            )
        faster = config.model_copy(update={"sway": Sway.model_validate(one.sway)})
        if fault := stop_fault(deployment, one.axis, faster):
            raise UsageError(
                f"axis {one.axis}: with sway: {flow(one.sway)}, limits.stop_distance_m: {fault};"
                " change the limits first"
            )
    for one in usable:
        sway = deployment.axes[one.axis].config.sway
        assert sway is not None
        gone = sway.model_dump(exclude_none=True).keys() - one.sway.keys()
        values: dict[str, Value] = {**dict.fromkeys(sorted(gone)), **one.sway}
        set_values(deployment.path, ("axes", one.axis, "sway"), values)
    return [one.axis for one in usable]


def _print_result(
    findings: Sequence["Finding"],
    advice: Sequence["Advice"],
    deployment: "Deployment | None",
    drawn: tuple[Path | None, str],
    written: Sequence[str],
    *,
    as_json: bool,
) -> None:
    from canshaper.commissioning.identification.report import as_dict, lines, set_lines
    from canshaper.report.console import SafeConsole
    from canshaper.shaping.registry import KINDS

    path, line = drawn
    if as_json:
        result = as_dict(findings, advice)
        result |= {"picture": str(path) if path else None, "written": list(written)}
        echo(json.dumps(result, indent=2))
        return
    for finding in findings:
        echo("\n".join(lines(finding)))
    console = SafeConsole(soft_wrap=True)
    for one in advice:
        console.print(f"\n{one.text}", style="bold")
        if one.gain_schedule:
            echo("\n".join(set_lines(one)))
    if line:
        echo(line)
    if not deployment:
        return
    if written:
        echo(f"Written to {deployment.path}; a running daemon takes it with SIGHUP.")
    for one in advice:
        axis = deployment.axes[one.axis].config
        if one.axis in written and axis.gain_schedule:
            echo(f"{one.axis} has a gain schedule, which stays as it is: change it by hand.")
        if one.sway and (command := KINDS[axis.filter.kind].designed_by):
            if one.cover_pct:
                command = "robust"
            command += f" {deployment.path} --axis {one.axis}"
            command += f" --range {one.cover_pct}" if one.cover_pct else ""
            echo(f"Then fit the filter: canshaper {command}")
