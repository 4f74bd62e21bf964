"""Strokes of the joystick in a recorded drive, and the rests after them, which show the swing."""

import math
import statistics
from dataclasses import dataclass, replace
from itertools import groupby

from canshaper_sim.recording import DWELL_S, AxisTrace, CraneTrace, Recording

# Deflection: two steps of a frame of 1/125 and a little, never a command.
NEUTRAL_BAND = 0.02
PLATEAU = 0.95  # of the largest deflection of a stroke: a hand holding still wanders this far
RESIDUAL_DWELL_S = DWELL_S
RESIDUAL_WINDOW_MIN_S = 1.0  # half a period of a 1 m tool: a shorter look may fall on a zero
_ROUNDING_S = 1e-6  # a time base that was shifted must not lose the sample on the edge


@dataclass(frozen=True)
class Stroke:
    """One deflection of one joystick; indices are samples of the recording.

    Attributes:
        axis: name of the axis.
        direction: +1.0 or -1.0.
        press: first sample outside the neutral band.
        release: first sample back in neutral or on the other side; None if the drive ends first.
        level: demanded speed, median of |joystick| over the plateau, fraction of full speed.
        plateau: first and last sample of the longest run of |joystick| above ``PLATEAU`` of the
            largest deflection of the stroke.
        alone: every other joystick is in neutral from press to release.
        rest: samples from the release until any joystick is pressed, or another joystick is
            released; empty for a reversal and for a stroke without release.
    """

    axis: str
    direction: float
    press: int
    release: int | None
    level: float
    plateau: tuple[int, int]
    alone: bool
    rest: range


def find_strokes(recording: Recording) -> dict[str, list[Stroke]]:
    """Return the strokes of every joystick of the drive by axis, in order of time.

    Raises:
        ValueError: the lists differ in length, time does not increase, or a value is no number.
    """
    _check(recording)
    spans = {name: _spans(trace.joystick) for name, trace in recording.axes.items()}
    return {
        name: [_stroke(recording, spans, name, span) for span in own] for name, own in spans.items()
    }


def residual_windows(recording: Recording, strokes: list[Stroke]) -> list[range]:
    """Return the windows that show the residual swing of these strokes of one axis.

    A window holds the samples from ``dwell_s`` after the release until a joystick moves. A stroke
    during which another axis moved has no window, nor has a rest that leaves less than
    ``RESIDUAL_WINDOW_MIN_S``.
    """
    t_s, dwell_s = recording.t_s, recording.dwell_s
    alone = (residual_window(t_s, s.rest, dwell_s) for s in strokes if s.alone and s.rest)
    return [window for window in alone if window]


def residual_window(t_s: list[float], rest: range, dwell_s: float) -> range:
    """Return a rest from ``dwell_s`` on; empty if that lasts under ``RESIDUAL_WINDOW_MIN_S``."""
    begin_s = t_s[rest.start] + dwell_s - _ROUNDING_S
    start = next((k for k in rest if t_s[k] >= begin_s), rest.stop)
    window = range(start, rest.stop)
    if window and t_s[window[-1]] - t_s[start] >= RESIDUAL_WINDOW_MIN_S - _ROUNDING_S:
        return window
    return range(0)


def rests(recording: Recording) -> list[range]:
    """Return the samples from each release of the last joystick to the next press, or the end."""
    strokes = [one for own in find_strokes(recording).values() for one in own]

    def moved(k: int) -> bool:
        return any(s.press <= k and (s.release is None or k < s.release) for s in strokes)

    # Two strokes released in one sample begin the same rest.
    still = {s.rest for s in strokes if s.rest and not moved(s.rest[0])}
    return sorted(still, key=lambda rest: rest.start)


def aligned(raw: Recording, shaped: Recording) -> tuple[Recording, Recording]:
    """Cut two drives of the same script to their common time span, and give them one time base.

    The first press of any joystick gets the same time in both drives (to one sample); if a drive
    has no press, the starts do. So a longer recording is not measured over a longer rest.

    Raises:
        ValueError: the drives have different axes or no samples, or one is malformed.
    """
    if raw.axes.keys() != shaped.axes.keys():
        raise ValueError(f"the drives have different axes: {[*raw.axes]} and {[*shaped.axes]}")
    anchors = [_first_press_s(raw), _first_press_s(shaped)]
    if not raw.t_s or not shaped.t_s:
        raise ValueError("a drive without samples cannot be compared")
    at_raw_s, at_shaped_s = anchors
    if at_raw_s is None or at_shaped_s is None:
        at_raw_s, at_shaped_s = raw.t_s[0], shaped.t_s[0]
    lead_s = min(at_raw_s - raw.t_s[0], at_shaped_s - shaped.t_s[0])
    tail_s = min(raw.t_s[-1] - at_raw_s, shaped.t_s[-1] - at_shaped_s)
    return (
        _cut(raw, at_raw_s - lead_s, at_raw_s + tail_s),
        _cut(shaped, at_shaped_s - lead_s, at_shaped_s + tail_s),
    )


