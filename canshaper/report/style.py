"""Common style of all pictures: colours, figures and panels."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.offsetbox import AnchoredOffsetbox, HPacker, TextArea

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
    """A white figure that can be drawn without a display."""
    size = (width_px / dpi, height_px / dpi)
    fig = Figure(figsize=size, dpi=dpi, facecolor="white", **options)
    FigureCanvasAgg(fig)
    return fig


def save(fig: Figure, path: Path) -> None:
    """Write a picture in the format of its suffix: PNG, SVG or PDF."""
    fig.savefig(path, dpi=fig.dpi, format=path.suffix[1:])


def stamp(fig: Figure, text: str) -> None:
    """Put where a picture comes from into its lower right corner, 8 points in print."""
    points = TEXT_PT * float(fig.get_size_inches()[0]) / (170.0 / 25.4)
    fig.text(0.996, 0.004, text, ha="right", va="bottom", fontsize=points, color="#666666")


def plain(panel: Axes, *, size: float = 10) -> None:
    """Light grid, two spines, grey ticks with figures of this size."""
    panel.grid(visible=True, which="both", color="#E6E6E6", linewidth=0.8)
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)
    panel.spines[["left", "bottom"]].set_color("#AAAAAA")
    panel.tick_params(color="#AAAAAA", labelcolor=TEXT_COLOUR, labelsize=size)


def titled(panel: Axes, text: str, size: float) -> None:
    """A bold title at the left."""
    panel.set_title(text, loc="left", fontsize=size, weight="bold", color=TEXT_COLOUR, pad=5)


def zero_line(panel: Axes) -> None:
    """A thin grey line at zero, behind the curves."""
    panel.axhline(0.0, color="#AAAAAA", linewidth=0.8, zorder=1)


def command_scale(panel: Axes, limit: float) -> None:
    """An axis of commands: -100 to 100 %, with room up to ``limit`` of full command."""
    panel.set_ylim(-limit, limit)
    panel.set_yticks([-1.0, 0.0, 1.0], [f"{MINUS}100", "0", "100"])


def coloured_words(
    fig: Figure, words: Sequence[tuple[str, str]], at: tuple[float, float], *, size: float, sep: int
) -> None:
    """A line of (text, colour), its upper left corner at a place of the figure: names curves."""
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
