"""Figures 3, 4, 7 and 8 of the paper: commands and swing, without and with G_FF.

The paper's curves are normalised, so shapes and percentages can be compared with it, not degrees.
"""

import math
from collections.abc import Sequence
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from canshaper.report.console import axis_title
from canshaper.report.style import new_figure, zero_line
from studies.paper.runs import METRICS, TRACE_OF, Plane, Run
from studies.paper.style import (
    JOYSTICK_COLOUR,
    LEFT,
    MINUS,
    NONE_COLOUR,
    PLANT_COLOUR,
    PLANT_WORDS,
    RIGHT,
    TEXT_COLOUR,
    change,
    footnote,
    headline,
    key,
    plain,
    poles,
)

_LABEL: Final[dict[str, Any]] = {"fontsize": 11, "color": TEXT_COLOUR}
_PLANE_WORDS: Final[dict[Plane, str]] = {
    "perpendicular": "swing across the boom, °",
    "parallel": "swing along the boom, °",
}
_ALONG: Final[dict[Plane, str]] = {"perpendicular": "across", "parallel": "along"}
_METRIC_WORDS: Final = {"peak": "peak", "rms": "RMS", "residual": "residual"}
# Part of full command that the command panels show: the spikes of fast poles are given as text.
_COMMAND_TOP, _COMMAND_BOTTOM = 310.0, -210.0
_BEYOND_PCT = 110.0
_CONDITIONS = (
    "Full deflection for 3 s, then 5 s of rest; peak and RMS over the whole drive, residual later"
    " than"
    " 2.5 s after release; assumed grapple"
)
# Heights in a panel of a line for each plant, as parts of it.
_TWO_LINES = (0.115, 0.03)


def pole_figure(pairs: Sequence[tuple[Run, Run]]) -> Figure:
    """Figure 3 or 4: a column for each pair of poles, the linear and the real plant in it."""
    planes = pairs[0][0].planes
    fig = new_figure(*_size(planes))
    headline(fig, pole_finding(pairs))
    key(
        fig,
        (
            ("no filter", NONE_COLOUR),
            (PLANT_WORDS["linear"], PLANT_COLOUR["linear"]),
            (PLANT_WORDS["real"], PLANT_COLOUR["real"]),
        ),
        0.94 if len(planes) > 1 else 0.925,
    )
    for column, pair in zip(_columns(fig, pairs), pairs, strict=True):
        title = f"poles {poles(pair[0].poles_rad_s)} rad/s"
        column[0].set_title(title, loc="left", fontsize=14, color=TEXT_COLOUR)
        for run, height in zip(pair, _TWO_LINES, strict=True):
            run_on_s = run.compared[run.axis].shaped.run_on_s or 0.0
            _write(column[0], run, f"run-on {run_on_s:.1f} s", height, 11.5)
            for plane, panel in zip(planes, column[1:], strict=True):
                _write(panel, run, _reductions(run, plane, ("peak", "residual")), height, 11.5)
    footnote(
        fig,
        f"{_CONDITIONS}. Of the paper's pole pairs its text names {poles((-3.0, -3.0))} only.",
    )
    return fig


def pole_finding(pairs: Sequence[tuple[Run, Run]]) -> str:
    """The finding of figure 3 or 4: the peak on the linear plant over the poles."""
    plane = pairs[0][0].planes[0]
    reported = ", ".join(
        f"{change(run.swing(plane, 'peak').reduction_pct)} ({poles(run.poles_rad_s)})"
        for run, _ in (pairs[0], *pairs[-2:])
    )
    return f"{axis_title(pairs[0][0].axis)}, linear valve: slow poles, less swing: peak {reported}"


def optimum_figure(runs: tuple[Run, Run], claims: Sequence[tuple[Plane, float]]) -> Figure:
    """Figure 7 or 8: without and with the paper's optimum, a column for each plant.

    Args:
        runs: on the linear and on the real plant.
        claims: the reductions that the paper prints for the stroke, percent, by plane.
    """
    planes = runs[0].planes
    fig = new_figure(*_size(planes))
    headline(fig, optimum_finding(runs[0], claims))
    claimed = " and ".join(f"more than {bound:g} % {_ALONG[plane]}" for plane, bound in claims)
    said = f"The paper claims {claimed} the boom; it does not say of what."
    key(fig, ((said, "#666666"),), 0.94 if len(planes) > 1 else 0.925)
    columns = _columns(fig, [(run,) for run in runs])
    for column, run in zip(columns, runs, strict=True):
        column[0].set_title(
            f"{PLANT_WORDS[run.plant]}, poles {poles(run.poles_rad_s)} rad/s",
            loc="left",
            fontsize=14,
            weight="bold",
            color=PLANT_COLOUR[run.plant],
        )
        for plane, panel in zip(planes, column[1:], strict=True):
            _write(panel, run, _reductions(run, plane, METRICS), 0.035, 14)
            _name_raw(panel, run, plane)
    footnote(fig, f"{_CONDITIONS}.")
    return fig


def optimum_finding(run: Run, claims: Sequence[tuple[Plane, float]]) -> str:
    """The finding of figure 7 or 8: for which readings the paper's percentages hold."""
    reached = {
        m: [run.swing(plane, m).reduction_pct or 0.0 for plane, _ in claims] for m in METRICS
    }
    holds = [m for m in METRICS if all(v > c for v, (_, c) in zip(reached[m], claims, strict=True))]
    claimed = " and ".join(f"{bound:g}" for _, bound in claims)
    verdict = "every reading" if len(holds) == len(METRICS) else "no reading"
    if 0 < len(holds) < len(METRICS):
        verdict = f"{' and '.join(_METRIC_WORDS[m] for m in holds)} only"
    reported = "; ".join(
        f"{_METRIC_WORDS[m]} {', '.join(change(v) for v in reached[m])}" for m in METRICS
    )
    how = "in" if verdict.endswith("reading") else "for"
    return f"{axis_title(run.axis)}: > {claimed} % holds {how} {verdict}: {reported}"


