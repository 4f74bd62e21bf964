"""``canshaper calibrate``: the curve of a valve, or the flow of the pump, measured and written."""

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import (
    CHANNEL,
    FILE,
    INTERFACE,
    NETWORK,
    PICTURE,
    REPORT,
    SET,
    loader,
    refuse_shipped,
)
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from canshaper.cli.results import Results
    from canshaper.commissioning.calibration.drive import CalibrationDrive
    from canshaper.machine.deployment import Deployment

GROUP = "setup"


def calibrate(
    file: str = FILE,
    axis: list[str] | None = typer.Option(None, "--axis", help="Axis whose valve is measured."),
    together: bool = typer.Option(
        False, "--together", help="Measure the pump: two axes, each alone and then at once."
    ),
    speed: list[str] | None = typer.Option(
        None, "--speed", metavar="MESSAGE.SIGNAL", help="Feedback of its speed in the DBC files."
    ),
    rate_pct_s: float | None = typer.Option(
        None, "--rate", min=0.5, max=20.0, help="Ramp, % per s; by default 10, for the pump 50."
    ),
    top: float | None = typer.Option(
        None,
        "--top",
        min=1.0,
        max=100.0,
        help="Largest command, %, up to max_pct; by default 40, for the pump max_pct.",
    ),
    live: bool = typer.Option(False, "--live", help="On the machine, not on the simulated crane."),
    yes: bool = typer.Option(False, "--yes", help="With --live: do not ask."),
    write: bool = typer.Option(False, "--write", help="Write the curve into the file."),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    network: bool = NETWORK,
    changes: list[str] | None = SET,
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
) -> None:
    """Measure at which command a valve opens, and what it gives; or what the pump delivers.

    Drives one axis slowly up and down, first with positive, then with negative commands, and
    compares with the feedback of its speed. By default on the simulated crane; with --live on the
    machine: stop the service first, keep everybody away, hold the enable switch all the time and
    leave the joystick in neutral. Releasing the enable, moving the joystick, Ctrl-C and every fault
    that stops the daemon end it with neutral valves.

    The simulated axis is brought to where it has room for its ramp. Beyond the top of the ramp the
    curve is a straight line, and says so.

    With --together two axes (by default the first two with a filter) go up to max_pct, each alone,
    then both at once: what they lose of their speeds shows the flow of the pump (hydraulics).

    Examples:

      canshaper calibrate config/forwarder-robust.yaml --axis slew

      canshaper calibrate config/forwarder-robust.yaml --axis slew --set slew.deadband=0.08

      canshaper calibrate config/forwarder-robust.yaml --axis slew --report slew.html

      canshaper calibrate config/forwarder-robust.yaml --together --set pump_flow=1.2

      canshaper calibrate machine.yaml --axis slew --speed TipVelocity.SlewRate --live --write
    """
    from canshaper.cli.results import Results
    from canshaper.commissioning.calibration.drive import CalibrationDrive
    from canshaper.commissioning.calibration.pump import pair_of, pump_lines
    from canshaper.commissioning.calibration.ramp import (
        RATE_PER_S,
        TOGETHER_PER_S,
        Ramp,
        speed_signal,
        usual_top,
    )
    from canshaper.commissioning.calibration.run import run_live, run_simulated
    from canshaper.commissioning.origins import origin_of
    from canshaper.report.console import progress_bar
    from canshaper_sim.parameters import changed_parameters

    deployment = loader(file, interface, channel, network=network)()
    if write:
        refuse_shipped(file)
    axes = pair_of(deployment, axis or []) if together else tuple(axis or ())
    if len(axes) != 1 + together or (together and picture):
        wrong = "--picture: expected none" if picture else "--axis: expected one, or two"
        raise UsageError(f"{wrong} with --together, got {picture or ', '.join(axes) or 'none'}")
    title = "Pump, measured" if together else f"Valve of {axes[0]}, calibrated"
    results = Results(title, deployment, report, picture)
    signals = {a: speed_signal(deployment, a, s) for a, s in zip_longest(axes, speed or [])}
    limits = [deployment.axes[one].config.limits for one in axes]
    usual = min(one.max_pct for one in limits) / 100.0 if together else usual_top(limits[0])
    rate_per_s = TOGETHER_PER_S if together else RATE_PER_S
    ramp = Ramp(rate_pct_s / 100.0 if rate_pct_s else rate_per_s, top / 100.0 if top else usual)
    also = {one: signals[one] for one in axes[1:]}
    drive = CalibrationDrive(deployment, axes[0], signals[axes[0]], ramp, also)
    if live and not yes:
        _confirm(axes, drive)
    with progress_bar(" and ".join(axes)) as on_progress:

        def show(now: "CalibrationDrive") -> None:
            waits = f" waits for {now.waiting_for}" if now.waiting_for else ""
            on_progress(now.progress, f"{' and '.join(axes)}{waits}")

        if live:
            run_live(drive, deployment, show)
        else:
            run_simulated(drive, deployment, changed_parameters(changes or [], deployment), show)
    drive.check_ended()
    bus = deployment.config.buses[deployment.axes[axes[0]].config.valve.bus]
    origin = origin_of("calibrate", live=[bus] if live else [])
    if together:
        lines = pump_lines(deployment, axes, [drive.moments], origin if write else None)
        results.conclude(lambda to: to.print("\n".join(lines), soft_wrap=True))
        return
    _conclude(results, deployment, drive, origin if write else None)


def _conclude(
    results: "Results",
    deployment: "Deployment",
    drive: "CalibrationDrive",
    origin: dict[str, Any] | None,
) -> None:
    """Show the curve of one valve; with an ``origin`` write both into the deployment file."""
    from canshaper.commissioning.calibration.fit import curve_lines, write_curve
    from canshaper.commissioning.origins import written_line

    axis, result, top_pct = drive.axis, drive.result(), 100.0 * drive.ramp.top
    lines = curve_lines(deployment, axis, result, top_pct)

    def figure() -> "Figure":
        from canshaper.commissioning.plots import of_valve

        limits = deployment.axes[axis].config.limits.output_limits()
        return of_valve(axis, limits, result, top_pct)

    def finish() -> list[str]:
        if origin is None:
            return []
        write_curve(deployment, axis, result, origin)
        return [written_line(deployment.path)]

    results.conclude(
        lambda to: to.print("\n".join(lines), soft_wrap=True), figure=figure, finish=finish
    )


def _confirm(axes: Sequence[str], drive: "CalibrationDrive") -> None:
    """Ask whether the axes may move by themselves; raise Abort, which ends the verb, if not."""
    who = f"Axes {' and '.join(axes)}, alone, then at once," if len(axes) > 1 else f"Axis {axes[0]}"
    ramp = drive.ramp
    typer.confirm(
        f"{who} will move by itself for {drive.duration_s:.0f} s, up to"
        f" {100.0 * ramp.top:.0f} % of its command: in positive direction, at most as far as in"
        f" {ramp.travel_s:.1f} s at full deflection, and as far back. Has it that room, is"
        " everybody away, and the enable switch held?",
        abort=True,
    )
