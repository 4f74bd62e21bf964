"""The picture of a raw and a shaped drive: joystick, command to the valve, swing of the grapple.

Of the report only the pictures (this module, ``pareto``, ``style``) need matplotlib. They use its
object API: no display and no global state.
"""

from collections.abc import Callable, Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec

from canshaper.report import style
from canshaper.report.console import NOTHING, axis_title, change_text
from canshaper.report.strokes import (
    Stroke,
    aligned,
    find_strokes,
    residual_window,
    residual_windows,
    rests,
)
from canshaper_sim.recording import Recording

WINDOW_COLOUR = "#FBE5A6"
_BLOCK_PX, _HEAD_PX, _FOOT_PX = 590, 230, 184
_EDGE, _LEFT, _RIGHT = 0.012, 0.1, 0.988  # of the figure: room for the units at the left
_TIME_RIGHT, _VIEW_LEFT = 0.612, 0.668  # where there are views from above


def figure(raw: Recording, shaped: Recording, report: Mapping[str, Any]) -> Figure:
    """Return the picture of two drives.

    Each axis with sway has a block of command above sway, all with one time axis; next to them
    stand the paths of tip and grapple from above, if the drives have them.

    Args:
        raw: drive with the filters off.
        shaped: the same operator script with the filters on.
        report: ``metrics.report_dict`` of the two; the titles carry its numbers.

    Raises:
        ValueError: no axis has sway, or the drives cannot be compared (see ``aligned``).
    """
    raw, shaped = aligned(raw, shaped)
    names = [name for name, trace in raw.axes.items() if trace.sway_deg is not None]
    if not names:
        raise ValueError("no axis of the drives has sway: there is nothing to draw")
    views = [
        (drive.crane, rests(drive)) for drive in (raw, shaped) if drive.crane and drive.crane.tip_m
    ]
    blocks = max(len(names), 2 if views else 1)
    height = _HEAD_PX + blocks * _BLOCK_PX + _FOOT_PX
    fig = style.print_figure(height)
    _head(fig, report["crane"], height)
    if _windows(raw):
        _explain_shade(fig, height, raw.dwell_s)
    top, bottom = 1.0 - _HEAD_PX / height, _FOOT_PX / height
    right = _TIME_RIGHT if views else _RIGHT
    grid = fig.add_gridspec(
        len(names), 1, left=_LEFT, right=right, top=top, bottom=bottom, hspace=0.24
    )
    titles = {name: finding(name, report["axes"][name]) for name in names}
    _draw_blocks(fig, grid, raw, shaped, titles)
    if views:
        low = 1.0 - (_HEAD_PX + 2 * _BLOCK_PX) / height
        box = (_VIEW_LEFT, low, _RIGHT, top)
        style.draw_top_views(fig, views, box, sizes=(style.TEXT_PT, style.TITLE_PT))
    return fig


def _draw_blocks(
    fig: Figure, grid: GridSpec, raw: Recording, shaped: Recording, titles: Mapping[str, str]
) -> None:
    """Draw a panel of command above a panel of sway for each axis that has a title."""
    strokes, windows = find_strokes(raw), _windows(raw)
    swings = [abs(v) for drive in (raw, shaped) for name in titles for v in _sway(drive, name)]
    largest = max(*swings, 0.1)  # a scale of 0.1 degrees where nothing swings
    panels: list[Axes] = []
    for row, (name, title) in enumerate(titles.items()):
        block = grid[row].subgridspec(2, 1, height_ratios=[1.0, 1.9], hspace=0.1)
        time = panels[0] if panels else None
        command = fig.add_subplot(block[0], sharex=time)
        sway = fig.add_subplot(block[1], sharex=command, sharey=panels[1] if panels else None)
        panels += [command, sway]
        style.titled(command, title, style.TITLE_PT)
        for panel in (command, sway):
            style.plain(panel, size=style.TEXT_PT)
            style.zero_line(panel)
            _shade(panel, raw, windows)
        _draw_command(command, raw, shaped, name, strokes[name])
        _draw_sway(sway, raw, shaped, name)
        _mark_residual(sway, raw, shaped, name, 1.25 * largest)
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    panels[0].set_xlim(0.0, min(raw.t_s[-1], shaped.t_s[-1]))
    panels[1].set_ylim(-1.45 * largest, 1.45 * largest)
    style.label(panels[-1], "time, s")


