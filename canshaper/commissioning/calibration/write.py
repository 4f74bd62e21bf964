"""A measured valve curve in the file."""

from canshaper.commissioning.assumed import confirmed
from canshaper.commissioning.calibration.fit import Calibration
from canshaper.config.origin import note, written_by
from canshaper.edit.edit import Change, change
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment

# Speed of each axis as `canshaper sim` sends it.
SIMULATED = {
    "slew": "TipVelocity.SlewRate",
    "near_far": "TipVelocity.RadialSpeed",
    "lift": "TipVelocity.VerticalSpeed",
    "lift_cylinder": "JointVelocity.LiftRate",
    "knuckle": "JointVelocity.KnuckleRate",
    "extension": "JointVelocity.ExtensionSpeed",
}


def speed_signal(deployment: Deployment, axis: str, speed: str | None) -> tuple[str, str]:
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


def curve_lines(
    deployment: Deployment, axis: str, result: Calibration, top_pct: float
) -> list[str]:
    """The result for people, after what the file has."""
    limits = deployment.axes[axis].config.limits
    now = f"deadband_pct {limits.deadband_pct:g}"
    if limits.curve_command_pct and limits.curve_speed_pct:
        pairs = zip(limits.curve_command_pct, limits.curve_speed_pct, strict=True)
        ends = [f"{command:g}" for command, speed in pairs if speed == 0.0]
        now = f"a curve with the dead band at {' to '.join(ends)} %"
    lines = [f"axis {axis}: the file has {now}"]
    full = max(result.positive.full, result.negative.full)
    for name, one in (("positive", result.positive), ("negative", result.negative)):
        lines.append(
            f"  {name}: opens at {100 * one.opens:.1f} % of the command, full speed"
            f" {one.full:.4g} ({100 * one.full / full:.0f} %), delay of the valve worth"
            f" {100 * one.delay:.1f} %"
        )
    commands, speeds = result.curve()
    lines += [f"  curve_command_pct: {commands}", f"  curve_speed_pct: {speeds}"]
    if top_pct < 100:
        lines.append(f"  above {top_pct:g} % of the command this is a straight line, not measured")
    return lines


def write_curve(deployment: Deployment, axis: str, result: Calibration, *, simulated: bool) -> None:
    """Write the curve of a valve, and where it was measured.

    Raises:
        ConfigError: the file cannot be changed.
    """
    commands, speeds = result.curve()
    values = {
        "deadband_pct": None,
        "curve_command_pct": commands,
        "curve_speed_pct": speeds,
        "curve_origin": written_by("calibrate", simulated=simulated),
    }
    written: Change = (("axes", axis, "limits"), values, note("calibrate"))
    measured = (f"axes.{axis}.limits.{key}" for key in values)
    change(deployment.path, [written, *confirmed(deployment.path, measured)])
