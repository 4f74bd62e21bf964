"""Curve of a valve from a slow ramp: computed, shown, written into the file.

A valve follows its command with a delay: on the way up it opens at a larger command, on the way
down it closes at a smaller one. With a ramp as fast up as down the mean of both is right.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

from canshaper.commissioning.origins import confirmed
from canshaper.edit.edit import Change, change, note
from canshaper.errors import CalibrationError
from canshaper.machine.deployment import Deployment


class Sample(NamedTuple):
    """One moment of a measurement.

    Attributes:
        command: command to the valve, part of full command.
        speed: what the feedback showed, in its own unit.
    """

    command: float
    speed: float


@dataclass(frozen=True, slots=True)
class Direction:
    """One direction of a valve.

    Attributes:
        opens: command at which it begins to move, part of full.
        points: (command, speed) on the way from there to the top of the ramp, and at a top below
            97 % of full command; speed in the unit of the feedback.
        delay: difference of the commands at which it opens on the way up and closes on the way
            down, part of full; the delay of the valve makes it.
        full: speed at full command, in a straight line through the first point and the top.
    """

    opens: float
    points: tuple[tuple[float, float], ...]
    delay: float
    full: float


@dataclass(frozen=True, slots=True)
class Calibration:
    """Both directions of a valve; the numbers of the negative one are magnitudes too."""

    positive: Direction
    negative: Direction

    def curve(self) -> tuple[list[float], list[float]]:
        """Return rising commands, % of full, and speeds, % of the faster direction's full speed."""
        full = max(self.positive.full, self.negative.full)
        commands, speeds = list[float](), list[float]()
        for sign, one in ((-1.0, self.negative), (1.0, self.positive)):
            points = [(one.opens, 0.0), *one.points, (1.0, one.full)]
            part = [(sign * 100.0 * c, sign * 100.0 * s / full) for c, s in points]
            for command, speed in reversed(part) if sign < 0 else part:
                step = round(command, 2) + 0.0
                if commands and step <= commands[-1]:  # without a deadband both ends of it are 0
                    step = round(commands[-1] + 0.01, 2)
                commands.append(step)
                speeds.append(round(speed, 2) + 0.0)
        return commands, speeds


# A ramp that goes this far has measured full speed.
FULL = 0.97
# Points of the curve between the opening and the top of the ramp.
POINTS = (0.25, 0.5, 0.75)
# An axis moves where its speed exceeds so many standard deviations of the noise, in so many samples
# one after the other.
SIGMAS = 5.0
LASTING = 5
# A line through the samples within this part of the speed at the largest command finds the opening.
# At most so much below that part counts as bent by the lag of the valve.
WINDOW = 0.3
MOST_BENT = 0.3
# Less than this part of the largest speed seen is resolution, not motion.
LEAST = 0.01


def fit(
    up: Sequence[Sample], held: Sequence[Sample], down: Sequence[Sample], noise: float
) -> Direction:
    """Compute one direction of a valve from its ramp; all numbers are magnitudes.

    Args:
        up: samples while the command rose, in order.
        held: samples at the largest command, when all had settled.
        down: samples while it fell, in order.
        noise: standard deviation of the feedback at rest.

    Raises:
        CalibrationError: it did not move steadily, got no faster, or too few samples came.
    """
    if not (up and held and down):
        raise CalibrationError("no feedback came while the axis was driven")
    rising, falling = list(up), list(reversed(down))
    top = held[-1].command
    largest = max(s.speed for s in (*rising, *falling))
    moving = max(SIGMAS * noise, LEAST * largest)
    if largest < 2.0 * moving:
        raise CalibrationError(
            f"the axis did not move up to {top:.0%} of the command, or its feedback trembles as"
            f" much: largest speed {largest:g}, noise {noise:g}; is it at its end? Else try a"
            " higher top"
        )
    for way in (rising, falling):
        _moves_steadily(way, moving)
    settled = sum(s.speed for s in held) / len(held)
    # The lag of the valve bends the foot of both ways: it opens later and closes later. Three time
    # constants farther both are straight, and equally far from the curve of the valve.
    opens, delay = _opening(rising, falling, 0.5, settled, moving)
    low = min(3.0 * delay / (top - opens), MOST_BENT) if top > opens else MOST_BENT
    opens, delay = _opening(rising, falling, low + 0.5 * WINDOW, settled, moving)
    opens = max(0.0, opens)
    points = []
    for share in POINTS:
        at = opens + share * (top - opens)
        speed = 0.5 * (_speed_at(rising, at, top) + _speed_at(falling, at, top))
        points.append((at, speed))
    points.append((top, settled))
    if any(b[1] <= a[1] for a, b in pairwise([(opens, 0.0), *points])):
        raise CalibrationError("the speed does not rise with the command; is the axis at its end?")
    (c0, s0), (c1, s1) = points[0], points[-1]
    full = s1 + (1.0 - c1) * (s1 - s0) / (c1 - c0) if c1 < 1.0 else s1
    kept = tuple(points if top < FULL else points[:-1])
    return Direction(opens, kept, delay, full)


