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
from canshaper.commissioning.identification.verdict import Finding
from canshaper.report.style import (
    JOYSTICK_COLOUR,
    PRINT_DPI,
    RAW_COLOUR,
    SHAPED_COLOUR,
    TEXT_COLOUR,
    TEXT_PT,
    TITLE_PT,
    WIDTH_PX,
    new_figure,
    plain,
)

ROW_PX, TITLE_PX, FOOT_PX = 640, 38, 150
TITLE_CHARACTERS = 88
MOST_ROWS = 6
_LABEL: dict[str, Any] = {"fontsize": TEXT_PT, "color": TEXT_COLOUR}
_DATA = "#8A8A8A"


def figure(findings: Sequence[Finding], titles: Sequence[str]) -> Figure:
    """The picture.

    Args:
        findings: those in which something was found, at most ``MOST_ROWS`` are drawn.
        titles: the recommendations, a line each.
    """
    rows = list(findings)[:MOST_ROWS]
    wrapped = [line for title in titles for line in textwrap.wrap(title, TITLE_CHARACTERS)]
    top = TITLE_PX * len(wrapped) + 110
    height = top + ROW_PX * len(rows) + FOOT_PX
    fig = new_figure(WIDTH_PX, height, dpi=PRINT_DPI)
    for i, line in enumerate(wrapped):
        at = 1.0 - (40 + TITLE_PX * i) / height
        fig.text(0.012, at, line, fontsize=TITLE_PT, weight="bold", color=TEXT_COLOUR)
    grid = fig.add_gridspec(
        len(rows),
        2,
        left=0.085,
        right=0.985,
        top=1.0 - top / height,
        bottom=FOOT_PX / height,
        width_ratios=[2.0, 1],
        wspace=0.28,
        hspace=0.5,
    )
    for i, finding in enumerate(rows):
        swing, decay = fig.add_subplot(grid[i, 0]), fig.add_subplot(grid[i, 1])
        plain(swing, size=TEXT_PT)
        plain(decay, size=TEXT_PT)
        swing.set_title(
            "\n".join(textwrap.wrap(heading(finding), TITLE_CHARACTERS)),
            loc="left",
            fontsize=TITLE_PT,
            weight="bold",
            color=TEXT_COLOUR if finding.usable else RAW_COLOUR,
        )
        if finding.free is not None:
            _draw_free(swing, finding, finding.free)
            _draw_decay(decay, finding.free)
        elif finding.driven is not None:
            _draw_driven(swing, finding.driven)
            decay.set_axis_off()
    return fig


def _to_shown(kind: Kind) -> tuple[float, str]:
    """Factor and name of the unit that is drawn."""
    if kind is Kind.ANGLE:
        return math.degrees(1.0), "swing, degrees"
    if kind is Kind.RATE:
        return math.degrees(1.0), "rate of the swing, degrees/s"
    return 1.0, "signal, its own unit"


def _draw_free(panel: Axes, finding: Finding, fit: DecayFit) -> None:
    """The segment with the largest swing, of the signal with the longest, with what is around."""
    longest = max(fit.segments, key=lambda s: float(s.segment.time_s[-1]))
    same = [s for s in fit.segments if s.segment.source == longest.segment.source]
    largest = max(same, key=lambda s: float(s.envelope[0]))
    period = fit.period_s.value
    factor, unit = _to_shown(largest.segment.kind)
    source = largest.segment.source
    start = largest.segment.start_s - 3.0 * period
    end = largest.segment.start_s + float(largest.segment.time_s[-1]) + 2.0 * period
    series = next(s for s in finding.series if s.source == source)
    time, value = binned(series.time_s, series.value)
    seen = (time >= start) & (time <= end)
    panel.plot(time[seen], factor * value[seen], ".", color=_DATA, markersize=3.0)
    for one in fit.segments:
        begins = one.segment.start_s
        if one.segment.source != source or begins > end:
            continue
        at = begins + one.segment.time_s
        if at[-1] < start:
            continue
        panel.plot(at, factor * one.fitted, color=SHAPED_COLOUR, linewidth=1.8)
        for sign in (-1.0, 1.0):
            edge = factor * (one.base + sign * one.envelope)
            panel.plot(at, edge, color=SHAPED_COLOUR, linewidth=0.8, linestyle="--")
    text = f" free swing, {len(fit.segments)} found, {fit.swings:.0f} swings"
    top = 1.05 * factor * float(largest.base[0] + largest.envelope[0])
    begin = largest.segment.start_s
    panel.text(begin, top, text, color=SHAPED_COLOUR, fontsize=TEXT_PT, weight="bold")
    around = factor * (largest.base[0])
    reach = factor * float(largest.envelope[0])
    low = min(float(factor * value[seen].min()), around - reach)
    high = max(float(factor * value[seen].max()), around + reach)
    low, high = max(low, around - 3.0 * reach), min(high, around + 3.0 * reach)
    panel.set_ylim(low - 0.08 * (high - low), high + 0.2 * (high - low))
    panel.set_xlim(max(start, float(time[0])), min(end, float(time[-1])))
    panel.set_ylabel(unit, **_LABEL)
    panel.set_xlabel(f"{source}, time in s", **_LABEL)


