"""Inner state of the controller as rows of numbers, in the order of ``c/cs_inspect.c``."""

from canshaper.controller.controller import Controller
from canshaper.controller.motion import MotionRunner
from canshaper.controller.runner import AxisControl
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.limit_aware import LimitAware
from canshaper.shaping.shapers.smoothing import FirstOrder, SCurve

# fmt: off
NAMES = (
    "state", "reason", "stopping", "was_enabled", "was_reset", "angle", "rate", "twin_angle",
    "twin_rate", "unlimited", "value", "slope", "offset", "joins", "bypassed", "steps", "setpoint",
    "path", "applied", "commanded", "command", "ramp", "own_ramp", "carry", "dropped_at", "ran",
    "side", "due", "left", "no_run_on", "crossed", "added_left", "rested", "asked", "unattended",
    "recent_low", "recent_high", "demanded_low", "demanded_high", "added",
)
# fmt: on
# The C stops counting ticks here: no counter overflows while a machine rests for years.
MOST_TICKS = 1_000_000_000


def rows(controller: Controller) -> list[list[float]]:
    """Return one row for each axis, then one for each motion."""
    return [*map(_axis_row, controller.axes.values()), *map(_motion_row, controller.motions)]


def _axis_row(runner: AxisControl) -> list[float]:
    axis = runner.axis
    states, transfer, stage = axis._states, axis._transfer, axis._stage
    shaper, sway, output, small = transfer._shaper, axis.sway, axis.output, stage._small
    twin = shaper._twin if isinstance(shaper, LimitAware) else None
    value = shaper._command if isinstance(shaper, Gff) else 0.0
    if isinstance(shaper, FirstOrder | SCurve):
        value = shaper._value
    row: list[float] = [
        states.state,
        states.reason,
        states._stopping,
        states._was_enabled,
        states._was_reset,
        sway.angle if sway else 0.0,
        sway.rate if sway else 0.0,
        twin.angle if twin else 0.0,
        twin.rate if twin else 0.0,
        shaper._unlimited if isinstance(shaper, LimitAware) else 0.0,
        value,
        shaper._slope if isinstance(shaper, SCurve) else 0.0,
        transfer.offset,
        transfer._joins,
        transfer._bypassed,
        output.steps,
        output.setpoint,
        output.path,
        output.applied,
        output.commanded,
        axis.command,
        stage.ramp,
        stage._own_ramp,
        stage._carry,
        stage._dropped_at,
        stage._ran,
        stage._side,
        small._due,
        small._left,
        max(stage._no_run_on, -MOST_TICKS),
        min(stage._crossed, MOST_TICKS),
        max(axis.added_time._left, -MOST_TICKS),
        min(axis.added_time._rested, MOST_TICKS),
        axis.added_time.asked,
        axis.added_time.unattended,
        stage._recent.low,
        stage._recent.high,
        stage._demanded.low,
        stage._demanded.high,
        runner.added,
    ]
    return [float(one) for one in row]


def _motion_row(runner: MotionRunner) -> list[float]:
    motion = runner._motion
    radius = motion._radius_m
    row = [motion._weight, -1.0 if radius is None else radius]
    for one in (motion._slew, motion._near_far):
        row += [one.added, one.reached, one.way, one.ahead_s, one.joins] if one else [0.0] * 5
    return [float(one) for one in row]
