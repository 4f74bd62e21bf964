"""The comparison of filters as a picture: how soon the crane stops against what swing is left."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from canshaper.report.style import RAW_COLOUR, SHAPED_COLOUR, new_figure, plain, save

LIMIT_COLOUR = "#666666"
_SIZE_PX = (2000, 950)
# Of the labels, at 100 dots per inch: width of a character, and heights to try next to a dot.
_CHARACTER_PX = 8.5
_OFFSETS_PX = (0.0, 18.0, -18.0, 38.0, -38.0, 58.0, -58.0, 80.0, -80.0, 104.0, -104.0)


@dataclass(frozen=True)
class Point:
    """A filter: seconds to stop after release, seconds to 95 % speed, degrees left at worst."""

    name: str
    ours: bool
    stop_s: float
    rise_s: float
    worst_deg: float


@dataclass(frozen=True)
class Limits:
    """Computed limits.

    Attributes:
        curve: (stop in s, least worst residual in degrees) of any non-negative impulse response
            within the valve's rate, on an axis by itself.
        time_optimal_s: no command whatever stops the swing sooner.
    """

    curve: Sequence[tuple[float, float]]
    time_optimal_s: float


def draw(points: Sequence[Point], limits: Limits, title: str, path: Path) -> None:
    """Write the picture."""
    drawn = figure(points, limits, title)
    save(drawn, path)


def figure(points: Sequence[Point], limits: Limits, title: str) -> Figure:
    """The picture as a figure: run-on at the left, rise at the right; direct labels."""
    drawn = new_figure(*_SIZE_PX, layout="constrained")
    drawn.suptitle(title, x=0.01, ha="left", fontsize=17, fontweight="bold")
    panels = drawn.subplots(1, 2, sharey=True)
    panels[0].set_title(
        "blue: ours, orange: the others; further down and left is better", loc="left", fontsize=12
    )
    panels[0].set_ylabel("largest residual swing at ±30 % pendulum length, degrees", fontsize=12)
    values = [p.worst_deg for p in points]
    for axes, label, seconds in (
        (panels[0], "run-on of the tip after release, s", [p.stop_s for p in points]),
        (
            panels[1],
            "time to 95 % of the commanded speed after the press, s",
            [p.rise_s for p in points],
        ),
    ):
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel(label, fontsize=12)
        plain(axes)
        axes.set_xlim(0.0, max(seconds) * 1.3)
        axes.set_ylim(0.5 * min(values), 1.5 * max(values))
    _limits(panels[0], limits)
    drawn.draw_without_rendering()  # the layout decides where the dots are, in pixels
    _points(panels[0], points, [p.stop_s for p in points])
    _points(panels[1], points, [p.rise_s for p in points])
    return drawn


def _limits(axes: Axes, limits: Limits) -> None:
    """The computed limits as lines with their names."""
    if limits.curve:
        x, y = zip(*limits.curve, strict=True)
        axes.plot(x, y, color=LIMIT_COLOUR, linestyle="--", linewidth=1.2)
        axes.annotate(
            "limit of every shaper\nwithin the valve's rate,\nnear-far alone",
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
        xytext=(-4, -4),
        textcoords="offset points",
        va="top",
        ha="right",
        rotation=90,
        color=LIMIT_COLOUR,
        fontsize=11,
    )


def _points(axes: Axes, points: Sequence[Point], seconds: Sequence[float]) -> None:
    """Dots with names; a name goes where it covers neither a dot nor another name."""
    spots_s = [(s, p.worst_deg) for s, p in zip(seconds, points, strict=True)]
    places = [tuple(axes.transData.transform(spot)) for spot in spots_s]
    taken = [Bbox.from_bounds(x - 7, y - 7, 14, 14) for x, y in places]
    order = sorted(range(len(points)), key=lambda i: places[i])
    for point, spot, (x, y) in ((points[i], spots_s[i], places[i]) for i in order):
        colour = SHAPED_COLOUR if point.ours else RAW_COLOUR
        axes.plot(*spot, "o", color=colour, markersize=9)
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
            spot,
            xytext=(dx, dy),
            textcoords="offset pixels",
            va="center",
            color=colour,
            fontsize=11,
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.6} if far else None,
        )
