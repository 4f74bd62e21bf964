"""What all pictures share: colours and panels."""

from typing import Final

from matplotlib.axes import Axes

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