def finding(name: str, axis: Mapping[str, Any]) -> str:
    """Return the result for one axis as text: "Near-far: residual swing 15.9° → 0.4° (−97 %)".

    Without a raw residual the text has the peak. Swing in the other plane needs its reduction.
    """
    measure = "residual" if axis["raw"]["residual_deg"] is not None else "peak"
    words = {"residual": "residual swing", "peak": "largest swing"}
    text = f"{axis_title(name)}: {words[measure]} {_change(axis, measure)}"
    if axis["cross_residual_reduction_pct"] is not None:
        text += f"\nleft in the other plane {_change(axis, 'cross_residual')}"
    return text


def _change(measures: Mapping[str, Any], measure: str) -> str:
    raw, shaped = measures["raw"][f"{measure}_deg"], measures["shaped"][f"{measure}_deg"]
    values = " → ".join(NOTHING if value is None else f"{value:.1f}°" for value in (raw, shaped))
    reduction = measures[f"{measure}_reduction_pct"]
    if reduction is None:
        return values
    return f"{values} ({change_text(reduction).replace('-', style.MINUS)})"


def _windows(drive: Recording) -> list[range]:
    """Return the windows in which residual swing shows, whatever axes moved before."""
    every = (residual_window(drive.t_s, rest, drive.dwell_s) for rest in rests(drive))
    return [window for window in every if window]


def _head(fig: Figure, crane: Mapping[str, Any] | None, height: float) -> None:
    """Write the headline, also the key to the curves; gain and price where the tip is measured."""
    words = (
        ("The same operator script with", style.TEXT_COLOUR),
        ("filters off (dashed)", style.RAW_COLOUR),
        ("and", style.TEXT_COLOUR),
        ("filters on (solid)", style.SHAPED_COLOUR),
    )
    style.coloured_words(fig, words, (_EDGE, 1.0 - 14 / height), size=style.HEAD_PT, sep=4)
    if crane and crane["raw"]["run_on_m"] is not None:
        look: dict[str, Any] = {"fontsize": style.TITLE_PT, "color": style.TEXT_COLOUR}
        fig.text(_EDGE, 1.0 - 70 / height, gain_and_price(crane), va="top", **look)


def gain_and_price(crane: Mapping[str, Any]) -> str:
    """Return lines on gain (residual swing, else peak) and price (run-on) of the filters."""
    off, on = crane["raw"], crane["shaped"]
    measure, words = "residual", "residual swing"
    if off["residual_deg"] is None:
        measure, words = "peak", "largest swing"
    seconds, metres = (
        " → ".join(f"{drive[key]:.2f}" for drive in (off, on)) for key in ("run_on_s", "run_on_m")
    )
    return (
        f"Gain: {words} {_change(crane, measure)}\n"
        f"Price: after the last joystick is let go, the tip runs on {seconds} s, {metres} m"
    )


def _explain_shade(fig: Figure, height: float, dwell_s: float) -> None:
    fig.text(
        _LEFT,
        46 / height,  # the stamp is below
        f"shaded: residual swing, from {dwell_s:g} s after release to the next move",
        va="bottom",
        fontsize=style.TEXT_PT,
        color=style.TEXT_COLOUR,
        bbox={"facecolor": WINDOW_COLOUR, "edgecolor": "none", "pad": 3.0},
    )


