"""The picture of a tuning: the answer to a full press, and the swing left at wrong lengths.

It uses the object API of matplotlib, like ``canshaper.report.plot``.
"""

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from canshaper.design.tuning.deploy import Setting
from canshaper.design.tuning.evaluate import Evaluation, Machine, Traces, gff, press
from canshaper.design.tuning.preference import Choice
from canshaper.report.console import axis_title
from canshaper.report.style import (
    JOYSTICK_COLOUR,
    MINUS,
    RAW_COLOUR,
    SHAPED_COLOUR,
    TEXT_COLOUR,
    new_figure,
    plain,
)
from canshaper.shaping.sway import SwayMode

SIZE_PX = (1500, 720)
_LABEL: dict[str, Any] = {"fontsize": 11, "color": TEXT_COLOUR}


def figure(
    *,
    axis: str,
    setting: Setting,
    mode: SwayMode,
    tick_s: float,
    machine: Machine,
    full_speed_m_s: float,
    before: Setting | None = None,
    choices: Sequence[Choice] = (),
) -> Figure:
    """Return the picture of a setting.

    Args:
        tick_s: period of the axis, s.
        machine: limits and valve behind the filter.
        full_speed_m_s: speed of the tip at full command, for the swing in degrees.
        before: the setting in the file, for comparison.
        choices: the front from quick to calm from which the setting was chosen, drawn below.
    """
    duration_s = max(3.0, 1.5 * setting.measures.run_on_s, 1.5 * mode.period_s)
    shaper = gff(setting.poles_rad_s, setting.third_pole_rad_s)
    traces = press(mode, tick_s, shaper, machine, duration_s)
    fig = new_figure(*SIZE_PX)
    fig.text(0.052, 0.955, finding(axis, setting), fontsize=17, weight="bold", color=TEXT_COLOUR)
    fig.text(0.052, 0.912, _poles(setting), fontsize=12, color=TEXT_COLOUR)
    halves = fig.add_gridspec(
        1, 2, left=0.052, right=0.985, top=0.865, bottom=0.085, wspace=0.13, width_ratios=[1.25, 1]
    )
    left = halves[0].subgridspec(2, 1, hspace=0.12)
    command = fig.add_subplot(left[0])
    swing = fig.add_subplot(left[1], sharex=command)
    right = halves[1].subgridspec(2 if choices else 1, 1, hspace=0.3)
    length = fig.add_subplot(right[0])
    for panel in (command, swing, length):
        plain(panel)
    if choices:
        _draw_front(fig.add_subplot(right[1]), choices, setting.measures)
    _draw_command(command, traces, setting.measures)
    to_deg = math.degrees(mode.angle_per_speed_rad * full_speed_m_s)
    _draw_swing(swing, traces, to_deg)
    _draw_length(length, setting.measures, before.measures if before else None)
    return fig


def finding(axis: str, setting: Setting) -> str:
    """Return the effect of the setting as a sentence: "Slew: 4 % of the swing is left, ...".

    Shares refer to the swing that the same movement of the joystick leaves without the filter.
    """
    m = setting.measures
    return (
        f"{axis_title(axis)}: {100 * m.worst(0.0):.0f} % of the swing is left,"
        f" at most {100 * m.worst(10.0):.0f} % within ±10 % length;"
        f" run-on {m.run_on_s:.1f} s"
    )


def _poles(setting: Setting) -> str:
    poles = [
        *setting.poles_rad_s,
        *([setting.third_pole_rad_s] if setting.third_pole_rad_s else []),
    ]
    text = ", ".join(f"{p:.2f}".replace("-", MINUS) for p in poles)
    return f"G_FF with poles {text} rad/s (a1 = {setting.a1:g} s, a2 = {setting.a2:g} s²)"