def _moves_steadily(samples: Sequence[Sample], moving: float) -> None:
    run = 0
    for sample in samples:
        run = run + 1 if sample.speed > moving else 0
        if run == LASTING:
            return
    raise CalibrationError("the axis did not move steadily; is the feedback that of this axis?")


def _opening(
    rising: Sequence[Sample],
    falling: Sequence[Sample],
    middle: float,
    settled: float,
    moving: float,
) -> tuple[float, float]:
    """Return the command at which the valve opens, and how much later it opens than it closes.

    Args:
        rising: samples of the way up.
        falling: samples of the way down.
        middle: lines are laid through the speeds around this part of ``settled``.
        settled: speed at the largest command.
        moving: the least speed that is motion.

    Raises:
        CalibrationError: too few samples, or the speed does not rise.
    """
    low = max((middle - 0.5 * WINDOW) * settled, moving)
    high = (middle + 0.5 * WINDOW) * settled
    ends = []
    for way in (rising, falling):
        part = [s for s in way if low <= s.speed <= high]
        if len(part) < LASTING:
            raise CalibrationError("too few samples of the feedback on the ramp; try a slower one")
        command, slope = _line(part)
        if slope <= 0.0:
            raise CalibrationError("the speed does not rise with the command")
        ends.append(command)
    return 0.5 * (ends[0] + ends[1]), max(0.0, ends[0] - ends[1])


def _line(samples: Sequence[Sample]) -> tuple[float, float]:
    """Return command at speed zero and slope of the best line; slope 0 where it does not rise."""
    n = len(samples)
    c, s = sum(x.command for x in samples) / n, sum(x.speed for x in samples) / n
    spread = math.fsum((x.command - c) ** 2 for x in samples)
    if spread == 0.0:
        return c, 0.0
    slope = math.fsum((x.command - c) * (x.speed - s) for x in samples) / spread
    return (c - s / slope, slope) if slope > 0.0 else (c, 0.0)


def _speed_at(samples: Sequence[Sample], command: float, top: float) -> float:
    """Return the mean speed within 3 % of ``top`` of a command; CalibrationError for none."""
    width = 0.03 * top
    near = [s.speed for s in samples if abs(s.command - command) <= width]
    if not near:
        raise CalibrationError("too few samples of the feedback; is its message cyclic?")
    return sum(near) / len(near)


def curve_lines(
    deployment: Deployment, axis: str, result: Calibration, top_pct: float
) -> list[str]:
    """Return lines for people: dead band or curve of the file, the measured curve, its limit."""
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


def write_curve(
    deployment: Deployment, axis: str, result: Calibration, origin: dict[str, Any]
) -> None:
    """Write the curve of a valve and its origin (``origin_of``) in place of ``deadband_pct``.

    Raises:
        ConfigError: the file cannot be changed.
    """
    commands, speeds = result.curve()
    values = {
        "deadband_pct": None,
        "curve_command_pct": commands,
        "curve_speed_pct": speeds,
        "curve_origin": origin,
    }
    written: Change = (("axes", axis, "limits"), values, note("calibrate"))
    measured = (f"axes.{axis}.limits.{key}" for key in values)
    change(deployment.path, [written, *confirmed(deployment.path, measured)])
