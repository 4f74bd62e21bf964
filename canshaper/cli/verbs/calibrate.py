"""``canshaper calibrate``: dead band, gain and asymmetry of a valve, measured and written."""

from pathlib import Path
from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from canshaper.commissioning.calibration.drive import CalibrationDrive

GROUP = "setup"


def calibrate(
    file: str = FILE,
    axis: str = typer.Option(..., "--axis", help="Axis whose valve is measured."),
    speed: str | None = typer.Option(
        None, "--speed", metavar="MESSAGE.SIGNAL", help="Feedback of its speed in the DBC files."
    ),
    rate_pct_s: float = typer.Option(10.0, "--rate", min=0.5, max=20.0, help="Ramp, % per s."),
    top: float | None = typer.Option(
        None,
        "--top",
        min=1.0,
        max=100.0,
        help="Largest command, %, up to the axis' max_pct; by default 40, or max_pct.",
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
    """Measure at which command a valve opens, and what it gives, in each direction.

    Drives one axis slowly up and down, first with positive, then with negative commands, and
    compares with the feedback of its speed. By default on the simulated crane; with --live on the
    machine: stop the service first, keep everybody away, hold the enable switch all the time and
    leave the joystick in neutral. Releasing the enable, moving the joystick, Ctrl-C and every fault
    that stops the daemon end it with neutral valves.

    The simulated axis is brought to where it has room for its ramp. Beyond the top of the ramp the
    curve is a straight line, and says so.

    Examples:

      canshaper calibrate config/forwarder-robust.yaml --axis slew

      canshaper calibrate config/forwarder-robust.yaml --axis slew --set slew.deadband=0.08

      canshaper calibrate config/forwarder-robust.yaml --axis slew --report slew.html

      canshaper calibrate machine.yaml --axis slew --speed TipVelocity.SlewRate --live --write
    """
    from canshaper.cli.results import Results
    from canshaper.commissioning.calibration.drive import CalibrationDrive
    from canshaper.commissioning.calibration.ramp import Ramp, usual_top
    from canshaper.commissioning.calibration.run import run_live
    from canshaper.commissioning.calibration.write import curve_lines, speed_signal, write_curve
    from canshaper.report.console import progress_bar

    deployment = loader(file, interface, channel, network=network)()
    if write:
        refuse_shipped(file)
    results = Results(f"Valve of {axis}, calibrated", deployment, report, picture)
    of_speed = speed_signal(deployment, axis, speed)
    usual = usual_top(deployment.axes[axis].config.limits)
    ramp = Ramp(rate_pct_s / 100.0, usual if top is None else top / 100.0)
    top_pct = 100.0 * ramp.top
    drive = CalibrationDrive(deployment, axis, of_speed, ramp)
    if live and not yes:
        typer.confirm(
            f"Axis {axis} will move by itself for {ramp.duration_s:.0f} s, up to"
            f" {top_pct:.0f} % of its command: in positive direction, at most as far as in"
            f" {ramp.travel_s:.1f} s at full deflection, and as far back. Has it that room, is"
            " everybody away, and the enable switch held?",
            abort=True,
        )
    with progress_bar(axis) as on_progress:

        def show(now: "CalibrationDrive") -> None:
            waits = f" waits for {now.waiting_for}" if now.waiting_for else ""
            on_progress(now.progress, f"{axis}{waits}")

        if live:
            run_live(drive, deployment, show)
        else:
            from canshaper.commissioning.calibration.run import run_simulated
            from canshaper_sim.parameters import changed_parameters

            run_simulated(drive, deployment, changed_parameters(changes or []), show)
    result = drive.result()
    if write:  # first: what reads the output may end before its last line
        bus = deployment.config.buses[deployment.axes[axis].config.valve.bus]
        write_curve(deployment, axis, result, simulated=not live or bus.is_virtual)
    results.print("\n".join(curve_lines(deployment, axis, result, top_pct)), soft_wrap=True)

    def figure() -> "Figure":
        from canshaper.commissioning.calibration.plot import figure as of_valve

        return of_valve(axis, deployment.axes[axis].config.limits.output_limits(), result, top_pct)

    if path := results.picture(None, figure):
        results.picture_line(path)
    if write:
        results.print(f"written: {deployment.path}", soft_wrap=True)
    results.write()
