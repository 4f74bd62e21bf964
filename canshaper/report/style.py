"""What all pictures share: colours and panels."""

from collections.abc import Sequence
from typing import Final

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.offsetbox import AnchoredOffsetbox, HPacker, TextArea

# Vermilion and blue of Okabe and Ito: told apart by colour-blind eyes too.
RAW_COLOUR: Final = "#D55E00"
SHAPED_COLOUR: Final = "#0072B2"
STICK_COLOUR: Final = "#D5D5D5"
TEXT_COLOUR: Final = "#333333"
MINUS: Final = "\N{MINUS SIGN}"


def plain(panel: Axes) -> None:
    """Light grid, two spines, grey ticks."""
    panel.grid(visible=True, which="both", color="#E6E6E6", linewidth=0.8)
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)
    panel.spines[["left", "bottom"]].set_color("#AAAAAA")
    panel.tick_params(color="#AAAAAA", labelcolor=TEXT_COLOUR, labelsize=10)


def coloured_words(
    fig: Figure, words: Sequence[tuple[str, str]], at: tuple[float, float], *, size: int, sep: int
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
