"""Measures of a pair of drives: swing, speed of response and feel of each axis, raw and shaped."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from canshaper.report.stroke_metrics import (
    STILL_DEG,
    crane_metrics,
    dip,
    re_rise,
    rms,
    run_on_s,
    run_on_travel,
    still_after,
    time_to_95_s,
)
from canshaper.report.strokes import (
    RESIDUAL_DWELL_S,
    Stroke,
    aligned,
    find_strokes,
    residual_windows,
)
from canshaper_sim.recording import Recording

__all__ = [
    "RESIDUAL_DWELL_S",
    "AxisComparison",
    "AxisMetrics",
    "axis_metrics",
    "compare",
    "report_dict",
]

MIN_RAW_DEG = 0.05  # five steps of the sway signal: a reduction of less is a quotient of noise

HORIZONTAL_DEG = 90.0
_DIGITS = {"_deg": 2, "_s": 2, "_pct": 1}  # resolution of the sway frame, of the sampling, of both
# Fractions of full command and speed, where a step of the command frame is 0.004; metres.
_DIGITS_FRACTION = 3


@dataclass(frozen=True)
class AxisMetrics:
    """Measures of one axis over one drive; ``Stroke`` defines press, plateau, release, rest.

    Attributes:
        still_s: from the release until |sway| in the plane of the axis stays below the bound of a
            still grapple. Largest over the strokes of this axis alone; of their lower bounds, if
            there are any.
        swings_on: ``still_s`` is a lower bound: the rest ended with more swing, or too soon after.
        peak_deg: largest |sway| in the plane of the axis over the whole drive, degrees.
        rms_deg: square root of the time mean of sway^2 over the whole drive (trapezoids, so a
            lost sample gets no extra weight), degrees.
        residual_deg: largest |sway| later than ``dwell_s`` after the release of the axis,
            until any joystick is moved; only after strokes during which no other axis was moved.
            Swing left from before the press counts too.
        cross_residual_deg: largest |sway| of the other planes in the same windows, degrees.
        time_to_95_s: time from the press until the tip speed reaches 95 % of the demanded speed,
            while the joystick is held at its plateau. If the speed falls below 90 % again while
            held, the last time counts. Longest over the strokes that reach 95 %.
        run_on_s: time from the release until the tip speed stays below 5 % of full speed for the
            rest. Longest over the strokes of this axis alone; a rest that ends earlier counts with
            its length (a lower bound).
        run_on_travel: integral of the speed in the direction of the stroke from the release to the
            end of the rest, full speed x s. Largest over the strokes of this axis alone.
        dip: largest fall of the sent command below its running maximum since the press, while the
            joystick is held at its plateau, less the fall of the joystick itself; fraction of full
            command.
        re_rise: largest rise of |sent| above its running minimum since the release, within the
            rest, fraction of full command.

    A measure is None if the drive has no stroke or signal to take it from.
    """

    still_s: float | None
    swings_on: bool | None
    peak_deg: float | None
    rms_deg: float | None
    residual_deg: float | None
    cross_residual_deg: float | None
    time_to_95_s: float | None
    run_on_s: float | None
    run_on_travel: float | None
    dip: float | None
    re_rise: float | None


@dataclass(frozen=True)
class AxisComparison:
    """Measures of one axis in both drives; reductions are 100 (1 - shaped / raw) percent.

    A reduction is None without both measures, for a raw one below ``MIN_RAW_DEG``, and for a raw
    drive that swings above the horizontal; it is negative if shaping made the swing larger.
    """

    raw: AxisMetrics
    shaped: AxisMetrics
    peak_reduction_pct: float | None
    rms_reduction_pct: float | None
    residual_reduction_pct: float | None
    cross_residual_reduction_pct: float | None


def axis_metrics(recording: Recording, axis: str, still_deg: float = STILL_DEG) -> AxisMetrics:
    """Measure one axis of a drive; a grapple that swings less than ``still_deg`` counts as still.

    Raises:
        KeyError: the drive has no such axis.
        ValueError: the recording is malformed (see ``find_strokes``).
    """
    return _measure(recording, find_strokes(recording)[axis], axis, still_deg)


def compare(raw: Recording, shaped: Recording) -> dict[str, AxisComparison]:
    """Measure both drives of one operator script, axis by axis, over their common time span.

    Raises:
        ValueError: the drives have different axes, no samples, or are malformed.
    """
    return _compare(*aligned(raw, shaped), STILL_DEG)


def report_dict(
    raw: Recording,
    shaped: Recording,
    *,
    transport: str,
    missed_deadlines: int | None,
    still_deg: float = STILL_DEG,
    facts: Mapping[str, object] | None = None,
) -> dict[str, Any]:
    """Return the comparison as a dictionary ready for JSON.

    ``crane`` (None if a drive has none) and each axis, under ``axes``, have the reductions, and
    all measures of both drives under ``raw`` and ``shaped``; each axis also has ``time_to_95_s``
    and ``run_on_s`` of the shaped drive. Degrees and seconds are rounded to 0.01, percent to 0.1,
    metres and fractions to 0.001. A value that is missing or not finite is None.

    Args:
        raw: drive with the filters off.
        shaped: the same operator script with the filters on.
        transport: the bus of the drives.
        missed_deadlines: number of late ticks of the control loop; None if not counted.
        still_deg: swing below which a grapple counts as still.
        facts: further entries for the top of the report (JSON types).

    Raises:
        ValueError: as for ``compare``, or a fact has the name of an entry of the report.
    """
    raw, shaped = aligned(raw, shaped)
    report: dict[str, Any] = {
        "transport": transport,
        "missed_deadlines": missed_deadlines,
        "duration_s": round(min(raw.t_s[-1], shaped.t_s[-1]), 2),
        "still_deg": still_deg,
        "crane": _crane_dict(raw, shaped, still_deg),
        "axes": {n: _axis_dict(axis) for n, axis in _compare(raw, shaped, still_deg).items()},
    }
    repeated = report.keys() & (facts or {}).keys()
    if repeated:
        raise ValueError(f"facts may not replace {sorted(repeated)} of the report")
    return report | {name: _finite(fact) for name, fact in (facts or {}).items()}


def _compare(raw: Recording, shaped: Recording, still_deg: float) -> dict[str, AxisComparison]:
    raw_strokes, shaped_strokes = find_strokes(raw), find_strokes(shaped)
    comparison, reduced = {}, _reduction_of(raw)
    for axis in raw.axes:
        off = _measure(raw, raw_strokes[axis], axis, still_deg)
        on = _measure(shaped, shaped_strokes[axis], axis, still_deg)
        comparison[axis] = AxisComparison(
            raw=off,
            shaped=on,
            peak_reduction_pct=reduced(off.peak_deg, on.peak_deg),
            rms_reduction_pct=reduced(off.rms_deg, on.rms_deg),
            residual_reduction_pct=reduced(off.residual_deg, on.residual_deg),
            cross_residual_reduction_pct=reduced(off.cross_residual_deg, on.cross_residual_deg),
        )
    return comparison


def _measure(
    recording: Recording, strokes: list[Stroke], axis: str, still_deg: float
) -> AxisMetrics:
    t_s, trace = recording.t_s, recording.axes[axis]
    sway = trace.sway_deg
    windows = residual_windows(recording, strokes)
    # Joints that swing the grapple in one plane share their sway: that is no other plane.
    crossing = [
        other.sway_deg
        for other in recording.axes.values()
        if sway is not None and other.sway_deg is not None and other.sway_deg != sway
    ]
    rests = [stroke for stroke in strokes if len(stroke.rest) > 1]
    alone = [stroke for stroke in rests if stroke.alone]
    swinging = [] if sway is None else [stroke.rest for stroke in alone]
    still_s, swings_on = still_after(t_s, sway or [], swinging, still_deg)
    return AxisMetrics(
        still_s,
        swings_on,
        peak_deg=None if sway is None else _largest(map(abs, sway)),
        rms_deg=None if sway is None else rms(t_s, sway),
        residual_deg=None
        if sway is None
        else _largest(abs(sway[k]) for window in windows for k in window),
        cross_residual_deg=_largest(
            abs(other[k]) for other in crossing for window in windows for k in window
        ),
        time_to_95_s=_largest(time_to_95_s(t_s, trace, stroke) for stroke in strokes),
        run_on_s=_largest(run_on_s(t_s, trace.speed, stroke.rest) for stroke in alone),
        run_on_travel=_largest(run_on_travel(t_s, trace, stroke) for stroke in alone),
        dip=_largest(dip(trace, stroke) for stroke in strokes),
        re_rise=_largest(re_rise(trace, stroke) for stroke in rests),
    )


def _largest(values: Iterable[float | None]) -> float | None:
    return max((value for value in values if value is not None), default=None)


def swings_over(recording: Recording) -> bool:
    """Return whether the grapple swings beyond 90 degrees, where a real one falls over."""
    if recording.crane:
        return (crane_metrics(recording, recording.crane).peak_deg or 0.0) > HORIZONTAL_DEG
    swings = (sway for trace in recording.axes.values() for sway in trace.sway_deg or ())
    return any(abs(sway) > HORIZONTAL_DEG for sway in swings)


def _reduction_of(raw: Recording) -> Callable[[float | None, float | None], float | None]:
    """Return a function of two measures to the reduction, %; always None if ``raw`` swings over."""
    return (lambda _raw, _shaped: None) if swings_over(raw) else _reduction_pct


def _reduction_pct(raw: float | None, shaped: float | None) -> float | None:
    if raw is None or shaped is None or raw < MIN_RAW_DEG:
        return None
    return 100.0 * (1.0 - shaped / raw)


def _crane_dict(raw: Recording, shaped: Recording, still_deg: float) -> dict[str, Any] | None:
    if raw.crane is None or shaped.crane is None:
        return None
    off, on = (
        asdict(crane_metrics(recording, crane, still_deg))
        for recording, crane in ((raw, raw.crane), (shaped, shaped.crane))
    )
    reductions = {
        f"{name}_reduction_pct": _reduction_of(raw)(off[f"{name}_deg"], on[f"{name}_deg"])
        for name in ("peak", "rms", "residual")
    }
    return {**_rounded(reductions), "raw": _rounded(off), "shaped": _rounded(on)}


def _axis_dict(axis: AxisComparison) -> dict[str, Any]:
    raw, shaped = _rounded(asdict(axis.raw)), _rounded(asdict(axis.shaped))
    reductions = {name: value for name, value in vars(axis).items() if name.endswith("_pct")}
    return {
        **_rounded(reductions),
        "time_to_95_s": shaped["time_to_95_s"],
        "run_on_s": shaped["run_on_s"],
        "raw": raw,
        "shaped": shaped,
    }


def _rounded(values: Mapping[str, float | None]) -> dict[str, float | None]:
    return {name: _round(name, value) for name, value in values.items()}


def _round(name: str, value: float | None) -> float | None:
    if isinstance(value, bool):
        return value
    if value is None or not math.isfinite(value):
        return None
    digits = next((d for unit, d in _DIGITS.items() if name.endswith(unit)), _DIGITS_FRACTION)
    return round(value, digits) + 0.0  # turns -0.0 into 0.0


def _finite(fact: object) -> object:
    """Return the fact with numbers that JSON cannot carry replaced by None."""
    if isinstance(fact, float):
        return fact if math.isfinite(fact) else None
    if isinstance(fact, Mapping):
        return {str(name): _finite(value) for name, value in fact.items()}
    if isinstance(fact, list | tuple):
        return [_finite(value) for value in fact]
    return fact
