"""The picture of a raw and a shaped drive: what was asked, what was sent, how the grapple swung.

The only module of the report that needs matplotlib; it draws through the object API, so no
display and no global state is involved.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from canshaper.report.strokes import (
    RESIDUAL_DWELL_S,
    Stroke,
    aligned,
    find_strokes,
    residual_windows,
)
from canshaper.report.style import (
    MINUS,
    RAW_COLOUR,
    SHAPED_COLOUR,
    STICK_COLOUR,
    TEXT_COLOUR,
    coloured_words,
    command_scale,
    new_figure,
    plain,
    save,
    zero_line,
)
from canshaper.report.table import NOTHING, axis_title, change_text
from canshaper_sim.recording import Recording

WINDOW_COLOUR = "#FFF1BF"
SIZE_PX = (1600, 1000)
_LEFT, _RIGHT = 0.052, 0.988  # of the figure: room for the units at the left


def draw(raw: Recording, shaped: Recording, report: Mapping[str, Any], path: Path) -> None:
    """Draw the two drives and write the picture to ``path`` (PNG of ``SIZE_PX``).

    Args:
        raw: drive with the filters off.
        shaped: the same operator script with the filters on.
        report: ``metrics.report_dict`` of the two; the titles carry its numbers.
        path: file to write.

    Raises:
        ValueError: no axis has sway, or the drives cannot be compared (see ``aligned``).
    """
    save(figure(raw, shaped, report), path)


def figure(raw: Recording, shaped: Recording, report: Mapping[str, Any]) -> Figure:
    """Return the picture: per axis with sway a block of command above sway, all on one time."""
    raw, shaped = aligned(raw, shaped)
    strokes = find_strokes(raw)
    names = [name for name, trace in raw.axes.items() if trace.sway_deg is not None]
    if not names:
        raise ValueError("no axis of the drives has sway: there is nothing to draw")
    swings = [abs(v) for drive in (raw, shaped) for name in names for v in _sway(drive, name)]
    largest = max(*swings, 0.1)  # a scale of 0.1 degrees where nothing swings
    fig = new_figure(*SIZE_PX)
    _head(fig)
    if any(residual_windows(raw, strokes[name]) for name in names):
        _explain_shade(fig)
    blocks = fig.add_gridspec(
        len(names), 1, left=_LEFT, right=_RIGHT, top=0.905, bottom=0.058, hspace=0.22
    )
    panels: list[Axes] = []
    for row, name in enumerate(names):
        block = blocks[row].subgridspec(2, 1, height_ratios=[1.0, 1.9], hspace=0.08)
        time = panels[0] if panels else None
        command = fig.add_subplot(block[0], sharex=time)
        sway = fig.add_subplot(block[1], sharex=command, sharey=panels[1] if panels else None)
        panels += [command, sway]
        title = finding(name, report["axes"][name])
        command.set_title(title, loc="left", fontsize=15, weight="bold", color=TEXT_COLOUR, pad=8)
        for panel in (command, sway):
            plain(panel)
            zero_line(panel)
            _shade_windows(panel, raw, strokes[name])
        _draw_command(command, raw, shaped, name, strokes[name])
        _draw_sway(sway, raw, shaped, name)
        _mark_residual(sway, raw, shaped, name, 1.25 * largest)
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    panels[0].set_xlim(0.0, min(raw.t_s[-1], shaped.t_s[-1]))
    panels[1].set_ylim(-1.45 * largest, 1.45 * largest)
    panels[-1].set_xlabel("time, s", fontsize=11, color=TEXT_COLOUR)
    return fig


def finding(name: str, axis: Mapping[str, Any]) -> str:
    """Say what the drives show of one axis: "Near-far: residual swing 15.9° → 0.4° (−97 %)".

    Swing in the other plane is added where there is some; without a residual the peak is shown.
    """
    measure = "residual" if axis["raw"]["residual_deg"] is not None else "peak"
    words = {"residual": "residual swing", "peak": "largest swing"}
    text = f"{axis_title(name)}: {words[measure]} {_change(axis, measure)}"
    if axis["cross_residual_reduction_pct"] is not None:
        text += f",  left in the other plane {_change(axis, 'cross_residual')}"
    return text


def _change(axis: Mapping[str, Any], measure: str) -> str:
    raw, shaped = axis["raw"][f"{measure}_deg"], axis["shaped"][f"{measure}_deg"]
    values = " → ".join(NOTHING if value is None else f"{value:.1f}°" for value in (raw, shaped))
    reduction = axis[f"{measure}_reduction_pct"]
    if reduction is None:
        return values
    return f"{values} ({change_text(reduction).replace('-', MINUS)})"


def _head(fig: Figure) -> None:
    """Write the headline, which is at the same time the key to the colours."""
    words = (
        ("The same operator script with", TEXT_COLOUR),
        ("filters off", RAW_COLOUR),
        ("and", TEXT_COLOUR),
        ("filters on", SHAPED_COLOUR),
    )
    coloured_words(fig, words, (_LEFT, 0.988), size=18, sep=7)


def _explain_shade(fig: Figure) -> None:
    fig.text(
        _RIGHT,
        0.985,
        f"shaded: residual swing, from {RESIDUAL_DWELL_S:g} s after release to the next move",
        ha="right",
        va="top",
        fontsize=11,
        color=TEXT_COLOUR,
        bbox={"facecolor": WINDOW_COLOUR, "edgecolor": "none", "pad": 4.0},
    )


def _shade_windows(panel: Axes, drive: Recording, strokes: list[Stroke]) -> None:
    for window in residual_windows(drive, strokes):
        panel.axvspan(
            drive.t_s[window[0]], drive.t_s[window[-1]], color=WINDOW_COLOUR, linewidth=0, zorder=0
        )


def _draw_command(
    panel: Axes, raw: Recording, shaped: Recording, name: str, strokes: list[Stroke]
) -> None:
    """Draw the stick as a filled step, and the command to the valve without and with filters."""
    stick = raw.axes[name].stick
    panel.fill_between(raw.t_s, stick, step="post", color=STICK_COLOUR, linewidth=0, zorder=1.5)
    for drive, colour in ((raw, RAW_COLOUR), (shaped, SHAPED_COLOUR)):
        panel.plot(
            drive.t_s,
            drive.axes[name].sent,
            color=colour,
            linewidth=1.6,
            drawstyle="steps-post",
            solid_joinstyle="round",
        )
    command_scale(panel, 1.2)
    panel.set_ylabel("command, %", fontsize=11, color=TEXT_COLOUR)
    if strokes:
        first, last = strokes[0].plateau
        middle_s = 0.5 * (raw.t_s[first] + raw.t_s[last])
        level = 0.5 * strokes[0].direction * strokes[0].level
        panel.text(middle_s, level, "stick", ha="center", va="center", color="#666666")


def _draw_sway(panel: Axes, raw: Recording, shaped: Recording, name: str) -> None:
    for drive, colour, width in ((raw, RAW_COLOUR, 1.4), (shaped, SHAPED_COLOUR, 2.2)):
        panel.plot(drive.t_s, _sway(drive, name), color=colour, linewidth=width)
    panel.set_ylabel("sway, degrees", fontsize=11, color=TEXT_COLOUR)


def _mark_residual(
    panel: Axes, raw: Recording, shaped: Recording, name: str, height_deg: float
) -> None:
    """Mark the swing the title tells of on both curves, and name the curves there.

    The names stand above and below all curves, at ``height_deg``: the raw one on the side of its
    extreme, the shaped one on the other.
    """
    at_raw = _worst(raw, name)
    side = 1.0 if _sway(raw, name)[at_raw] > 0 else -1.0
    for drive, at, text, colour, height in (
        (raw, at_raw, "filters off", RAW_COLOUR, side * height_deg),
        (shaped, _worst(shaped, name), "filters on", SHAPED_COLOUR, -side * height_deg),
    ):
        t, sway = drive.t_s[at], _sway(drive, name)[at]
        edge = 0.1 * drive.t_s[-1]  # a name centred nearer to the end would leave the panel
        align = "left" if t < edge else "right" if t > drive.t_s[-1] - edge else "center"
        panel.plot([t], [sway], "o", color=colour, markersize=7, markeredgecolor="white", zorder=4)
        panel.annotate(
            f"{text}: {round(abs(sway), 2):.1f}°",
            xy=(t, sway),
            xytext=(t, height),
            ha=align,
            va="center",
            fontsize=13,
            weight="bold",
            color=colour,
            arrowprops={
                "arrowstyle": "-",
                "color": colour,
                "linewidth": 1.0,
                "shrinkB": 4,
                "relpos": ({"left": 0.0, "right": 1.0}.get(align, 0.5), 0.5),
            },
        )


def _worst(drive: Recording, name: str) -> int:
    """Sample of the residual of a drive; of its peak where it has no residual window."""
    windows = residual_windows(drive, find_strokes(drive)[name])
    seen = [k for window in windows for k in window] or range(len(drive.t_s))
    return max(seen, key=lambda k: abs(_sway(drive, name)[k]))


def _sway(drive: Recording, name: str) -> list[float]:
    return drive.axes[name].sway_deg or []
