"""Colours, panels and coloured headlines shared by the pictures of the paper's figures."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from canshaper.report.console import change_text
from canshaper.report.style import (
    JOYSTICK_COLOUR,
    MINUS,
    RAW_COLOUR,
    SHAPED_COLOUR,
    TEXT_COLOUR,
    coloured_words,
    plain,
)

__all__ = ["JOYSTICK_COLOUR", "MINUS", "NONE_COLOUR", "PLANT_COLOUR", "TEXT_COLOUR", "plain"]

# No filter: grey. The two plants: vermilion and blue of Okabe and Ito, as in `report.style`.
NONE_COLOUR = "#8C8C8C"
PLANT_COLOUR = {"linear": RAW_COLOUR, "real": SHAPED_COLOUR}
PLANT_WORDS = {"linear": "Eq. 13 on a linear valve", "real": "canshaper on a real valve"}
SIZE_PX = (1600, 1000)
LEFT, RIGHT = 0.055, 0.985
Words = Sequence[tuple[str, str]]


def headline(fig: Figure, text: str) -> None:
    """The finding, at the top."""
    fig.suptitle(
        text, x=LEFT, y=0.985, ha="left", va="top", fontsize=17, weight="bold", color=TEXT_COLOUR
    )


def key(fig: Figure, words: Words, y: float = 0.935) -> None:
    """A line of words in the colours of the curves they name."""
    coloured_words(fig, words, (LEFT, y), size=13, sep=14)


def footnote(fig: Figure, text: str) -> None:
    """Conditions that the reader must know, small, at the bottom."""
    fig.text(LEFT, 0.012, text, fontsize=10, color="#666666", ha="left", va="bottom")


def change(reduction_pct: float | None) -> str:
    """A reduction as a change with its sign: 63.4 reads "−63 %"."""
    if reduction_pct is None:
        return "-"
    return change_text(reduction_pct).replace("-", MINUS)


def poles(pair: tuple[float, float], digits: int = 2) -> str:
    """Two poles, rad/s: "−2.34, −3.56", whole numbers without digits."""
    whole = all(p == round(p) for p in pair)
    return ", ".join(f"{p:.{0 if whole else digits}f}" for p in pair).replace("-", MINUS)
