"""What one stroke of the joystick shows: rise, run-on, dip, and how the output rose again."""

import math
from collections.abc import Mapping, Sequence

from canshaper.report.strokes import Stroke
from canshaper_sim.recording import AxisTrace

REACHED = 0.95  # of the asked speed: the usual 5 % band of a settling time
LOST_AGAIN = 0.90  # below this the speed was not reached but only passed through
STOPPED = 0.05  # of full speed: the deadband of a common proportional valve


def rms(t_s: list[float], values: list[float]) -> float | None:
    """Root of the mean square over the time; None without an interval."""
    if len(t_s) < 2:
        return None
    area = integral(t_s, [value * value for value in values])
    return math.sqrt(area / (t_s[-1] - t_s[0]))


def integral(t_s: list[float], values: list[float], window: range | None = None) -> float:
    """Integrate over the samples of the window, or over all, by trapezoids."""
    window = range(len(t_s)) if window is None else window
    return math.fsum(0.5 * (values[k] + values[k + 1]) * (t_s[k + 1] - t_s[k]) for k in window[:-1])


def _crossing_s(t_s: list[float], values: Mapping[int, float], k: int, level: float) -> float:
    """Time at which the straight line from sample k to k + 1 passes the level."""
    share = (level - values[k]) / (values[k + 1] - values[k])
    return t_s[k] + share * (t_s[k + 1] - t_s[k])


def time_to_95_s(t_s: list[float], trace: AxisTrace, stroke: Stroke) -> float | None:
    """Seconds from the press to the speed that was asked, less 5 %; None where it never comes."""
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
    """Seconds from the first sample of a rest until what moves at this |speed| stands."""
    release, last = rest[0], rest[-1]
    moving = next((k for k in reversed(rest) if abs(speed[k]) >= STOPPED), None)
    if moving is None:
        return 0.0
    if moving == last:
        return t_s[last] - t_s[release]
    around = {k: abs(speed[k]) for k in (moving, moving + 1)}
    return _crossing_s(t_s, around, moving, STOPPED) - t_s[release]


def run_on_travel(t_s: list[float], trace: AxisTrace, stroke: Stroke) -> float:
    """Travel after the release, in seconds of full speed."""
    return stroke.direction * integral(t_s, trace.speed, stroke.rest)


def dip(trace: AxisTrace, stroke: Stroke) -> float:
    """How far the output fell back while the joystick was held, in parts of full command."""
    first, last = stroke.plateau
    sent_max, command_max, dip = -math.inf, 0.0, 0.0
    for k in range(stroke.press, last + 1):
        sent, command = stroke.direction * trace.sent[k], abs(trace.joystick[k])
        sent_max, command_max = max(sent_max, sent), max(command_max, command)
        if k >= first:
            dip = max(dip, (sent_max - sent) - (command_max - command))
    return dip


def re_rise(trace: AxisTrace, stroke: Stroke) -> float:
    """How far the output rose again after the release, in parts of full command."""
    lowest, rise = math.inf, 0.0
    for k in stroke.rest:
        sent = abs(trace.sent[k])
        lowest = min(lowest, sent)
        rise = max(rise, sent - lowest)
    return rise
