"""The picture of a robust shaper: impulse response, step response, residual over the length."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from canshaper.design.tuning.evaluate import Evaluation, Machine, ShaperFor, evaluate, step_response
from canshaper.report.console import axis_title
from canshaper.report.style import (
    DASHED,
    HEAD_PT,
    MINUS,
    PRINT_DPI,
    RAW_COLOUR,
    SHAPED_COLOUR,
    TEXT_COLOUR,
    TEXT_PT,
    TITLE_PT,
    WIDTH_PX,
    new_figure,
    plain,
    titled,
)
from canshaper.shaping.sway import SwayMode

_HEIGHT_PX = 1500
LENGTHS_PCT = tuple(range(-30, 31, 5))


@dataclass(frozen=True)
class Candidate:
    """A filter in the picture: its name, and the function that makes it on a sway model."""

    name: str
    shaper_for: ShaperFor


class _Look(NamedTuple):
    colour: str
    style: Any
    width: float


_LOOKS = (_Look(SHAPED_COLOUR, "solid", 1.8), _Look(RAW_COLOUR, DASHED, 1.2))


def figure(
    axis: str,
    mode: SwayMode,
    tick_s: float,
    *,
    machine: Machine,
    filters: Sequence[Candidate],
    range_pct: float,
) -> Figure:
    """Return the picture: impulse response, step response, and residual over the length error.

    Args:
        tick_s: period of the axis, s.
        machine: limits and valve behind the filter.
        filters: the new filter, and that of the file if there is one.
        range_pct: length error that the new filter is made for, +- percent.
    """
    steps = [step_response(mode, tick_s, one.shaper_for) for one in filters]
    measured = [evaluate(mode, tick_s, f.shaper_for, machine, LENGTHS_PCT) for f in filters]
    fig = new_figure(WIDTH_PX, _HEIGHT_PX, dpi=PRINT_DPI)
    title = f"{axis_title(axis)}: at most {100.0 * measured[0].worst(range_pct):.1f} % of the swing"
    title += f" is left within ±{range_pct:g} % length, through limits and valve"
    fig.suptitle(title, x=0.012, ha="left", fontsize=HEAD_PT, weight="bold")
    grid = fig.add_gridspec(
        2, 2, left=0.085, right=0.985, top=0.885, bottom=0.1, hspace=0.36, wspace=0.22
    )
    impulse, step = fig.add_subplot(grid[0, 0]), fig.add_subplot(grid[0, 1])
    length = fig.add_subplot(grid[1, :])
    for panel, text in (
        (impulse, "Impulse response, % each tick"),
        (step, "After a full press, % of full speed"),
        (length, "Swing left through limits and valve, % of that without filter"),
    ):
        plain(panel, size=TEXT_PT)
        titled(panel, text, TITLE_PT)
    end_s = 1.15 * max(tick_s * _ends(response) for response in steps)
    for response, look in zip(steps, _LOOKS, strict=False):
        count = math.ceil(end_s / tick_s)
        held = [0.0, *response[:count], *[response[-1]] * (count - len(response))]
        taps = [100.0 * (b - a) for a, b in pairwise(held)]
        for panel, values in ((impulse, taps), (step, [100.0 * value for value in held[1:]])):
            time_s = [k * tick_s for k in range(len(values))]
            _plot(panel, time_s, values, look, drawstyle="steps-post")
    largest = 100.0 * max(b - a for a, b in pairwise([0.0, *steps[0]]))
    lowest = 100.0 * min(0.0, *(b - a for one in steps for a, b in pairwise([0.0, *one])))
    # A jump of the other filter may leave it.
    impulse.set_ylim(max(1.1 * lowest, -0.8 * largest), 1.3 * largest)
    step.set_ylim(bottom=min(0.0, *map(min, steps)))
    for panel in (impulse, step):
        panel.set_xlim(0.0, end_s)
        panel.set_xlabel("time, s", fontsize=TEXT_PT, color=TEXT_COLOUR)
    _draw_length(length, filters, measured, range_pct)
    return fig


def _ends(response: Sequence[float]) -> int:
    """Return the number of ticks until the response stays at its final value, and one more."""
    last = [k for k, value in enumerate(response) if abs(value - response[-1]) > 1e-3]
    return (last[-1] if last else 0) + 2


def _plot(panel: Axes, x: Sequence[float], y: Sequence[float], look: _Look, **options: Any) -> None:
    panel.plot(x, y, color=look.colour, linestyle=look.style, linewidth=look.width, **options)


def _draw_length(
    panel: Axes,
    filters: Sequence[Candidate],
    measured: Sequence[Evaluation],
    range_pct: float,
) -> None:
    panel.axvspan(-range_pct, range_pct, color="#EFEFEF", linewidth=0, zorder=0)
    for one, evaluation, look in zip(filters, measured, _LOOKS, strict=False):
        left = [100.0 * r.machine for r in evaluation.residuals]
        label = f"{one.name}: run-on {evaluation.run_on_s:.2f} s"
        _plot(panel, LENGTHS_PCT, left, look, marker="o", markersize=3.5, label=label)
    ticks = LENGTHS_PCT[::2]
    panel.set_xticks(ticks, [f"{t:+d}".replace("-", MINUS) if t else "0" for t in ticks])
    panel.set_xlim(LENGTHS_PCT[0] - 1, LENGTHS_PCT[-1] + 1)
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel(
        "true pendulum length against the sway data, %; grey: designed for",
        fontsize=TEXT_PT,
        color=TEXT_COLOUR,
    )
    panel.legend(loc="upper center", fontsize=TEXT_PT, frameon=False)
