"""A raw and a shaped drive seen from above: paths of tip and grapple, and how the tip runs on."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from canshaper.report.style import (
    JOYSTICK_COLOUR,
    RAW_COLOUR,
    SHAPED_COLOUR,
    TEXT_COLOUR,
    plain,
    titled,
)
from canshaper_sim.recording import CraneTrace, Point

_LEGEND_IN = 0.36  # below the lower view: under its scale
_MARGIN = 0.08  # of the drawn square, free around the paths


def draw_top_views(
    fig: Figure,
    drives: Sequence[tuple[CraneTrace, Sequence[range]]],
    box: tuple[float, float, float, float],
    *,
    sizes: tuple[float, float],
) -> None:
    """Draw two views, raw above shaped, on one scale.

    Args:
        fig: where.
        drives: of raw and shaped the crane, and the rests: samples in which no joystick is moved
            and the tip runs on.
        box: left, bottom, right and top, fractions of the figure.
        sizes: of letters and of titles, points.
    """
    left, bottom, right, top = box
    grid = fig.add_gridspec(2, 1, left=left, bottom=bottom, right=right, top=top, hspace=0.24)
    span = _square([p for crane, _ in drives for p in (*crane.tip_m, *crane.grapple_m)])
    looks = (("filters off", RAW_COLOUR), ("filters on", SHAPED_COLOUR))
    for row, ((crane, rests), (words, colour)) in enumerate(zip(drives, looks, strict=True)):
        panel = fig.add_subplot(grid[row])
        titled(panel, f"From above, {words}", sizes[1])
        plain(panel, size=sizes[0])
        _draw(panel, crane, rests, colour)
        panel.set_aspect("equal", adjustable="box")
        panel.set(xlim=span[0], ylim=span[1])
    panel.set_xlabel("m from the pillar", fontsize=sizes[0], color=TEXT_COLOUR)
    fig.legend(
        *panel.get_legend_handles_labels(),
        loc="upper right",
        bbox_to_anchor=(right + 0.01, bottom - _LEGEND_IN / fig.get_figheight()),
        ncols=3,
        frameon=False,
        fontsize=sizes[0],
        handlelength=1.4,
        handletextpad=0.5,
        columnspacing=1.0,
    )


def _draw(panel: Axes, crane: CraneTrace, rests: Sequence[range], colour: str) -> None:
    for number, rest in enumerate(rests):
        label = "tip runs on" if number == 0 else None
        part = [crane.tip_m[k] for k in rest]
        panel.plot(*_columns(part), color=JOYSTICK_COLOUR, linewidth=5.0, zorder=1.5, label=label)
    panel.plot(*_columns(crane.tip_m), color=TEXT_COLOUR, linewidth=0.8, label="tip")
    panel.plot(*_columns(crane.grapple_m), color=colour, linewidth=1.4, label="grapple")


def _columns(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    return [x for x, _ in points], [y for _, y in points]


def _square(points: Sequence[Point]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Limits of x and y of a square that holds all points."""
    columns = _columns(points)
    low, high = [min(c) for c in columns], [max(c) for c in columns]
    half = (0.5 + _MARGIN) * max(b - a for a, b in zip(low, high, strict=True))
    middle = [0.5 * (a + b) for a, b in zip(low, high, strict=True)]
    return (middle[0] - half, middle[0] + half), (middle[1] - half, middle[1] + half)