def _shade(panel: Axes, drive: Recording, windows: list[range]) -> None:
    for window in windows:
        panel.axvspan(
            drive.t_s[window[0]], drive.t_s[window[-1]], color=WINDOW_COLOUR, linewidth=0, zorder=0
        )


def _draw_command(
    panel: Axes, raw: Recording, shaped: Recording, name: str, strokes: list[Stroke]
) -> None:
    """Draw the joystick as a filled step, and the command to the valve without and with filters."""
    joystick = raw.axes[name].joystick
    panel.fill_between(
        raw.t_s, joystick, step="post", color=style.JOYSTICK_COLOUR, linewidth=0, zorder=1.5
    )
    _draw_pair(panel, raw, shaped, lambda drive: drive.axes[name].sent, drawstyle="steps-post")
    style.command_scale(panel, 1.2)
    style.label(panel, y="command, %")
    if strokes:
        first, last = strokes[0].plateau
        middle_s = 0.5 * (raw.t_s[first] + raw.t_s[last])
        level = -0.5 * strokes[0].direction
        panel.text(middle_s, level, "joystick", ha="center", va="center", fontsize=style.TEXT_PT)


def _draw_sway(panel: Axes, raw: Recording, shaped: Recording, name: str) -> None:
    _draw_pair(panel, raw, shaped, lambda drive: _sway(drive, name))
    style.label(panel, y="sway, degrees")


def _draw_pair(
    panel: Axes,
    raw: Recording,
    shaped: Recording,
    values: Callable[[Recording], list[float]],
    **options: Any,
) -> None:
    """Draw a curve of both drives: raw thin and dashed, shaped solid, distinct also in grey."""
    looks = (
        (raw, style.RAW_COLOUR, 1.0, style.DASHED),
        (shaped, style.SHAPED_COLOUR, 1.7, "solid"),
    )
    for drive, colour, width, dashes in looks:
        panel.plot(
            drive.t_s, values(drive), color=colour, linewidth=width, linestyle=dashes, **options
        )


def _mark_residual(
    panel: Axes, raw: Recording, shaped: Recording, name: str, height_deg: float
) -> None:
    """Mark the swing given in the title on both curves, and name the curves there.

    The names stand above and below all curves, at ``height_deg``: that of the raw curve on the side
    of its extreme, that of the shaped curve on the other side.
    """
    at_raw = _worst(raw, name)
    side = 1.0 if _sway(raw, name)[at_raw] > 0 else -1.0
    for drive, at, text, colour, height in (
        (raw, at_raw, "filters off", style.RAW_COLOUR, side * height_deg),
        (shaped, _worst(shaped, name), "filters on", style.SHAPED_COLOUR, -side * height_deg),
    ):
        t, sway = drive.t_s[at], _sway(drive, name)[at]
        edge = 0.15 * drive.t_s[-1]  # a name centred nearer to the end would leave the panel
        align = "left" if t < edge else "right" if t > drive.t_s[-1] - edge else "center"
        panel.plot([t], [sway], "o", color=colour, markersize=4, markeredgecolor="white", zorder=4)
        panel.annotate(
            f"{text}: {round(abs(sway), 2):.1f}°",
            xy=(t, sway),
            xytext=(t, height),
            ha=align,
            va="center",
            fontsize=style.TEXT_PT,
            weight="bold",
            color=colour,
            arrowprops={
                "arrowstyle": "-",
                "color": colour,
                "linewidth": 0.7,
                "shrinkB": 3,
                "relpos": ({"left": 0.0, "right": 1.0}.get(align, 0.5), 0.5),
            },
        )


def _worst(drive: Recording, name: str) -> int:
    """Return the index of the residual's sample, or of the peak's without a residual window."""
    windows = residual_windows(drive, find_strokes(drive)[name])
    seen = [k for window in windows for k in window] or range(len(drive.t_s))
    return max(seen, key=lambda k: abs(_sway(drive, name)[k]))


def _sway(drive: Recording, name: str) -> list[float]:
    return drive.axes[name].sway_deg or []