def _draw_command(panel: Axes, traces: Traces, measures: Evaluation) -> None:
    lead = 0.06 * traces.t_s[-1]
    time = [-lead, 0.0, *traces.t_s]
    sent = [0.0, 0.0, *traces.sent]
    panel.fill_between([0.0, traces.t_s[-1]], [100.0, 100.0], color=JOYSTICK_COLOUR, linewidth=0)
    panel.plot(
        time, [100.0 * v for v in sent], color=SHAPED_COLOUR, linewidth=2.2, drawstyle="steps-post"
    )
    panel.set_ylim(min(-5.0, 110.0 * min(sent)), max(118.0, 112.0 * max(sent)))
    panel.set_xlim(-lead, traces.t_s[-1])
    panel.set_ylabel("speed, % of full", **_LABEL)
    panel.tick_params(labelbottom=False)
    panel.text(traces.t_s[-1], 102.0, "joystick", ha="right", va="bottom", color="#666666")
    panel.text(
        measures.run_on_s,
        55.0,
        " sent to the valve,\n limits included",
        color=SHAPED_COLOUR,
        fontsize=12,
        weight="bold",
    )
    panel.axvline(measures.run_on_s, color="#888888", linewidth=1.0, linestyle=":")
    panel.text(
        measures.run_on_s,
        10.0,
        f" filter within 5 %\n after {measures.run_on_s:.2f} s",
        fontsize=10,
        color="#666666",
    )


def _draw_swing(panel: Axes, traces: Traces, to_deg: float) -> None:
    rows = (
        (traces.swing_raw, "without filter", RAW_COLOUR, 1.4),
        (traces.swing, "with filter, predicted", SHAPED_COLOUR, 2.2),
    )
    largest = max(abs(v) * to_deg for v in traces.swing_raw)
    panel.axhline(0.0, color="#AAAAAA", linewidth=0.8)
    for values, text, colour, width in rows:
        degrees = [to_deg * v for v in values]
        panel.plot(traces.t_s, degrees, color=colour, linewidth=width)
        at = max(range(len(degrees)), key=lambda k: degrees[k])
        panel.annotate(
            f"{text}: {degrees[at]:.1f}°",
            xy=(traces.t_s[at], degrees[at]),
            xytext=(10, 4),
            textcoords="offset points",
            color=colour,
            fontsize=12,
            weight="bold",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
        )
    panel.set_ylim(-1.15 * largest, 1.3 * largest)
    panel.set_ylabel("swing of the grapple, degrees", **_LABEL)
    panel.set_xlabel("time after a full press, s", **_LABEL)


def _draw_front(panel: Axes, choices: Sequence[Choice], chosen: Evaluation) -> None:
    """Draw dip and swing left over the rise time of each setting of the front."""
    plain(panel)
    rise_s = [one.felt[0] for one in choices]
    for at, text, colour in ((2, "dip while held", "#56A0D3"), (3, "left, ±10 %", SHAPED_COLOUR)):
        panel.plot(rise_s, [100.0 * one.felt[at] for one in choices], "o", color=colour, label=text)
    panel.axvline(chosen.rise_s, color="#888888", linewidth=1.0, linestyle=":")
    panel.set_xlabel("rise to 95 %, s: quick to calm; dotted: this setting", **_LABEL)
    panel.set_ylabel("%", **_LABEL)
    panel.legend(loc="upper right", frameon=False)


def _draw_length(panel: Axes, measures: Evaluation, before: Evaluation | None) -> None:
    """Draw the residual over the length error; the names stand at the ends of the curves."""
    errors = [r.length_pct for r in measures.residuals]
    curves = [
        ([r.machine for r in measures.residuals], "through limits and valve", SHAPED_COLOUR, "-"),
        ([r.linear for r in measures.residuals], "filter alone", "#56A0D3", "--"),
    ]
    if before is not None:
        was = [r.machine for r in before.residuals]
        curves.append((was, "in the file now", RAW_COLOUR, ":"))
    top = 100.0 * max(max(values) for values, *_ in curves)
    for i, (values, text, colour, style) in enumerate(curves):
        percent = [100.0 * v for v in values]
        panel.plot(errors, percent, style, color=colour, linewidth=2.2, marker="o", markersize=4)
        panel.text(
            errors[-1],
            top * (1.18 - 0.075 * i),
            text,
            color=colour,
            fontsize=12,
            weight="bold",
            ha="right",
        )
    panel.set_ylim(0.0, 1.28 * top)
    panel.set_xticks(errors, [f"{e:+g}".replace("-", MINUS) if e else "0" for e in errors])
    panel.set_xlabel("true pendulum length against the sway data, %", **_LABEL)
    panel.set_ylabel("swing left, % of that without filter", **_LABEL)
