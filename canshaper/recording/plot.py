"""The picture of a replay: joystick and command above predicted sway, each deployment in a colour.

The only module here that needs matplotlib; it draws through the object API, so no display and no
global state is involved.
"""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes

from canshaper.recording.report import Replayed
from canshaper.report.style import (
    DPI,
    JOYSTICK_COLOUR,
    RAW_COLOUR,
    SHAPED_COLOUR,
    TEXT_COLOUR,
    coloured_words,
    command_scale,
    new_figure,
    plain,
    save,
    zero_line,
)
from canshaper.report.table import axis_title
from canshaper_sim.recording import Recording

# The first deployment, the second; all others. Of Okabe and Ito, as in the other pictures.
COLOURS = (SHAPED_COLOUR, RAW_COLOUR, "#009E73", "#CC79A7")
STRAIGHT_COLOUR = "#888888"
WIDTH_PX, BLOCK_IN = 1600, 4.2


def draw(replays: Sequence[Replayed], path: Path) -> None:
    """Draw all axes of all replays (PNG).

    Args:
        replays: at least one, with rows.
        path: file to write.
    """
    recordings = [one.trace.recording() for one in replays]
    straight = replays[0].trace.straight()
    names = list(dict.fromkeys(name for recording in recordings for name in recording.axes))
    swinging = {n for r in recordings for n, trace in r.axes.items() if trace.sway_deg is not None}
    rows = [(n, sway) for n in names for sway in ((False, True) if n in swinging else (False,))]
    heights = [1.6 if sway else 1.0 for _, sway in rows]
    inches = 0.7 + BLOCK_IN * sum(heights) / 2.6
    fig = new_figure(WIDTH_PX, inches * DPI)
    words = [("joystick straight to the valve", STRAIGHT_COLOUR)]
    words += [(one.name, COLOURS[i % len(COLOURS)]) for i, one in enumerate(replays)]
    coloured_words(fig, words, (0.052, 1.0 - 0.08 / inches), size=15, sep=14)
    grid = fig.add_gridspec(
        len(heights), 1, left=0.052, right=0.988, top=1.0 - 0.7 / inches, bottom=0.5 / inches,
        height_ratios=heights, hspace=0.28,
    )  # fmt: skip
    panels: list[Axes] = []
    for row, (name, sway) in enumerate(rows):
        panel = fig.add_subplot(grid[row], sharex=panels[0] if panels else None)
        panels.append(panel)
        (_draw_sway if sway else _draw_command)(panel, name, recordings, straight)
        plain(panel)
        zero_line(panel)
        panel.tick_params(labelbottom=row == len(rows) - 1)
    panels[-1].set_xlabel("time since the first tick, s", color=TEXT_COLOUR)
    panels[0].set_xlim(straight.t_s[0], straight.t_s[-1])
    save(fig, path)


def _draw_command(
    panel: Axes, name: str, recordings: Sequence[Recording], straight: Recording
) -> None:
    """Draw the command of the valve, over the joystick as a filled step."""
    panel.set_title(axis_title(name), loc="left", fontsize=13, weight="bold", color=TEXT_COLOUR)
    if name in straight.axes:
        joystick = straight.axes[name].joystick
        panel.fill_between(straight.t_s, joystick, step="post", color=JOYSTICK_COLOUR, linewidth=0)
    command_scale(panel, 1.1)
    panel.set_ylabel("command, %", color=TEXT_COLOUR)
    for i, recording in enumerate(recordings):
        if name in recording.axes:
            colour = COLOURS[i % len(COLOURS)]
            sent = recording.axes[name].sent
            panel.plot(recording.t_s, sent, color=colour, linewidth=1.4, drawstyle="steps-post")


def _draw_sway(
    panel: Axes, name: str, recordings: Sequence[Recording], straight: Recording
) -> None:
    """Draw the predicted sway, and that of the joystick straight to the valve."""
    panel.set_ylabel("predicted sway, degrees", color=TEXT_COLOUR)
    joystick = straight.axes.get(name)
    if joystick is not None and joystick.sway_deg is not None:
        panel.plot(straight.t_s, joystick.sway_deg, color=STRAIGHT_COLOUR, linewidth=1.0)
    for i, recording in enumerate(recordings):
        if name in recording.axes and (sway := recording.axes[name].sway_deg) is not None:
            panel.plot(recording.t_s, sway, color=COLOURS[i % len(COLOURS)], linewidth=1.8)
