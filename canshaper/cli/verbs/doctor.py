"""``canshaper doctor``: is this PC fit to run a deployment?"""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import CHANNEL, FILE, INTERFACE, PICTURE, REPORT, loader
from canshaper.errors import UsageError, WrongDeviceError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from canshaper.commissioning.doctor.verdict import Finding
    from canshaper.machine.deployment import Deployment

GROUP = "setup"

EXIT_NOT_FIT = 1
REFRESH_HZ = 1  # of the bar, which is load too


def doctor(
    file: str = FILE,
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    seconds: float = typer.Option(
        20.0, "--seconds", min=0.5, max=86_400.0, help="Length of each run."
    ),
    load: bool = typer.Option(True, "--load/--no-load", help="A second run on a busy PC."),
    listen_s: float | None = typer.Option(
        None,
        "--listen",
        metavar="SECONDS",
        min=0.5,
        help="Listen to the joysticks on the real bus.",
    ),
    as_json: bool = typer.Option(False, "--json", help="Print everything as JSON."),
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
) -> None:
    """Is this PC fit to run a deployment? Nothing is sent on its buses, nothing moves.

    Runs the daemon's loop with moving joysticks on sockets of its own, once on the PC as it is and
    once with every processor, memory and disk kept busy; shows how late the ticks come and how
    long a joystick takes to the valve; looks at kernel, processor and CAN interfaces, and says
    what to do about what it finds. Run it as root to measure with the service's real-time
    priority.

    Exit code 0 when the PC is fit, 1 when it is not, 2 when the deployment is wrong or nothing
    could be measured, 130 after Ctrl-C.

    Examples:

      canshaper doctor config/forwarder-robust.yaml

      sudo canshaper doctor config/forwarder-robust.yaml --seconds 600 --json > doctor.json

      canshaper doctor config/forwarder-robust.yaml --no-load --listen 10
    """
    from canshaper.cli.results import Results
    from canshaper.commissioning.doctor.interfaces import bus_findings
    from canshaper.commissioning.doctor.machine import machine_findings
    from canshaper.commissioning.doctor.measure import measure
    from canshaper.commissioning.doctor.report import as_dict, print_report
    from canshaper.commissioning.doctor.verdict import IDLE, LOADED, fit, measured_findings
    from canshaper.report.console import progress_bar

    try:
        deployment = loader(file, interface, channel)()
        title = "Is this PC fit for the machine?"
        results = Results(title, deployment, report, picture, quiet=as_json)
        findings = machine_findings(deployment.config.tick_ms)
        findings += bus_findings(deployment.config.buses, deployment.config.tick_ms)
        if listen_s is not None:
            findings += _listened(deployment, listen_s)
        runs = {}
        for name in (IDLE, LOADED) if load else (IDLE,):
            with progress_bar(f"{name}, {seconds:g} s", seconds, refresh_hz=REFRESH_HZ) as passed:
                runs[name] = measure(deployment, seconds, passed, load=name == LOADED)
    except OSError as error:
        if error.filename is not None:
            raise
        raise UsageError(str(error)) from None
    findings = measured_findings(deployment, runs) + findings
    result = deployment, seconds, runs, findings

    def figure() -> "Figure":
        from canshaper.commissioning.plots import of_runs

        return of_runs(runs, deployment.config.tick_ms)

    results.conclude(
        partial(print_report, *result),
        figure=figure,
        data=(lambda _path: as_dict(*result)) if as_json else None,
        code=0 if fit(findings) else EXIT_NOT_FIT,
    )


def _listened(deployment: "Deployment", seconds: float) -> "list[Finding]":
    from canshaper.commissioning.doctor.joysticks import arrival_findings, listen
    from canshaper.commissioning.doctor.verdict import Finding, Level
    from canshaper.report.console import progress_bar

    try:
        with progress_bar(f"listening, {seconds:g} s", seconds, refresh_hz=REFRESH_HZ) as passed:
            listened = listen(deployment, seconds, passed)
    except (OSError, WrongDeviceError) as error:
        remedy = "fix the interface first"
        why = error.strerror if isinstance(error, OSError) else error
        return [Finding("joysticks", Level.BAD, f"cannot listen: {why}", remedy)]
    return arrival_findings(deployment, listened)
