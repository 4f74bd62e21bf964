"""What a drive shows of the whole crane: total swing, and how far it runs on when all is let go."""

import math
from dataclasses import dataclass

from canshaper.report.stroke_metrics import rms, run_on_s
from canshaper.report.strokes import residual_window, rests
from canshaper_sim.recording import CraneTrace, Point, Recording


@dataclass(frozen=True)
class CraneMetrics:
    """Measures of the whole crane over one drive, whatever axes were moved together.

    A rest is the time from the release of the last joystick until any is pressed.

    Attributes:
        peak_deg: largest total swing of the grapple over the whole drive, degrees.
        rms_deg: square root of the time mean of its square, degrees.
        residual_deg: largest total swing of the rests, later than ``RESIDUAL_DWELL_S`` after the
            release.
        run_on_s: from the release until every axis stays below 5 % of its full speed. The longest;
            a rest that ends before counts with the time it lasted (a lower bound).
        run_on_m: farthest that the tip gets in a rest from where it was at the release, m.

    A measure is None where the drive holds nothing it could be taken from.
    """

    peak_deg: float | None
    rms_deg: float | None
    residual_deg: float | None
    run_on_s: float | None
    run_on_m: float | None


def crane_metrics(recording: Recording, crane: CraneTrace) -> CraneMetrics:
    """Measure a drive whose crane is ``crane``.

    Raises:
        ValueError: the recording is malformed (see ``find_strokes``).
    """
    t_s, sway = recording.t_s, crane.sway_deg
    still = [rest for rest in rests(recording) if len(rest) > 1]
    windows = [window for rest in still if (window := residual_window(t_s, rest))]
    traces = recording.axes.values()
    speed = [max(abs(trace.speed[k]) for trace in traces) for k in range(len(t_s))]
    return CraneMetrics(
        peak_deg=max(sway, default=None),
        rms_deg=rms(t_s, sway),
        residual_deg=max((sway[k] for window in windows for k in window), default=None),
        run_on_s=max((run_on_s(t_s, speed, rest) for rest in still), default=None),
        run_on_m=max(
            (_farthest_m(crane.tip_m, rest) for rest in still if crane.tip_m), default=None
        ),
    )


def _farthest_m(tip_m: list[Point], rest: range) -> float:
    return max(math.dist(tip_m[rest.start], tip_m[k]) for k in rest)
