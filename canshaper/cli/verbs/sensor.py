"""``canshaper sensor``: sign, delay, offset and noise of a sway sensor, measured and written."""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import (
    CHANNEL,
    EXIT_NOT_ENOUGH_DATA,
    FILE,
    INTERFACE,
    NETWORK,
    PICTURE,
    REPORT,
    SET,
    Stop,
    loader,
    os_errors,
    refuse_shipped,
)
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from canshaper.cli.results import Results
    from canshaper.commissioning.sensor.verdict import SensorFinding
    from canshaper.machine.deployment import Deployment

GROUP = "measure"


def sensor(
    file: str = FILE,
    log: Path | None = typer.Argument(
        None, help="CAN log of a drive, as replay reads it; else the simulated one."
    ),
    axis: str | None = typer.Option(None, "--axis", help="This one only."),
    live: bool = typer.Option(False, "--live", help="Listen to the machine while you drive it."),
    seconds: float | None = typer.Option(
        None, "--seconds", min=1.0, help="With --live: how long; by default until Ctrl-C."
    ),
    out: Path = typer.Option(Path("out/sensor"), "--out", help="Directory for picture and log."),
    write: bool = typer.Option(False, "--write", help="Write what was found into the file."),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    network: bool = NETWORK,
    changes: list[str] | None = SET,
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
) -> None:
    """Find sign, delay, offset and noise of the sway sensors, against the model of their axes.

    From a log, or with --live from the buses, where nothing is sent: drive each axis by hand, one
    after the other, at some 40 % for about a second, forth and back, four times, with a pause of
    two swings after each. By default on the simulated crane. Intervals are of 95 %. Draws
    OUT/sensor.png. Exit code 1 where the data of a sensor is not enough, with what to do; 2 where a
    file or an option is wrong; 3 where a bus cannot be opened.

    Examples:

      canshaper sensor config/forwarder-sensor.yaml

      canshaper sensor config/forwarder-sensor.yaml --axis near_far --set sway_sensor.delay_s=0.1

      canshaper sensor machine.yaml drive.log --write

      canshaper sensor machine.yaml --live --write
    """
    # Its matrices are small: threads of the linear algebra would only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from canshaper.cli.results import Results
    from canshaper.commissioning.origins import written_line
    from canshaper.commissioning.sensor.fit import read_sensors
    from canshaper.commissioning.sensor.verdict import examine, write_sensors

    if live and log:
        raise UsageError(f"expected a log or --live, got {log} and --live")
    if seconds is not None and not live:
        raise UsageError("--seconds: expected --live too, got none")
    if changes and (live or log):
        raise UsageError(f"--set: expected the simulated crane, got {log or '--live'}")
    deployment = loader(file, interface, channel, network=network)()
    axes = _axes(deployment, axis)
    if write:
        refuse_shipped(file)
        if not (live or log):  # a sign of the simulation is not that of the machine
            raise UsageError("--write: expected a log or --live, got the simulated crane")
    results = Results("Sway sensors", deployment, report, picture, soft_wrap=True)
    with os_errors(out):
        given = log
        if log is None:
            out.mkdir(parents=True, exist_ok=True)
            log = out / "sensor.log"
            if live:
                _listen(deployment, log, seconds)
            else:
                _simulate(deployment, axes, log, changes or [])
        series = read_sensors(log, deployment, axes)
        findings = [examine(deployment.axes[name], series[name]) for name in axes]

    def figure() -> "Figure":
        from canshaper.commissioning.plots import of_sensors

        return of_sensors(findings)

    def finish() -> list[str]:
        written = write_sensors(deployment, findings, given, live=live)
        return [*written, written_line(deployment.path)] if written else []

    results.conclude(
        partial(_print, deployment, findings),
        figure=figure if any(one.fit for one in findings) else None,
        path=out / "sensor.png",
        finish=finish if write else list,
        code=0 if all(one.usable for one in findings) else EXIT_NOT_ENOUGH_DATA,
    )


def _axes(deployment: "Deployment", axis: str | None) -> list[str]:
    """Return ``axis``, or all axes with a sway sensor; UsageError if there is no sensor."""
    having = [name for name, one in deployment.axes.items() if one.sway_sensor]
    if not having:
        text = "expected an axis with a sway_sensor, got none; see docs/sensor.md"
        raise UsageError(f"{deployment.path}: {text}")
    if axis is not None and axis not in having:
        names = ", ".join(having)
        raise UsageError(
            f"--axis: expected one with a sway sensor, got {axis!r}; there are {names}"
        )
    return [axis] if axis else having


def _listen(deployment: "Deployment", log: Path, seconds: float | None) -> None:
    """Record the buses into the log until the seconds are over, or until SIGTERM or Ctrl-C."""
    from rich.live import Live

    from canshaper.recording.record import Recording
    from canshaper.report.console import SafeConsole

    recording, stop = Recording(deployment), Stop()
    with Live(console=SafeConsole(stderr=True), refresh_per_second=4) as shown:

        def report(so_far: Recording) -> bool:
            shown.update(f"listening, drive now: {so_far} (Ctrl-C ends it)")
            return not stop.requested

        recording.run(log, seconds, report)


def _simulate(deployment: "Deployment", axes: Sequence[str], log: Path, changes: list[str]) -> None:
    """Let a hand drive these axes of the simulated crane, and write the log."""
    from canshaper.commissioning.procedure.bench import log_simulated
    from canshaper.commissioning.sensor.fit import hand_driven
    from canshaper.report.console import progress_bar
    from canshaper_sim.parameters import changed_parameters

    parameters = changed_parameters(changes, deployment)
    with progress_bar("driving") as on_progress:
        log_simulated(log, deployment, parameters, hand_driven(axes), on_progress)


def _print(
    deployment: "Deployment", findings: Sequence["SensorFinding"], results: "Results"
) -> None:
    from canshaper.commissioning.sensor.verdict import heading, table

    for finding in findings:
        results.print(heading(finding))
        if finding.fit:
            results.print(table(deployment.axes[finding.axis], finding))
        for line in finding.remarks():
            results.print(line)