def _size(planes: Sequence[Plane]) -> tuple[int, int]:
    return 1600, 1000 if len(planes) > 1 else 800


def _columns(fig: Figure, columns: Sequence[Sequence[Run]]) -> list[list[Axes]]:
    """A column of panels for each group of runs: commands above the swing in each plane."""
    planes = columns[0][0].planes
    rows = 1 + len(planes)
    grid = fig.add_gridspec(
        rows,
        len(columns),
        left=LEFT,
        right=RIGHT,
        top=0.865 if rows > 2 else 0.83,
        bottom=0.09 if rows > 2 else 0.115,
        hspace=0.12,
        wspace=0.07,
    )
    runs = [run for column in columns for run in column]
    largest = max(_largest(run, plane) for run in runs for plane in planes)
    sent = [100.0 * v for run in runs for v in run.shaped.axes[run.axis].sent]
    low, high = max(_COMMAND_BOTTOM, min(sent) - 20.0), min(_COMMAND_TOP, max(sent) + 25.0)
    drawn: list[list[Axes]] = []
    for i, column in enumerate(columns):
        panels: list[Axes] = []
        for row in range(rows):
            panel = fig.add_subplot(
                grid[row, i],
                sharex=panels[0] if panels else None,
                sharey=drawn[0][row] if drawn else None,
            )
            plain(panel)
            panel.tick_params(labelbottom=row == rows - 1, labelleft=i == 0)
            panels.append(panel)
        drawn.append(panels)
        _commands(panels[0], column)
        panels[0].set_ylim(low, high)
        panels[0].set_xlim(0.0, column[0].raw.t_s[-1])
        for plane, panel in zip(planes, panels[1:], strict=True):
            _swings(panel, column, plane)
            panel.set_ylim(-1.75 * largest, 1.2 * largest)
            if i == 0:
                panel.set_ylabel(_PLANE_WORDS[plane], **_LABEL)
        panels[-1].set_xlabel("time, s", **_LABEL)
    drawn[0][0].set_ylabel("command, % of full speed", **_LABEL)
    return drawn


def _write(panel: Axes, run: Run, text: str, height: float, size: float) -> None:
    """Text at the lower left of a panel, in the colour of the plant."""
    panel.text(
        0.012,
        height,
        text,
        transform=panel.transAxes,
        color=PLANT_COLOUR[run.plant],
        fontsize=size,
        weight="bold",
    )


def _name_raw(panel: Axes, run: Run, plane: Plane) -> None:
    """The name of the grey curve, at its highest point."""
    sway = _sway(run.raw.axes[TRACE_OF[plane]].sway_deg)
    at = max(range(len(sway)), key=lambda k: sway[k])
    panel.text(
        run.raw.t_s[at],
        sway[at] + 1.0,
        f"no filter: peak {run.swing(plane, 'peak').raw_deg:.0f}°",
        color="#666666",
        fontsize=12,
        weight="bold",
        ha="center",
        va="bottom",
    )


def _commands(panel: Axes, runs: Sequence[Run]) -> None:
    """The joystick as a filled step, and what was sent; a command beyond full speed is noted."""
    raw = runs[0].raw
    joystick = [100.0 * v for v in raw.axes[runs[0].axis].joystick]
    zero_line(panel)
    panel.fill_between(
        raw.t_s, joystick, step="post", color=JOYSTICK_COLOUR, linewidth=0, zorder=1.5
    )
    panel.text(2.3, 12.0, "joystick", color="#666666", ha="center")
    for run in runs:
        sent = [100.0 * v for v in run.shaped.axes[run.axis].sent]
        panel.plot(
            run.shaped.t_s,
            sent,
            color=PLANT_COLOUR[run.plant],
            linewidth=1.6 if run.plant == "linear" else 2.0,
            drawstyle="steps-post",
        )
        top = max(sent)
        if top > _BEYOND_PCT:
            at = run.shaped.t_s[sent.index(top)]
            panel.text(
                at + 0.15,
                min(top, _COMMAND_TOP) - 18.0,
                f"{top / 100.0:.1f} times full speed",
                color=PLANT_COLOUR[run.plant],
                fontsize=11.5,
                weight="bold",
                va="top",
            )
    panel.set_yticks([-100.0, 0.0, 100.0, 200.0], [f"{MINUS}100", "0", "100", "200"])


def _swings(panel: Axes, runs: Sequence[Run], plane: Plane) -> None:
    zero_line(panel)
    trace = TRACE_OF[plane]
    raw = runs[0].raw
    panel.plot(raw.t_s, _sway(raw.axes[trace].sway_deg), color=NONE_COLOUR, linewidth=1.3)
    for run in runs:
        panel.plot(
            run.shaped.t_s,
            _sway(run.shaped.axes[trace].sway_deg),
            color=PLANT_COLOUR[run.plant],
            linewidth=1.7 if run.plant == "linear" else 2.0,
        )


def _reductions(run: Run, plane: Plane, metrics: Sequence[str]) -> str:
    return ", ".join(
        f"{_METRIC_WORDS[m]} {change(run.swing(plane, m).reduction_pct)}"
        for m in METRICS
        if m in metrics
    )


def _largest(run: Run, plane: Plane) -> float:
    angles = [
        abs(v) for d in (run.raw, run.shaped) for v in _sway(d.axes[TRACE_OF[plane]].sway_deg)
    ]
    return math.ceil(max(angles))


def _sway(sway_deg: list[float] | None) -> list[float]:
    return sway_deg or []