def _draw_decay(panel: Axes, fit: DecayFit) -> None:
    """Amplitude of every half swing over the number of swings: a straight line when viscous."""
    period = fit.period_s.value
    largest = 0.0
    for one in fit.segments:
        swings, sizes = _half_swings(one, period)
        panel.plot(swings, 100.0 * sizes, "o", color=_DATA, markersize=3.5)
        largest = max(largest, float(one.segment.time_s[-1]) / period)
    count = np.linspace(0.0, largest, 50)
    ratio = fit.damping_ratio.value
    slope = 2.0 * math.pi * ratio / math.sqrt(1.0 - ratio**2)
    panel.plot(count, 100.0 * np.exp(-slope * count), color=SHAPED_COLOUR, linewidth=1.8)
    lost = 100.0 * -math.expm1(-slope)
    panel.text(
        0.97,
        0.93,
        f"{lost:.0f} % lost each swing",
        ha="right",
        va="top",
        transform=panel.transAxes,
        color=SHAPED_COLOUR,
        fontsize=TEXT_PT,
        weight="bold",
    )
    panel.set_yscale("log")
    panel.set_ylim(max(50.0 * math.exp(-slope * largest), 0.5), 200.0)
    ticks = [t for t in (1, 2, 5, 10, 20, 50, 100) if t > panel.get_ylim()[0]]
    panel.set_yticks(ticks, [f"{t}" for t in ticks])
    panel.set_yticks([], minor=True)
    panel.set_ylabel("amplitude, % of the first", **_LABEL)
    panel.set_xlabel("swings", **_LABEL)


def _half_swings(one: SegmentFit, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Swings since the start, and amplitude, of each extreme; the envelope starts at 1."""
    time = one.segment.time_s
    left = (one.segment.value - one.base) / one.envelope[0]
    # Smoothed over a tenth of a swing, so that noise makes no extremes of its own.
    width = max(1, round(0.1 * period / float(np.median(np.diff(time)))))
    smooth = np.convolve(left, np.ones(width) / width, mode="same")
    apart = max(1, round(0.35 * period / float(np.median(np.diff(time)))))
    peaks, _ = find_peaks(np.abs(smooth), distance=apart)
    return time[peaks] / period, np.abs(smooth[peaks])


def _draw_driven(panel: Axes, fit: DrivenFit) -> None:
    """The first stretches of driving."""
    stretches = fit.stretches[:3]
    for one in stretches:
        factor, unit = _to_shown(one.kind)
        at = one.start_s + one.time_s
        high = factor * float(np.abs(one.value).max())
        panel.fill_between(
            at, high * np.sign(one.command), color=JOYSTICK_COLOUR, linewidth=0, step="post"
        )
        panel.plot(at, factor * one.value, ".", color=_DATA, markersize=3.0)
        panel.plot(at, factor * one.fitted, color=SHAPED_COLOUR, linewidth=1.8)
        panel.set_ylabel(unit, **_LABEL)
    panel.set_xlabel(f"{stretches[0].source}, time in s; grey: driven", **_LABEL)
