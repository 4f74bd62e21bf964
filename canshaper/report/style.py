"""Common style of all pictures: colours, figures, panels, and the crane from above."""

from collections.abc import Callable, Sequence
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import Any, Final

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.offsetbox import AnchoredOffsetbox, HPacker, TextArea
from PIL import Image

import canshaper
from canshaper.machine.deployment import Deployment
from canshaper.report import html
from canshaper_sim.recording import CraneTrace, Point

# Vermilion and blue of Okabe and Ito: distinct for colour-blind eyes too.
RAW_COLOUR: Final = "#D55E00"
SHAPED_COLOUR: Final = "#0072B2"
JOYSTICK_COLOUR: Final = "#D5D5D5"
TEXT_COLOUR: Final = "#333333"
MINUS: Final = "\N{MINUS SIGN}"
DPI: Final = 100
# A picture in print is 170 mm wide, with letters of 8 points and more; curves differ in grey.
WIDTH_PX: Final = 1600
PRINT_DPI: Final = WIDTH_PX / (170.0 / 25.4)
TEXT_PT: Final = 8.0
TITLE_PT: Final = 8.5
HEAD_PT: Final = 10.5
DASHED: Final = (0, (3.5, 1.5))


def new_figure(width_px: float, height_px: float, *, dpi: float = DPI, **options: Any) -> Figure:
    """Return a white figure that needs no display; size in pixels at this dpi."""
    size = (width_px / dpi, height_px / dpi)
    fig = Figure(figsize=size, dpi=dpi, facecolor="white", **options)
    FigureCanvasAgg(fig)
    return fig


def print_figure(height_px: float) -> Figure:
    """Return a white figure as wide as a page, of this height in pixels."""
    return new_figure(WIDTH_PX, height_px, dpi=PRINT_DPI)


def save(fig: Figure, path: Path) -> None:
    """Write a picture in the format of its suffix: PNG, SVG or PDF."""
    fig.savefig(path, dpi=fig.dpi, format=path.suffix[1:])


def stamp(fig: Figure, text: str) -> None:
    """Write the origin of a picture into its lower right corner, 8 points in print."""
    points = TEXT_PT * float(fig.get_size_inches()[0]) / (170.0 / 25.4)
    fig.text(0.996, 0.004, text, ha="right", va="bottom", fontsize=points, color="#666666")


def plain(panel: Axes, *, size: float = 10) -> None:
    """Give a panel a light grid, two spines, and grey ticks with figures of this size in points."""
    panel.grid(visible=True, which="both", color="#E6E6E6", linewidth=0.8)
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)
    panel.spines[["left", "bottom"]].set_color("#AAAAAA")
    panel.tick_params(color="#AAAAAA", labelcolor=TEXT_COLOUR, labelsize=size)


def titled(panel: Axes, text: str, size: float) -> None:
    """Give a panel a bold title at the left; size in points."""
    panel.set_title(text, loc="left", fontsize=size, weight="bold", color=TEXT_COLOUR, pad=5)


def label(panel: Axes, x: str = "", y: str = "") -> None:
    """Write the names of a panel's x and y axis; leave one alone whose name is empty."""
    for text, put in ((x, panel.set_xlabel), (y, panel.set_ylabel)):
        if text:
            put(text, fontsize=TEXT_PT, color=TEXT_COLOUR)


def headline(fig: Figure, text: str) -> None:
    """Write a bold title over all panels, at the left."""
    fig.suptitle(text, x=0.012, ha="left", fontsize=HEAD_PT, weight="bold")


def zero_line(panel: Axes) -> None:
    """Draw a thin grey line at zero, behind the curves."""
    panel.axhline(0.0, color="#AAAAAA", linewidth=0.8, zorder=1)


def command_scale(panel: Axes, limit: float) -> None:
    """Scale the y axis to +-``limit`` of full command, with ticks at -100, 0 and 100 percent."""
    panel.set_ylim(-limit, limit)
    panel.set_yticks([-1.0, 0.0, 1.0], [f"{MINUS}100", "0", "100"])


def coloured_words(
    fig: Figure, words: Sequence[tuple[str, str]], at: tuple[float, float], *, size: float, sep: int
) -> None:
    """Write a line of (text, colour) as the key to curves.

    ``at`` is its upper left corner, fractions of the figure; ``size`` and ``sep`` are points.
    """
    parts: list[Artist] = [
        TextArea(text, textprops={"color": colour, "fontsize": size, "weight": "bold"})
        for text, colour in words
    ]
    fig.add_artist(
        AnchoredOffsetbox(
            loc="upper left",
            child=HPacker(children=parts, pad=0, sep=sep, align="baseline"),
            bbox_to_anchor=at,
            bbox_transform=fig.transFigure,
            frameon=False,
            borderpad=0,
            pad=0,
        )
    )


_LEGEND_IN = 0.36  # below the lower view: under its scale
_MARGIN = 0.08  # of the drawn square, free around the paths


def draw_top_views(
    fig: Figure,
    drives: Sequence[tuple[CraneTrace, Sequence[range]]],
    box: tuple[float, float, float, float],
    *,
    sizes: tuple[float, float],
) -> None:
    """Draw the paths of tip and grapple from above in two views, raw above shaped, on one scale.

    Args:
        fig: the figure to draw into.
        drives: (crane, rests) of the raw and of the shaped drive; a rest is the samples in which no
            joystick is moved and the tip runs on.
        box: left, bottom, right and top of both views, fractions of the figure.
        sizes: sizes of letters and of titles, points.
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
    """Return (lowest, highest) x and y of a square around all points, with a margin."""
    columns = _columns(points)
    low, high = [min(c) for c in columns], [max(c) for c in columns]
    half = (0.5 + _MARGIN) * max(b - a for a, b in zip(low, high, strict=True))
    middle = [0.5 * (a + b) for a, b in zip(low, high, strict=True)]
    return (middle[0] - half, middle[0] + half), (middle[1] - half, middle[1] + half)


# All of a report are to stay below 2 MB; a drawing that takes more is a picture of dots there.
MOST_SVG_BYTES = 90_000
COLOURS = 64  # in a PNG inside a report


def draw(figure: Callable[[], Figure], path: Path, deployment: Deployment) -> list[Path]:
    """Draw, stamp and write a picture.

    Args:
        figure: returns the picture.
        path: path of the picture without its suffix.
        deployment: the machine in the picture, named in the stamp.

    Returns:
        The picture (PNG), and the drawing (SVG) if it is small.
    """
    drawn = figure()
    date = f"{datetime.now().astimezone():%Y-%m-%d}"
    stamp(drawn, f"{deployment.path.name}, canshaper {canshaper.__version__}, {date}")
    picture, drawing = (path.with_name(f"{path.name}{suffix}") for suffix in (".png", ".svg"))
    save(drawn, picture)
    save(drawn, drawing)
    if drawing.stat().st_size > MOST_SVG_BYTES:
        drawing.unlink()
        return [picture]
    return [picture, drawing]


def embedded(path: Path) -> str:
    """Return a picture as HTML for a report: an SVG as it is, a PNG with fewer colours."""
    if path.suffix == ".svg":
        return html.picture(path.read_bytes(), "svg+xml", path.stem)
    file = BytesIO()
    with Image.open(path) as dots:
        few = dots.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
        few.save(file, "png", optimize=True)
    return html.picture(file.getvalue(), "png", path.stem)
