"""Report of the doctor, for people and as numbers."""

import platform
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from canshaper.commissioning.doctor.measure import Run
from canshaper.commissioning.doctor.verdict import Finding, Level, Summary, fit, histogram, summary
from canshaper.machine.deployment import Deployment
from canshaper.report.console import new_table

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
    """Return the report as JSON data; times of the runs in microseconds."""
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
    """Print histograms, figures, findings with their remedies, and the verdict."""
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
    """Return histograms of times, ns, by name, side by side: a row for each bin."""
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
    """Return a bar, ``BAR`` characters for ``most``, in eighths of one; a count of 1 shows."""
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
