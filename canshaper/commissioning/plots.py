"""Pictures of a calibration, of the doctor's runs and of sway sensors.

Drawn through the object API of matplotlib, like ``canshaper.report.plot``.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from canshaper.commissioning.calibration.fit import FULL, Calibration
from canshaper.commissioning.doctor.measure import Run
from canshaper.commissioning.doctor.verdict import ENDS_US, histogram, summary
from canshaper.commissioning.sensor.verdict import SensorFinding, heading
from canshaper.report import style
from canshaper.report.console import axis_title
from canshaper.shaping.limits import OutputLimits

_VALVE_PX, _RUNS_PX = 1250, 900
_ROW_PX, _TOP_PX, _FOOT_PX = 600, 130, 150
_FOOT = 0.19
_LOOKS = ((style.SHAPED_COLOUR, ""), (style.RAW_COLOUR, "////"))
_DATA = "#8A8A8A"


def in_file(limits: OutputLimits, commands_pct: Sequence[float]) -> list[float]:
    """Return the speeds in % of full that the file expects at commands in %."""
    return [100.0 * limits.velocity(c / 100.0) for c in commands_pct]


def of_valve(axis: str, limits: OutputLimits, measured: Calibration, top_pct: float) -> Figure:
    """Draw speed over command of a valve: by the file, and as measured.

    Args:
        axis, limits: its name and its limits in the file.
        measured: what was measured.
        top_pct: largest command that was driven.
    """
    commands, speeds = measured.curve()
    fine = [0.1 * k for k in range(-1000, 1001)]
    fig = style.print_figure(_VALVE_PX)
    panel = fig.add_axes((0.1, 0.115, 0.87, 0.775))
    style.plain(panel, size=style.TEXT_PT)
    style.zero_line(panel)
    panel.axvspan(-top_pct, top_pct, color="#EFEFEF", linewidth=0, zorder=0, label="driven")
    dashed: dict[str, Any] = {"color": style.RAW_COLOUR, "linestyle": style.DASHED, "zorder": 3}
    panel.plot(fine, in_file(limits, fine), linewidth=1.2, label="file", **dashed)
    line: dict[str, Any] = {"color": style.SHAPED_COLOUR, "linewidth": 1.8}
    driven = slice(None)
    if top_pct < 100.0 * FULL:  # what was not driven is a straight line
        driven = slice(1, -1)
        panel.plot(commands, speeds, ":", label="not measured", **line)
    panel.plot(commands[driven], speeds[driven], "-o", markersize=4, label="measured", **line)
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
    style.label(panel, "command to the valve, % of full", "speed, % of full")
    panel.legend(loc="upper left", fontsize=style.TEXT_PT, frameon=False)
    style.headline(fig, f"{axis_title(axis)}: the valve as the file has it, and as measured")
    return fig


def of_runs(runs: Mapping[str, Run], tick_ms: float) -> Figure:
    """Draw the share of ticks by their lateness, a bar for each run, and the limit of a tick.

    Args:
        runs: by their names.
        tick_ms: the tick; a tick as late as that has missed the next deadline.
    """
    fig = style.print_figure(_RUNS_PX)
    panel = fig.add_axes((0.09, _FOOT, 0.9, 0.9 - _FOOT))
    style.plain(panel, size=style.TEXT_PT)
    limit_us = 1000.0 * tick_ms
    bins = {name: histogram(run.late_ns) for name, run in runs.items()}
    used = [end for counts in bins.values() for end in counts] or [ENDS_US[0]]
    ends = [end for end in ENDS_US if min(used) <= end <= max(*used, limit_us)]
    width = 0.8 / max(len(runs), 1)
    for i, (name, counts) in enumerate(bins.items()):
        total = max(sum(counts.values()), 1)
        at = [k + (i - 0.5 * (len(runs) - 1)) * width for k in range(len(ends))]
        colour, hatch = _LOOKS[i % len(_LOOKS)]
        figures = summary(runs[name].late_ns)
        latest = f", latest {figures.max / 1000.0:.2f} ms" if figures else ""
        shares = [100.0 * counts.get(end, 0) / total for end in ends]
        label = f"{name}: {total} ticks{latest}, {runs[name].missed} missed"
        panel.bar(at, shares, width, color=colour, hatch=hatch, edgecolor="white", label=label)
    panel.set_yscale("log")
    panel.set_ylim(0.001, 300.0)
    panel.set_yticks([0.001, 0.01, 0.1, 1, 10, 100], ["0.001", "0.01", "0.1", "1", "10", "100"])
    # The limit stands after the last bin that ends at or before it.
    below = sum(end <= limit_us for end in ends)
    panel.axvline(below - 0.5, color=style.TEXT_COLOUR, linestyle="--", linewidth=1.2)
    panel.text(
        below - 0.55, 130.0, f"limit: one tick, {tick_ms:g} ms", ha="right", fontsize=style.TEXT_PT
    )
    panel.set_xlim(-0.7, max(len(ends), below) - 0.3)
    panel.set_xticks(range(len(ends)), [_time(end) for end in ends])
    style.label(panel, "lateness of a tick, up to", "ticks, %")
    style.headline(fig, "How late the ticks came")
    fig.legend(loc="lower left", bbox_to_anchor=(0.0, 0.0), fontsize=style.TEXT_PT, frameon=False)
    return fig


def _time(us: int) -> str:
    return f"{us} µs" if us < 1000 else f"{us // 1000} ms"


def of_sensors(findings: Sequence[SensorFinding]) -> Figure:
    """Draw measurements and model over time, a row for each finding with a fit."""
    rows = [finding for finding in findings if finding.fit]
    height = _TOP_PX + _ROW_PX * len(rows) + _FOOT_PX
    fig = style.print_figure(height)
    looks = _DATA, style.SHAPED_COLOUR, style.JOYSTICK_COLOUR
    words = [*zip(("measured", "model", "command"), looks, strict=True)]
    style.coloured_words(fig, words, (0.012, 1.0 - 14 / height), size=style.TITLE_PT, sep=18)
    grid = fig.add_gridspec(
        len(rows), 1, left=0.085, right=0.985, top=1.0 - _TOP_PX / height, bottom=_FOOT_PX / height,
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
            command, grey = one.command, style.JOYSTICK_COLOUR
            panel.step(command.time_s, reach * command.speed, where="post", color=grey, zorder=1)
        style.label(panel, "time in s", f"swing, {finding.unit}")
    return fig