def _check(recording: Recording) -> None:
    if any(not b > a for a, b in zip(recording.t_s, recording.t_s[1:], strict=False)):
        raise ValueError("the time of a recording must increase")
    for name, trace in recording.axes.items():
        sway = {} if trace.sway_deg is None else {"sway_deg": trace.sway_deg}
        lists = {"joystick": trace.joystick, "sent": trace.sent, "speed": trace.speed, **sway}
        for signal, values in lists.items():
            if len(values) != len(recording.t_s):
                raise ValueError(
                    f"{name}.{signal} has {len(values)} samples, the time base {len(recording.t_s)}"
                )
            if not all(map(math.isfinite, values)):
                raise ValueError(f"{name}.{signal} holds a value that is no finite number")


def _side(joystick: float) -> int:
    """Return 0 in neutral, else the sign of the deflection."""
    return 0 if abs(joystick) <= NEUTRAL_BAND else (1 if joystick > 0 else -1)


def _spans(joystick: list[float]) -> list[tuple[int, int]]:
    """Return the runs of samples on one side of neutral, as (first, one past the last)."""
    spans, start = [], 0
    for side, run in groupby(map(_side, joystick)):
        end = start + len([*run])
        if side:
            spans.append((start, end))
        start = end
    return spans


def _stroke(
    recording: Recording, spans: dict[str, list[tuple[int, int]]], axis: str, span: tuple[int, int]
) -> Stroke:
    joystick = recording.axes[axis].joystick
    press, end = span
    others = [other for name, own in spans.items() if name != axis for other in own]
    rest_end = min(
        [first for own in spans.values() for first, _ in own if first >= end]
        + [past for _, past in others if past > end]
        + [len(joystick)]
    )
    first, last = _plateau(recording.t_s, joystick, span)
    return Stroke(
        axis=axis,
        direction=float(_side(joystick[press])),
        press=press,
        release=end if end < len(joystick) else None,
        level=statistics.median(abs(v) for v in joystick[first : last + 1]),
        plateau=(first, last),
        alone=all(past <= press or begin >= end for begin, past in others),
        rest=range(end, rest_end),
    )


def _plateau(t_s: list[float], joystick: list[float], span: tuple[int, int]) -> tuple[int, int]:
    held = PLATEAU * max(abs(joystick[k]) for k in range(*span))
    runs: list[tuple[int, int]] = []
    for k in range(*span):
        if abs(joystick[k]) < held:
            continue
        if runs and runs[-1][1] == k - 1:
            runs[-1] = (runs[-1][0], k)
        else:
            runs.append((k, k))
    return max(runs, key=lambda run: t_s[run[1]] - t_s[run[0]])


def _first_press_s(recording: Recording) -> float | None:
    presses = [own[0].press for own in find_strokes(recording).values() if own]
    return recording.t_s[min(presses)] if presses else None


def _cut(recording: Recording, begin_s: float, end_s: float) -> Recording:
    """Return the samples from ``begin_s`` to ``end_s``, timed from ``begin_s``."""
    keep = [
        k for k, t in enumerate(recording.t_s) if begin_s - _ROUNDING_S <= t <= end_s + _ROUNDING_S
    ]
    part = slice(keep[0], keep[-1] + 1)
    axes = {
        name: AxisTrace(
            joystick=trace.joystick[part],
            sent=trace.sent[part],
            speed=trace.speed[part],
            sway_deg=None if trace.sway_deg is None else trace.sway_deg[part],
        )
        for name, trace in recording.axes.items()
    }
    crane = recording.crane
    if crane:
        crane = CraneTrace(crane.tip_m[part], crane.grapple_m[part], crane.sway_deg[part])
    return replace(
        recording, t_s=[t - begin_s for t in recording.t_s[part]], axes=axes, crane=crane
    )
