"""The comparison of filters as a picture: how soon the crane stops against what swing is left."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

OURS_COLOUR = "#0072B2"  # Okabe-Ito blue and vermilion: told apart by colour-blind eyes too
OTHERS_COLOUR = "#D55E00"
LIMIT_COLOUR = "#666666"
_SIZE_IN = (15.0, 9.0)
# Of the labels, at 100 dots per inch: width of a character, and heights to try beside a dot.
_CHARACTER_PX = 8.5
_OFFSETS_PX = (0.0, 18.0, -18.0, 38.0, -38.0, 58.0, -58.0, 80.0, -80.0, 104.0, -104.0)


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
            "limit of every shaper\nwithin the valve's rate",
            (x[3], y[3]),
            xytext=(-8, -6),
            textcoords="offset points",
            va="top",
            ha="right",
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
    axes.set_xlim(0.0, max(p.stop_s for p in points) * 1.18)
    values = [p.worst_deg for p in points]
    axes.set_ylim(0.5 * min(values), 1.5 * max(values))
    FigureCanvasAgg(drawn)
    drawn.draw_without_rendering()  # the layout decides where the dots are, in pixels
    _points(axes, points)
    return drawn


def _points(axes: Axes, points: Sequence[Point]) -> None:
    """Dots with names; a name goes where it covers neither a dot nor another name."""
    places = [tuple(axes.transData.transform((p.stop_s, p.worst_deg))) for p in points]
    taken = [Bbox.from_bounds(x - 7, y - 7, 14, 14) for x, y in places]
    for point, (x, y) in sorted(zip(points, places, strict=True), key=lambda pair: pair[1]):
        colour = OURS_COLOUR if point.ours else OTHERS_COLOUR
        axes.plot([point.stop_s], [point.worst_deg], "o", color=colour, markersize=9)
        width = _CHARACTER_PX * len(point.name)
        spots = [
            (dx if dx > 0 else dx - width, dy) for dy in _OFFSETS_PX for dx in (11.0, -11.0, 34.0)
        ]
        boxes = [Bbox.from_bounds(x + dx, y + dy - 8, width, 16) for dx, dy in spots]
        free = (i for i, box in enumerate(boxes) if not any(box.overlaps(t) for t in taken))
        chosen = next(free, 0)
        taken.append(boxes[chosen])
        dx, dy = spots[chosen]
        far = abs(dy) > 20 or dx > 20
        axes.annotate(
            point.name,
            (point.stop_s, point.worst_deg),
            xytext=(dx, dy),
            textcoords="offset pixels",
            va="center",
            color=colour,
            fontsize=11,
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.6} if far else None,
        )
