"""The picture of an identification: the swing with its fit, and how it decays, a row a finding.

Drawn through the object API of matplotlib, like ``canshaper.report.plot``.
"""

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import find_peaks

from canshaper.commissioning.identification.decay import DecayFit, SegmentFit
from canshaper.commissioning.identification.driven import DrivenFit
from canshaper.commissioning.identification.report import heading
from canshaper.commissioning.identification.series import Kind, binned
from canshaper.commissioning.identification.verdict import SwingFinding
from canshaper.report import style

ROW_PX, TITLE_PX, FOOT_PX = 640, 38, 150
TITLE_CHARACTERS = 88
MOST_ROWS = 6
_FIT: dict[str, Any] = {"color": style.SHAPED_COLOUR, "linewidth": 1.8}
_NAME: dict[str, Any] = {"color": style.SHAPED_COLOUR, "fontsize": style.TEXT_PT, "weight": "bold"}
_DATA: dict[str, Any] = {"color": "#8A8A8A", "markersize": 3.0}
_UNITS = {
    Kind.ANGLE: "swing, degrees",
    Kind.RATE: "rate of the swing, degrees/s",
    Kind.OTHER: "signal, its own unit",
}


def figure(findings: Sequence[SwingFinding], titles: Sequence[str]) -> Figure:
    """Draw the picture of an identification.

    Args:
        findings: those with a swing; at most ``MOST_ROWS`` are drawn.
        titles: the recommendations, a line each.
    """
    rows = list(findings)[:MOST_ROWS]
    wrapped = [line for title in titles for line in textwrap.wrap(title, TITLE_CHARACTERS)]
    top = TITLE_PX * len(wrapped) + 110
    height = top + ROW_PX * len(rows) + FOOT_PX
    fig = style.print_figure(height)
    bold: dict[str, Any] = {"fontsize": style.TITLE_PT, "weight": "bold"}
    for i, line in enumerate(wrapped):
        fig.text(0.012, 1.0 - (40 + TITLE_PX * i) / height, line, color=style.TEXT_COLOUR, **bold)
    edges = {"left": 0.085, "right": 0.985, "top": 1.0 - top / height, "bottom": FOOT_PX / height}
    grid = fig.add_gridspec(len(rows), 2, width_ratios=[2.0, 1], wspace=0.28, hspace=0.5, **edges)
    for i, finding in enumerate(rows):
        swing, decay = fig.add_subplot(grid[i, 0]), fig.add_subplot(grid[i, 1])
        style.plain(swing, size=style.TEXT_PT)
        style.plain(decay, size=style.TEXT_PT)
        title = "\n".join(textwrap.wrap(heading(finding), TITLE_CHARACTERS))
        colour = style.TEXT_COLOUR if finding.usable else style.RAW_COLOUR
        swing.set_title(title, loc="left", color=colour, **bold)
        if finding.free is not None:
            _draw_free(swing, finding, finding.free)
            _draw_decay(decay, finding.free)
        elif finding.driven is not None:
            _draw_driven(swing, finding.driven)
            decay.set_axis_off()
    return fig


def _draw_free(panel: Axes, finding: SwingFinding, fit: DecayFit) -> None:
    """Draw the largest free swing of the signal with the longest one, and what is around it."""
    source = max(fit.segments, key=lambda s: float(s.segment.time_s[-1])).segment.source
    same = [s for s in fit.segments if s.segment.source == source]
    largest = max(same, key=lambda s: float(s.envelope[0]))
    period, segment = fit.period_s.value, largest.segment
    factor, _ = segment.kind.shown
    start, end = segment.start_s - 3.0 * period, segment.end_s + 2.0 * period
    series = next(s for s in finding.series if s.source == source)
    time, value = binned(series.time_s, series.value)
    seen = (time >= start) & (time <= end)
    panel.plot(time[seen], factor * value[seen], ".", **_DATA)
    for one in same:
        at = one.segment.start_s + one.segment.time_s
        if at[0] > end or at[-1] < start:
            continue
        panel.plot(at, factor * one.fitted, **_FIT)
        for sign in (-1.0, 1.0):
            edge = factor * (one.base + sign * one.envelope)
            panel.plot(at, edge, color=style.SHAPED_COLOUR, linewidth=0.8, linestyle="--")
    text = f" free swing, {len(fit.segments)} found, {fit.swings:.0f} swings"
    middle, reach = factor * largest.base[0], factor * float(largest.envelope[0])
    top = 1.05 * factor * float(largest.base[0] + largest.envelope[0])
    panel.text(segment.start_s, top, text, **_NAME)
    low = max(min(float(factor * value[seen].min()), middle - reach), middle - 3.0 * reach)
    high = min(max(float(factor * value[seen].max()), middle + reach), middle + 3.0 * reach)
    panel.set_ylim(low - 0.08 * (high - low), high + 0.2 * (high - low))
    panel.set_xlim(max(start, float(time[0])), min(end, float(time[-1])))
    style.label(panel, f"{source}, time in s", _UNITS[segment.kind])


def _draw_decay(panel: Axes, fit: DecayFit) -> None:
    """Draw the amplitude of each half swing; viscous damping makes a straight line."""
    period, ratio = fit.period_s.value, fit.damping_ratio.value
    for one in fit.segments:
        swings, sizes = _half_swings(one, period)
        panel.plot(swings, 100.0 * sizes, "o", **{**_DATA, "markersize": 3.5})
    most = max(float(one.segment.time_s[-1]) / period for one in fit.segments)
    count = np.linspace(0.0, most, 50)
    slope = 2.0 * math.pi * ratio / math.sqrt(1.0 - ratio**2)
    panel.plot(count, 100.0 * np.exp(-slope * count), **_FIT)
    text = f"{100.0 * -math.expm1(-slope):.0f} % lost each swing"
    panel.text(0.97, 0.93, text, ha="right", va="top", transform=panel.transAxes, **_NAME)
    panel.set_yscale("log")
    panel.set_ylim(max(50.0 * math.exp(-slope * most), 0.5), 200.0)
    ticks = [t for t in (1, 2, 5, 10, 20, 50, 100) if t > panel.get_ylim()[0]]
    panel.set_yticks(ticks, [f"{t}" for t in ticks])
    panel.set_yticks([], minor=True)
    style.label(panel, "swings", "amplitude, % of the first")


def _half_swings(one: SegmentFit, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Return number of swings since the start and amplitude of each extreme; the first is 1."""
    time = one.segment.time_s
    left = (one.segment.value - one.base) / one.envelope[0]
    samples = period / float(np.median(np.diff(time)))
    # Smoothed over a tenth of a swing, so that noise makes no extremes of its own.
    width, apart = max(1, round(0.1 * samples)), max(1, round(0.35 * samples))
    smooth = np.abs(np.convolve(left, np.ones(width) / width, mode="same"))
    peaks, _ = find_peaks(smooth, distance=apart)
    return time[peaks] / period, smooth[peaks]


def _draw_driven(panel: Axes, fit: DrivenFit) -> None:
    """Draw the first stretches of driving."""
    for data, fitted, speed in fit.stretches[:3]:
        factor, at = data.kind.shown[0], data.start_s + data.time_s
        driven = factor * float(np.abs(data.value).max()) * np.sign(speed)
        panel.fill_between(at, driven, color=style.JOYSTICK_COLOUR, linewidth=0, step="post")
        panel.plot(at, factor * data.value, ".", **_DATA)
        panel.plot(at, factor * fitted, **_FIT)
    first = fit.stretches[0].data
    style.label(panel, f"{first.source}, time in s; grey: driven", _UNITS[first.kind])
