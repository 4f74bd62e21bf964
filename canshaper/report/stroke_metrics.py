"""Measures of one stroke of the joystick and of the whole crane: rise, run-on, dip, swing."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from canshaper.report.strokes import RESIDUAL_WINDOW_MIN_S, Stroke, residual_window, rests
from canshaper_sim.recording import AxisTrace, CraneTrace, Recording

REACHED = 0.95  # of the demanded speed: the usual 5 % band of a settling time
LOST_AGAIN = 0.90  # below this the speed was not reached but only passed through
STOPPED = 0.05  # of full speed: the deadband of a common proportional valve
STILL_DEG = 2.0  # a grapple of 1.2 m then moves by 4 cm: it can be placed


def rms(t_s: list[float], values: list[float]) -> float | None:
    """Return the root mean square over time; None for fewer than two samples."""
    if len(t_s) < 2:
        return None
    area = integral(t_s, [value * value for value in values])
    return math.sqrt(area / (t_s[-1] - t_s[0]))


def integral(t_s: list[float], values: list[float], window: range | None = None) -> float:
    """Return the integral over the samples of the window, or over all, by trapezoids."""
    window = range(len(t_s)) if window is None else window
    return math.fsum(0.5 * (values[k] + values[k + 1]) * (t_s[k + 1] - t_s[k]) for k in window[:-1])


def _crossing_s(t_s: list[float], values: Mapping[int, float], k: int, level: float) -> float:
    """Return the time when the straight line from sample k to k + 1 passes the level."""
    share = (level - values[k]) / (values[k + 1] - values[k])
    return t_s[k] + share * (t_s[k + 1] - t_s[k])


def time_to_95_s(t_s: list[float], trace: AxisTrace, stroke: Stroke) -> float | None:
    """Return the time in s from the press to 95 % of the demanded speed, with the joystick held.

    If the speed falls below 90 % again, only a later time counts; None if there is none.
    """
    held = range(stroke.press, stroke.plateau[1] + 1)
    speed = {k: stroke.direction * trace.speed[k] for k in held}
    lost = [k for k in held if speed[k] < LOST_AGAIN * stroke.level]
    start = lost[-1] if lost else stroke.press
    threshold = REACHED * stroke.level
    reached = next((k for k in range(start, held.stop) if speed[k] >= threshold), None)
    if reached is None:
        return None
    if reached == stroke.press:
        return 0.0
    return _crossing_s(t_s, speed, reached - 1, threshold) - t_s[stroke.press]


def run_on_s(t_s: list[float], speed: Sequence[float], rest: range) -> float:
    """Return the time in s of a rest until |speed| stays below 5 % of full, or all of its time."""
    return _until_below_s(t_s, speed, rest, STOPPED)


def still_after(
    t_s: list[float], sway_deg: Sequence[float], rests: Iterable[range], still_deg: float
) -> tuple[float | None, bool | None]:
    """Return the largest time from a release until the swing stays below a bound.

    A time that is only a lower bound counts as larger than any other.

    Args:
        t_s: times of the samples.
        sway_deg: swing, degrees; the bound applies to its absolute value.
        rests: samples of each rest, from the release on.
        still_deg: the bound, degrees.

    Returns:
        The time in s, and whether it is a lower bound: the rest ended with more swing, or too soon
        after it to tell. (None, None) without a rest.
    """
    times = []
    for rest in rests:
        time_s = _until_below_s(t_s, sway_deg, rest, still_deg)
        looked_s = t_s[rest[-1]] - t_s[rest[0]] - time_s
        times.append((time_s, looked_s < RESIDUAL_WINDOW_MIN_S and time_s > 0.0))
    return max(times, key=lambda one: (one[1], one[0]), default=(None, None))


def _until_below_s(t_s: list[float], values: Sequence[float], rest: range, level: float) -> float:
    """Return the time in s from the start of a rest until |values| stay below, or to its end."""
    release, last = rest[0], rest[-1]
    above = next((k for k in reversed(rest) if abs(values[k]) >= level), None)
    if above is None:
        return 0.0
    if above == last:
        return t_s[last] - t_s[release]
    around = {k: abs(values[k]) for k in (above, above + 1)}
    return _crossing_s(t_s, around, above, level) - t_s[release]


def run_on_travel(t_s: list[float], trace: AxisTrace, stroke: Stroke) -> float:
    """Return the travel after the release, forward in the stroke, in seconds of full speed."""
    return stroke.direction * integral(t_s, trace.speed, stroke.rest)


def dip(trace: AxisTrace, stroke: Stroke) -> float:
    """Return the largest fall of the output below its maximum while the joystick is held.

    The fall of the joystick itself is taken off; fraction of full command.
    """
    first, last = stroke.plateau
    sent_max, command_max, dip = -math.inf, 0.0, 0.0
    for k in range(stroke.press, last + 1):
        sent, command = stroke.direction * trace.sent[k], abs(trace.joystick[k])
        sent_max, command_max = max(sent_max, sent), max(command_max, command)
        if k >= first:
            dip = max(dip, (sent_max - sent) - (command_max - command))
    return dip


def re_rise(trace: AxisTrace, stroke: Stroke) -> float:
    """Return the largest rise of |output| in the rest, fraction of full command."""
    lowest, rise = math.inf, 0.0
    for k in stroke.rest:
        sent = abs(trace.sent[k])
        lowest = min(lowest, sent)
        rise = max(rise, sent - lowest)
    return rise


@dataclass(frozen=True)
class CraneMetrics:
    """Measures of the whole crane over one drive, whatever axes moved together.

    A rest is the time from the release of the last joystick until any joystick is pressed.

    Attributes:
        still_s: time from a release until the total swing stays below the bound of a still grapple;
            the largest, of the lower bounds if there are any.
        swings_on: ``still_s`` is a lower bound: the rest ended with more swing, or too soon after.
        peak_deg: largest total swing of the grapple over the whole drive, degrees.
        rms_deg: root mean square over time of the total swing, degrees.
        residual_deg: largest total swing in the rests, later than ``dwell_s`` after the release,
            degrees.
        run_on_s: longest time from a release until every axis stays below 5 % of its full speed; a
            rest that ends earlier counts with its length (a lower bound).
        run_on_m: largest distance of the tip in a rest from its place at the release, m.

    A measure is None if the drive has no rest or signal to take it from.
    """

    still_s: float | None
    swings_on: bool | None
    peak_deg: float | None
    rms_deg: float | None
    residual_deg: float | None
    run_on_s: float | None
    run_on_m: float | None


def crane_metrics(
    recording: Recording, crane: CraneTrace, still_deg: float = STILL_DEG
) -> CraneMetrics:
    """Measure the crane of a drive; a grapple that swings less than ``still_deg`` counts as still.

    Raises:
        ValueError: the recording is malformed (see ``find_strokes``).
    """
    t_s, sway, tip_m = recording.t_s, crane.sway_deg, crane.tip_m
    still = [rest for rest in rests(recording) if len(rest) > 1]
    windows = [
        window for rest in still if (window := residual_window(t_s, rest, recording.dwell_s))
    ]
    traces = recording.axes.values()
    speed = [max(abs(trace.speed[k]) for trace in traces) for k in range(len(t_s))]
    still_s, swings_on = still_after(t_s, sway, still, still_deg)
    return CraneMetrics(
        still_s,
        swings_on,
        peak_deg=max(sway, default=None),
        rms_deg=rms(t_s, sway),
        residual_deg=max((sway[k] for window in windows for k in window), default=None),
        run_on_s=max((run_on_s(t_s, speed, rest) for rest in still), default=None),
        run_on_m=max(
            (math.dist(tip_m[rest.start], tip_m[k]) for rest in still if tip_m for k in rest),
            default=None,
        ),
    )
