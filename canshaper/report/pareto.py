"""The comparison of filters as a picture: time until the crane stops against residual swing."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from canshaper.report import style

LIMIT_COLOUR = "#555555"
_HEIGHT_PX = 2040
_RECT = (0.0, 0.022, 1.0, 0.978)  # part of the figure: the stamp is below
# Labels: width of a character, height of a line, and places to try next to a dot.
_CHARACTER_PX, _LINE_PX, _DOT_PX = 16.0, 30.0, 20.0
_HEIGHTS = tuple(1.1 * sign * k for k in range(10) for sign in ((1, -1) if k else (1,)))
_ASIDE_PX = tuple(float(sign * px) for px in (24, 90, 170, 260) for sign in (1, -1))


@dataclass(frozen=True)
class Point:
    """A filter: whether it is ours, time to stop, time to 95 % speed, worst residual swing."""

    name: str
    ours: bool
    stop_s: float
    rise_s: float
    worst_deg: float


@dataclass(frozen=True)
class Limits:
    """Computed limits of the filters.

    Attributes:
        curve: (time to stop in s, least worst residual in degrees) of any non-negative impulse
            response within the valve's rate, on one axis alone; at least two points, or empty.
        time_optimal_s: shortest time in which any command can stop the swing.
    """

    curve: Sequence[tuple[float, float]]
    time_optimal_s: float


def figure(points: Sequence[Point], limits: Limits, title: str) -> Figure:
    """Return the picture of at least one filter: swing over run-on, below it over rise time."""
    drawn = style.new_figure(
        style.WIDTH_PX, _HEIGHT_PX, dpi=style.PRINT_DPI, layout=ConstrainedLayoutEngine(rect=_RECT)
    )
    drawn.suptitle(title, x=0.01, ha="left", fontsize=style.HEAD_PT, fontweight="bold")
    panels = drawn.subplots(2, 1, sharey=True)
    panels[0].set_title(
        "blue dots: ours, orange squares: the others; further down and left is better",
        loc="left",
        fontsize=style.TITLE_PT,
    )
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
        axes.set_xlabel(label, fontsize=style.TEXT_PT)
        axes.set_ylabel(
            "largest residual swing at\n±30 % pendulum length, degrees", fontsize=style.TEXT_PT
        )
        style.plain(axes, size=style.TEXT_PT)
        axes.set_xlim(0.0, max(seconds) * 1.3)
        axes.set_ylim(0.5 * min(values), 1.5 * max(values))
    _limits(panels[0], limits)
    drawn.draw_without_rendering()  # the layout decides where the dots are, in pixels, for good
    drawn.set_layout_engine("none")
    _points(panels[0], points, [p.stop_s for p in points])
    _points(panels[1], points, [p.rise_s for p in points])
    return drawn


def _limits(axes: Axes, limits: Limits) -> None:
    """Draw the computed limits as lines with their names."""
    if limits.curve:
        x, y = zip(*limits.curve, strict=True)
        axes.plot(x, y, color=LIMIT_COLOUR, linestyle="--", linewidth=1.2)
        axes.annotate(
            "limit of every shaper\nwithin the valve's rate,\nnear-far alone",
            (x[1], y[1]),
            xytext=(6, 0),
            textcoords="offset points",
            va="bottom",
            ha="left",
            color=LIMIT_COLOUR,
            fontsize=style.TEXT_PT,
        )
    axes.axvline(limits.time_optimal_s, color=LIMIT_COLOUR, linestyle=":", linewidth=1.2)
    axes.annotate(
        "time-optimal limit",
        (limits.time_optimal_s, 0.0),
        xycoords=("data", "axes fraction"),
        xytext=(-4, 4),
        textcoords="offset points",
        va="bottom",
        ha="right",
        rotation=90,
        color=LIMIT_COLOUR,
        fontsize=style.TEXT_PT,
    )


def _points(axes: Axes, points: Sequence[Point], seconds: Sequence[float]) -> None:
    """Draw dots with names; where there is room, names and lines to dots cover nothing else."""
    spots = [(s, p.worst_deg) for s, p in zip(seconds, points, strict=True)]
    places = [tuple(axes.transData.transform(spot)) for spot in spots]
    half = 0.5 * _DOT_PX
    dots = [Bbox.from_bounds(x - half, y - half, _DOT_PX, _DOT_PX) for x, y in places]
    names = [text.get_window_extent() for text in axes.texts]
    lines: list[Bbox] = []

    def room(i: int) -> float:
        return sum(min(math.dist(places[i], one), 400.0) for one in places)

    for i in sorted(range(len(points)), key=room):  # the most crowded first
        point, (x, y) = points[i], places[i]
        colour, marker = (style.SHAPED_COLOUR, "o") if point.ours else (style.RAW_COLOUR, "s")
        axes.plot(*spots[i], marker, color=colour, markersize=4.5)
        others = [*names, *dots[:i], *dots[i + 1 :]]
        tries = [_Try(x, y, dx, h * _LINE_PX, point.name) for h in _HEIGHTS for dx in _ASIDE_PX]
        tries.sort(key=lambda one: len(one.line) and math.hypot(one.dx, one.dy))
        covered = [*others, dots[i]]
        # Without enough room two lines may cross.
        free = [one for one in tries if one.is_free(covered, others, lines)]
        best = (one for one in free if one.is_free(covered, lines, lines))
        chosen = next(best, (free or tries)[0])
        names.append(chosen.box)
        lines += chosen.line
        axes.annotate(
            point.name,
            spots[i],
            xytext=(chosen.dx, chosen.dy),
            textcoords="offset pixels",
            ha="left" if chosen.dx > 0 else "right",
            va="center",
            color=colour,
            fontsize=style.TEXT_PT,
            arrowprops=_line(colour, chosen.dx) if chosen.line else None,
        )


def _line(colour: str, dx: float) -> dict[str, object]:
    """Return the style of a line from the near end of a name to its dot."""
    near = (0.0 if dx > 0 else 1.0, 0.5)
    return {"arrowstyle": "-", "color": colour, "linewidth": 0.6, "shrinkA": 0, "relpos": near}


class _Try:
    """A possible place of a name: its box, and the pieces of its line to a dot that is far."""

    def __init__(self, x: float, y: float, dx: float, dy: float, name: str) -> None:
        self.dx, self.dy = dx, dy
        width = _CHARACTER_PX * len(name)
        left = x + (dx if dx > 0 else dx - width)
        self.box = Bbox.from_bounds(left, y + dy - 0.5 * _LINE_PX, width, _LINE_PX)
        far = abs(dy) > 1.2 * _LINE_PX or abs(dx) > 1.2 * _LINE_PX
        parts = range(1, 20) if far else ()
        self.line = [Bbox.from_bounds(x + dx * k / 20, y + dy * k / 20, 3.0, 3.0) for k in parts]

    def is_free(self, used: list[Bbox], others: list[Bbox], lines: list[Bbox]) -> bool:
        """Return whether the name is clear of ``used`` and ``lines``, its line of ``others``."""
        if any(self.box.overlaps(one) for one in (*used, *lines)):
            return False
        return not any(piece.overlaps(one) for piece in self.line for one in others)
