"""The picture of a doctor's runs: how late the ticks came, and what is too late."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from canshaper.commissioning.doctor.measure import Run
from canshaper.commissioning.doctor.verdict import ENDS_US, histogram, summary
from canshaper.report import style

_HEIGHT_PX = 900
_FOOT = 0.19
_LOOKS = ((style.SHAPED_COLOUR, ""), (style.RAW_COLOUR, "////"))


def figure(runs: Mapping[str, Run], tick_ms: float) -> Figure:
    """Share of the ticks by their lateness, a bar for each run, and the limit of one tick.

    Args:
        runs: by their names.
        tick_ms: the tick; a tick as late as that has missed the next deadline.
    """
    fig = style.new_figure(style.WIDTH_PX, _HEIGHT_PX, dpi=style.PRINT_DPI)
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
    panel.set_xlabel("lateness of a tick, up to", fontsize=style.TEXT_PT, color=style.TEXT_COLOUR)
    panel.set_ylabel("ticks, %", fontsize=style.TEXT_PT, color=style.TEXT_COLOUR)
    fig.suptitle(
        "How late the ticks came", x=0.012, ha="left", fontsize=style.HEAD_PT, weight="bold"
    )
    fig.legend(loc="lower left", bbox_to_anchor=(0.0, 0.0), fontsize=style.TEXT_PT, frameon=False)
    return fig


def _time(us: int) -> str:
    return f"{us} µs" if us < 1000 else f"{us // 1000} ms"
