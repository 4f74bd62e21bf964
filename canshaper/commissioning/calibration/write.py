"""A measured valve curve, or the flow of the pump, in the file."""

import math
from collections.abc import Sequence
from typing import Any

from canshaper.commissioning.assumed import confirmed
from canshaper.commissioning.calibration.fit import Calibration
from canshaper.commissioning.calibration.together import KEPT, Drives, measured
from canshaper.edit.edit import Change, change, note, written_by
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper_sim.axes import SPEED_SIGNALS

# Axes whose speeds are so near to each other slow down alike.
ALIKE = 0.1


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
    moved = deployment.coordinates.get(axis, axis)
    message, dot, signal = (speed or SPEED_SIGNALS.get(moved, "")).partition(".")
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


def pair_of(deployment: Deployment, axes: Sequence[str]) -> tuple[str, ...]:
    """The two axes that are named, or the first two with a filter; UsageError for others."""
    filtered = [n for n, one in deployment.config.axes.items() if one.filter.kind != "off"]
    names = tuple(dict.fromkeys(axes)) or tuple(filtered[:2])
    if len(names) != 2 or not {*names} <= deployment.axes.keys():
        got, there = ", ".join(names) or "none", ", ".join(deployment.axes)
        raise UsageError(f"--together: expected two axes, got {got}; there are {there}")
    return names


def pump_lines(
    deployment: Deployment, axes: Sequence[str], drives: Drives, origin: dict[str, Any] | None
) -> list[str]:
    """Lines on the pump, whose flow is written where an origin is given; errors of ``measured``."""
    oil = deployment.config.hydraulics
    shares = {name: oil.shares.get(name, 1.0) if oil else 1.0 for name in deployment.axes}
    directions, lines = measured(drives, axes, shares), []
    for ways, kept, asked, (flow, half) in reversed(directions):
        each = zip(axes, ways, kept, strict=True)
        parts = (f"{name} {'-+'[way > 0]} {v:.0%} ± {h:.0%}" for name, way, (v, h) in each)
        of = f"flow {flow:.2f} ± {half:.2f} of {asked:.2f} full axis flows"
        lines.append(f"at once, of the speed alone: {', '.join(parts)}: {of}")
    # A budget that is too small costs speed, one that is too large leaves swing.
    least = math.floor(100.0 * (flow - half)) / 100.0
    if all(part >= KEPT for direction in directions for part, _ in direction.kept):
        if asked < KEPT * sum(shares[name] for name in axes):
            cure = "measure again with a larger --top, or limits.max_pct"
            return [*lines, f"flow at least {least:g}: that little does not load the pump; {cure}"]
        every = f"hydraulics: {{ flow: {sum(shares.values()):g} }}"
        lines.append(f"enough oil for both: flow at least {least:g}; no hydraulics section needed")
        return [*lines, f"  where all axes have enough, {every} tells canshaper check so"]
    (low, slower), (high, faster) = sorted(zip((part for part, _ in kept), axes, strict=True))
    how = "neither alike nor one alone: does something else take oil, or move the load?"
    if high - low <= ALIKE:
        how = "the valve shares the flow: both slow down alike"
    elif high >= KEPT:
        how = f"plain load sensing: {slower} starves, {faster} keeps its speed"
    by = ", ".join(f"{name} {shares[name]:g}" for name in axes)
    lines += [how, f"hydraulics: {{ flow: {least:g} }} # lower end; shares: {by}"]
    if origin:
        values: dict[str, Any] = {"flow": least, "origin": origin}
        written = (("hydraulics",), values, "") if oil else ((), {"hydraulics": values}, "")
        change(deployment.path, [written, *confirmed(deployment.path, ["hydraulics.flow"])])
        lines.append(f"written: {deployment.path}")
    return lines
