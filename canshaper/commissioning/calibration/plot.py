"""The picture of a calibration: the valve's curve as the file has it and as it was measured."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from canshaper.commissioning.calibration.fit import FULL, Calibration
from canshaper.report import style
from canshaper.report.console import axis_title
from canshaper.shaping.limits import OutputLimits

_HEIGHT_PX = 1250


def in_file(limits: OutputLimits, commands_pct: Sequence[float]) -> list[float]:
    """Speed in % of full that the file expects at commands in %."""
    return [100.0 * limits.velocity(c / 100.0) for c in commands_pct]


def figure(axis: str, limits: OutputLimits, measured: Calibration, top_pct: float) -> Figure:
    """Speed over command.

    Args:
        axis: its name.
        limits: those of the file.
        measured: what was measured.
        top_pct: largest command that was driven.
    """
    commands, speeds = measured.curve()
    fine = [0.1 * k for k in range(-1000, 1001)]
    fig = style.new_figure(style.WIDTH_PX, _HEIGHT_PX, dpi=style.PRINT_DPI)
    panel = fig.add_axes((0.1, 0.115, 0.87, 0.775))
    style.plain(panel, size=style.TEXT_PT)
    style.zero_line(panel)
    panel.axvspan(-top_pct, top_pct, color="#EFEFEF", linewidth=0, zorder=0, label="driven")
    panel.plot(
        fine,
        in_file(limits, fine),
        color=style.RAW_COLOUR,
        linewidth=1.2,
        linestyle=style.DASHED,
        label="file",
        zorder=3,
    )
    driven = slice(None)
    if top_pct < 100.0 * FULL:  # what was not driven is a straight line
        driven = slice(1, -1)
        panel.plot(
            commands, speeds, ":", color=style.SHAPED_COLOUR, linewidth=1.8, label="not measured"
        )
    panel.plot(
        commands[driven],
        speeds[driven],
        "-o",
        color=style.SHAPED_COLOUR,
        linewidth=1.8,
        markersize=4,
        label="measured",
    )
    for one, sign, place in ((measured.negative, -1, "right"), (measured.positive, 1, "left")):
        side = style.MINUS if sign < 0 else ""
        panel.annotate(
            f"opens at {side}{100.0 * one.opens:.1f} %",
            (sign * 100.0 * one.opens, 0.0),
            xytext=(sign * 10, -sign * 22),
            textcoords="offset points",
            ha=place,
            va="center",
            fontsize=style.TEXT_PT,
            color=style.SHAPED_COLOUR,
            arrowprops={"arrowstyle": "-", "color": style.SHAPED_COLOUR, "linewidth": 0.7},
        )
    panel.set_xlim(-100.0, 100.0)
    panel.set_ylim(-108.0, 108.0)
    panel.set_xlabel(
        "command to the valve, % of full", fontsize=style.TEXT_PT, color=style.TEXT_COLOUR
    )
    panel.set_ylabel("speed, % of full", fontsize=style.TEXT_PT, color=style.TEXT_COLOUR)
    panel.legend(loc="upper left", fontsize=style.TEXT_PT, frameon=False)
    title = f"{axis_title(axis)}: the valve as the file has it, and as measured"
    fig.suptitle(title, x=0.012, ha="left", fontsize=style.HEAD_PT, weight="bold")
    return fig
