"""The comparison of filters as a picture: how soon the crane stops against what swing is left."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

OURS_COLOUR = "#0072B2"  # Okabe-Ito blue and vermilion: told apart by colour-blind eyes too
OTHERS_COLOUR = "#D55E00"
LIMIT_COLOUR = "#666666"
_SIZE_IN = (15.0, 9.0)


@dataclass(frozen=True)
class Point:
    """A filter: seconds to stop after release, and degrees left in the worst case."""

    name: str
    ours: bool
    stop_s: float
    worst_deg: float


@dataclass(frozen=True)
class Limits:
    """Computed limits.

    Attributes:
        curve: (stop in s, least worst residual in degrees) of any non-negative impulse response
            within the valve's rate.
        time_optimal_s: no command whatever stops the swing sooner.
    """

    curve: Sequence[tuple[float, float]]
    time_optimal_s: float


def draw(points: Sequence[Point], limits: Limits, title: str, path: Path) -> None:
    """Write the picture."""
    drawn = figure(points, limits, title)
    FigureCanvasAgg(drawn)
    drawn.savefig(path)


def figure(points: Sequence[Point], limits: Limits, title: str) -> Figure:
    """The picture as a figure; direct labels, swing on a logarithmic axis."""
    drawn = Figure(figsize=_SIZE_IN, dpi=100, layout="constrained")
    axes = drawn.add_subplot()
    drawn.suptitle(title, x=0.01, ha="left", fontsize=17, fontweight="bold")
    axes.set_title(
        "blue: ours, orange: the others; further down and left is better", loc="left", fontsize=12
    )
    axes.set_yscale("log")
    axes.set_xlabel("run-on of the tip after release, s", fontsize=12)
    axes.set_ylabel("largest residual swing at ±30 % pendulum length, degrees", fontsize=12)
    axes.grid(True, which="both", color="#E5E5E5", linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    if limits.curve:
        x, y = zip(*limits.curve, strict=True)
        axes.plot(x, y, color=LIMIT_COLOUR, linestyle="--", linewidth=1.2)
        axes.annotate(
            "limit of every shaper\nthat is never clipped",
            (x[-1], y[-1]),
            xytext=(6, 0),
            textcoords="offset points",
            va="center",
            color=LIMIT_COLOUR,
            fontsize=11,
        )
    axes.axvline(limits.time_optimal_s, color=LIMIT_COLOUR, linestyle=":", linewidth=1.2)
    axes.annotate(
        "time-optimal limit",
        (limits.time_optimal_s, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(4, -4),
        textcoords="offset points",
        va="top",
        rotation=90,
        color=LIMIT_COLOUR,
        fontsize=11,
    )
    _points(axes, points)
    axes.set_xlim(0.0, max(p.stop_s for p in points) * 1.18)
    return drawn


def _points(axes: "object", points: Sequence[Point]) -> None:
    """Dots with names; names that would cover each other are moved up or down."""
    placed: list[tuple[float, float]] = []
    low = min(p.worst_deg for p in points)
    span = max(p.worst_deg for p in points) / low
    for point in sorted(points, key=lambda p: (p.stop_s, p.worst_deg)):
        colour = OURS_COLOUR if point.ours else OTHERS_COLOUR
        axes.plot([point.stop_s], [point.worst_deg], "o", color=colour, markersize=9)  # type: ignore[attr-defined]
        shift = 0
        for x, y in placed:
            near_x = abs(point.stop_s - x) < 0.35
            near_y = abs((point.worst_deg / y) - 1.0) < 0.035 * span**0.35
            if near_x and near_y:
                shift = 13 if point.worst_deg >= y else -13
        placed.append((point.stop_s, point.worst_deg))
        axes.annotate(  # type: ignore[attr-defined]
            point.name,
            (point.stop_s, point.worst_deg),
            xytext=(8, shift),
            textcoords="offset points",
            va="center",
            color=colour,
            fontsize=11,
        )
