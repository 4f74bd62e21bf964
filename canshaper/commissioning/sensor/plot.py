"""The picture of sway sensors: measured over model, a row a sensor.

Drawn through the object API of matplotlib, like ``canshaper.report.plot``.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from canshaper.commissioning.sensor.finding import Finding
from canshaper.commissioning.sensor.report import heading
from canshaper.report import style

ROW_PX, TOP_PX, FOOT_PX = 600, 130, 150
_DATA = "#8A8A8A"


def figure(findings: Sequence[Finding]) -> Figure:
    """Measured over model, a row a finding with a fit."""
    rows = [finding for finding in findings if finding.fit]
    height = TOP_PX + ROW_PX * len(rows) + FOOT_PX
    fig = style.new_figure(style.WIDTH_PX, height, dpi=style.PRINT_DPI)
    words = [
        ("measured", _DATA),
        ("model", style.SHAPED_COLOUR),
        ("command", style.JOYSTICK_COLOUR),
    ]
    style.coloured_words(fig, words, (0.012, 1.0 - 14 / height), size=style.TITLE_PT, sep=18)
    grid = fig.add_gridspec(
        len(rows), 1, left=0.085, right=0.985, top=1.0 - TOP_PX / height, bottom=FOOT_PX / height,
        hspace=0.5,
    )  # fmt: skip
    for i, finding in enumerate(rows):
        assert finding.fit
        panel = fig.add_subplot(grid[i, 0])
        style.plain(panel, size=style.TEXT_PT)
        style.titled(panel, heading(finding), style.TITLE_PT)
        panel.title.set_color(style.RAW_COLOUR if finding.problems else style.TEXT_COLOUR)
        reach = 0.0
        for one, model in zip(finding.data, finding.fit.fitted, strict=True):
            time = one.start_s + one.time_s
            panel.plot(time, np.degrees(one.value), ".", color=_DATA, markersize=3.0)
            panel.plot(time, np.degrees(model), color=style.SHAPED_COLOUR, linewidth=1.8)
            reach = max(reach, float(np.degrees(np.abs(one.value)).max()))
        for one in finding.data:
            command = one.command
            panel.step(
                command.time_s,
                reach * command.speed,
                where="post",
                color=style.JOYSTICK_COLOUR,
                zorder=1,
            )
        panel.set_ylabel(f"swing, {finding.unit}", fontsize=style.TEXT_PT, color=style.TEXT_COLOUR)
        panel.set_xlabel("time in s", fontsize=style.TEXT_PT, color=style.TEXT_COLOUR)
    return fig
