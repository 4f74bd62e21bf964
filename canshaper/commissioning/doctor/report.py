"""What the doctor found, for people and as numbers."""

import platform
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table
from rich.text import Text

from canshaper.commissioning.doctor.measure import Run
from canshaper.commissioning.doctor.verdict import (
    ENDS_US,
    Finding,
    Level,
    Summary,
    fit,
    histogram,
    summary,
)
from canshaper.machine.deployment import Deployment
from canshaper.report.console import (
    HEAD_PT,
    PRINT_DPI,
    RAW_COLOUR,
    SHAPED_COLOUR,
    TEXT_COLOUR,
    TEXT_PT,
    WIDTH_PX,
    new_figure,
    new_table,
    plain,
)

STYLES = {Level.OK: "green", Level.NOTE: "dim", Level.WARNING: "yellow", Level.BAD: "bold red"}
BAR = 22
EIGHTHS = "▏▎▍▌▋▊▉"
# Titles of the times of a run, by its fields.
TIMES = {
    "late_ns": "tick lateness",
    "joystick_ns": "joystick to valve",
    "valve_ns": "tick to valve frame",
    "tick_ns": "whole tick",
}


def as_dict(
    deployment: Deployment, seconds: float, runs: dict[str, Run], findings: list[Finding]
) -> dict[str, Any]:
    """Everything as plain data; times in us."""
    return {
        "file": str(deployment.path),
        "fit": fit(findings),
        "tick_ms": deployment.config.tick_ms,
        "seconds": seconds,
        "kernel": f"{platform.release()} {platform.version()}",
        "runs": {name: _run_dict(run) for name, run in runs.items()},
        "findings": [asdict(f) | {"level": f.level.value} for f in findings],
    }


def _run_dict(run: Run) -> dict[str, Any]:
    times: dict[str, Any] = {}
    for field in TIMES:
        samples: list[int] = getattr(run, field)
        figures = summary(samples)
        bins = [{"up_to": end, "count": count} for end, count in histogram(samples).items()]
        key = field.replace("_ns", "_us")
        times[key] = (asdict(figures) if figures else {}) | {"histogram": bins}
    return times | {
        "ticks": len(run.late_ns),
        "missed": run.missed,
        "faults": run.faults,
        "stops": [event for event in run.events if event[1] in ("STOPPING", "TRIPPED")],
        "moved": run.moved,
        "real_time": run.policy is None,
        "memory_locked": run.memory is None,
    }


def print_report(
    deployment: Deployment,
    seconds: float,
    runs: dict[str, Run],
    findings: list[Finding],
    console: Console,
) -> None:
    """Histograms, figures, findings with their remedies, verdict."""
    names = " and ".join(runs)
    console.print(
        f"{deployment.path}: tick {deployment.config.tick_ms} ms, {len(deployment.axes)} axes;"
        f" {seconds:g} s {names}. Nothing was sent on any bus.\n",
        soft_wrap=True,
    )
    for field in ("late_ns", "joystick_ns"):
        console.print(_histograms(TIMES[field], {n: getattr(r, field) for n, r in runs.items()}))
    console.print(_figures(runs))
    for finding in findings:
        console.print(_line(finding), soft_wrap=True)
    console.print(_verdict(findings), soft_wrap=True)


def _histograms(title: str, series: dict[str, list[int]]) -> Table:
    """Bars side by side, one row for each bin."""
    head = f"{title}, us"
    table = new_table("up to", title=head)
    counts = {name: histogram(times) for name, times in series.items()}
    for name in counts:
        table.add_column("", justify="right", no_wrap=True)
        table.add_column(name, width=BAR, no_wrap=True)
    most = {name: max(bins.values(), default=1) for name, bins in counts.items()}
    ends = sorted({end for bins in counts.values() for end in bins})
    for end in ends:
        cells = [f"{end:5}"]
        for name, bins in counts.items():
            cells += [str(bins.get(end, 0) or ""), _bar(bins.get(end, 0), most[name])]
        table.add_row(*cells)
    return table


def _bar(count: int, most: int) -> str:
    """A bar in eighths of a character; one frame in a thousand is still to be seen."""
    if count == 0:
        return ""
    eighths = max(round(8 * BAR * count / most), 1)
    rest = eighths % 8
    return "█" * (eighths // 8) + EIGHTHS[rest - 1 : rest]


def _figures(runs: dict[str, Run]) -> Table:
    table = new_table("us", "p50", "p99", "p99.9", "max", "of")
    for field, title in TIMES.items():
        for name, run in runs.items():
            table.add_row(f"{title}, {name}", *_cells(summary(getattr(run, field))))
    return table


def _cells(figures: Summary | None) -> Iterator[str]:
    if figures is None:
        yield from "-----"
        return
    for value in (figures.p50, figures.p99, figures.p99_9, figures.max):
        yield f"{value:.0f}"
    yield str(figures.count)


def _line(finding: Finding) -> Text:
    level = Text(f"{finding.level.value:8}", style=STYLES[finding.level])
    line = Text.assemble(level, f"{finding.subject}: {finding.found}")
    if finding.remedy:
        remedy = finding.remedy.replace("\n", "\n           ")
        line.append(f"\n        -> {remedy}", style="bold")
    return line


def _verdict(findings: list[Finding]) -> Text:
    count = {level: sum(f.level is level for f in findings) for level in Level}
    warnings = count[Level.WARNING]
    text = f"{warnings} warning{'' if warnings == 1 else 's'}"
    if fit(findings):
        return Text(f"\nFit for this deployment, {text}.", style="bold green")
    bad = [f.subject for f in findings if f.level is Level.BAD]
    return Text(f"\nNot fit for this deployment: {', '.join(bad)}; {text}.", style="bold red")


_HEIGHT_PX = 900
_FOOT = 0.19
_LOOKS = ((SHAPED_COLOUR, ""), (RAW_COLOUR, "////"))


def figure(runs: Mapping[str, Run], tick_ms: float) -> Figure:
    """Share of the ticks by their lateness, a bar for each run, and the limit of one tick.

    Args:
        runs: by their names.
        tick_ms: the tick; a tick as late as that has missed the next deadline.
    """
    fig = new_figure(WIDTH_PX, _HEIGHT_PX, dpi=PRINT_DPI)
    panel = fig.add_axes((0.09, _FOOT, 0.9, 0.9 - _FOOT))
    plain(panel, size=TEXT_PT)
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
    panel.axvline(below - 0.5, color=TEXT_COLOUR, linestyle="--", linewidth=1.2)
    panel.text(
        below - 0.55, 130.0, f"limit: one tick, {tick_ms:g} ms", ha="right", fontsize=TEXT_PT
    )
    panel.set_xlim(-0.7, max(len(ends), below) - 0.3)
    panel.set_xticks(range(len(ends)), [_time(end) for end in ends])
    panel.set_xlabel("lateness of a tick, up to", fontsize=TEXT_PT, color=TEXT_COLOUR)
    panel.set_ylabel("ticks, %", fontsize=TEXT_PT, color=TEXT_COLOUR)
    fig.suptitle("How late the ticks came", x=0.012, ha="left", fontsize=HEAD_PT, weight="bold")
    fig.legend(loc="lower left", bbox_to_anchor=(0.0, 0.0), fontsize=TEXT_PT, frameon=False)
    return fig


def _time(us: int) -> str:
    return f"{us} µs" if us < 1000 else f"{us // 1000} ms"
