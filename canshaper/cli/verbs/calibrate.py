"""``canshaper calibrate``: dead band, gain and asymmetry of a valve, measured and written."""

from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import (
    CHANNEL,
    FILE,
    INTERFACE,
    NETWORK,
    SET,
    echo,
    loader,
    refuse_shipped,
)
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from canshaper.commissioning.calibration.drive import CalibrationDrive
    from canshaper.commissioning.calibration.fit import Calibration
    from canshaper.machine.deployment import Deployment

# Speed of each axis as `canshaper sim` tells it.
SIMULATED = {
    "slew": "TipVelocity.SlewRate",
    "near_far": "TipVelocity.RadialSpeed",
    "lift": "TipVelocity.VerticalSpeed",
    "lift_cylinder": "JointVelocity.LiftRate",
    "knuckle": "JointVelocity.KnuckleRate",
    "extension": "JointVelocity.ExtensionSpeed",
}


def calibrate(
    file: str = FILE,
    axis: str = typer.Option(..., "--axis", help="Axis whose valve is measured."),
    speed: str | None = typer.Option(
        None, "--speed", metavar="MESSAGE.SIGNAL", help="Feedback of its speed in the DBC files."
    ),
    rate_pct_s: float = typer.Option(3.0, "--rate", min=0.5, max=10.0, help="Ramp, % per s."),
    top_pct: float = typer.Option(40.0, "--top", min=10.0, max=100.0, help="Largest command, %."),
    live: bool = typer.Option(False, "--live", help="On the machine, not on the simulated crane."),
    yes: bool = typer.Option(False, "--yes", help="With --live: do not ask."),
    write: bool = typer.Option(False, "--write", help="Write the curve into the file."),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    network: bool = NETWORK,
    changes: list[str] | None = SET,
) -> None:
    """Measure at which command a valve opens, and what it gives, in each direction.

    Drives one axis slowly up and down, first with positive, then with negative commands, and
    compares with the feedback of its speed. By default on the simulated crane; with --live on the
    machine: stop the service first, keep everybody away, hold the enable switch all the time and
    leave the joystick in neutral. Releasing the enable, moving the joystick, Ctrl-C and every fault
    that stops the daemon end it with neutral valves.

    Beyond the top of the ramp the curve is a straight line, and says so.

    Examples:

      canshaper calibrate config/forwarder-robust.yaml --axis slew

      canshaper calibrate config/forwarder-robust.yaml --axis slew --set slew.deadband=0.08

      canshaper calibrate machine.yaml --axis slew --speed TipVelocity.SlewRate --live --write
    """
    from canshaper.commissioning.calibration.drive import CalibrationDrive
    from canshaper.commissioning.calibration.ramp import Ramp
    from canshaper.commissioning.calibration.run import run_live
    from canshaper.report.console import progress_bar

    deployment = loader(file, interface, channel, network=network)()
    if write:
        refuse_shipped(file)
    ramp = Ramp(rate_pct_s / 100.0, top_pct / 100.0)
    drive = CalibrationDrive(deployment, axis, _speed(deployment, axis, speed), ramp)
    if live and not yes:
        typer.confirm(
            f"Axis {axis} will move by itself for {ramp.duration_s:.0f} s, up to"
            f" {top_pct:.0f} % of its command in both directions. Is everybody away, and the"
            " enable switch held?",
            abort=True,
        )
    with progress_bar(axis) as on_progress:

        def report(now: "CalibrationDrive") -> None:
            waits = f" waits for {now.waiting_for}" if now.waiting_for else ""
            on_progress(now.progress, f"{axis}{waits}")

        if live:
            run_live(drive, deployment, report)
        else:
            from canshaper.commissioning.calibration.simulated import run_simulated
            from canshaper_sim.parameters import changed_parameters

            run_simulated(drive, deployment, changed_parameters(changes or []), report)
    result = drive.result()
    if write:  # first: what reads the output may end before its last line
        _write(deployment, axis, result)
    _print_curve(deployment, axis, result, top_pct)
    if write:
        echo(f"written: {deployment.path}")


def _speed(deployment: "Deployment", axis: str, speed: str | None) -> tuple[str, str]:
    """Message and signal with the speed of the axis.

    Raises:
        ValueError: no such axis; or none was named, and none is known.
    """
    bound = deployment.axes.get(axis)
    if bound is None:
        names = ", ".join(deployment.axes)
        raise UsageError(f"--axis: expected an axis, got {axis!r}; there are {names}")
    if speed is None and bound.config.feedback:
        return bound.config.feedback.message, bound.config.feedback.signal
    message, dot, signal = (speed or SIMULATED.get(axis, "")).partition(".")
    if not (message and dot and signal):
        raise UsageError(f"--speed: expected MESSAGE.SIGNAL, got {speed or 'none'}")
    return message, signal


def _print_curve(
    deployment: "Deployment", axis: str, result: "Calibration", top_pct: float
) -> None:
    """The result for people, after what the file has."""
    limits = deployment.axes[axis].config.limits
    now = f"deadband_pct {limits.deadband_pct:g}"
    if limits.curve_command_pct and limits.curve_speed_pct:
        pairs = zip(limits.curve_command_pct, limits.curve_speed_pct, strict=True)
        ends = [f"{command:g}" for command, speed in pairs if speed == 0.0]
        now = f"a curve with the dead band at {' to '.join(ends)} %"
    echo(f"axis {axis}: the file has {now}")
    full = max(result.positive.full, result.negative.full)
    for name, one in (("positive", result.positive), ("negative", result.negative)):
        echo(
            f"  {name}: opens at {100 * one.opens:.1f} % of the command, full speed"
            f" {one.full:.4g} ({100 * one.full / full:.0f} %), delay of the valve worth"
            f" {100 * one.delay:.1f} %"
        )
    commands, speeds = result.curve()
    echo(f"  curve_command_pct: {commands}\n  curve_speed_pct: {speeds}")
    if top_pct < 100:
        echo(f"  above {top_pct:g} % of the command this is a straight line, not measured")


def _write(deployment: "Deployment", axis: str, result: "Calibration") -> None:
    from canshaper.config.edit import set_values

    commands, speeds = result.curve()
    values = {
        "deadband_pct": None,
        "curve_command_pct": commands,
        "curve_speed_pct": speeds,
    }
    set_values(deployment.path, ("axes", axis, "limits"), values)
