"""Benchmarks measure processor time, print tables, and publish figures for the pages."""

import os
import platform
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage

HEADS = ("figure", "measured", "peer", "ratio", "required")
CONDITIONS = "conditions: "


def cpu_s(work: Callable[[], object]) -> float:
    """Processor time of one call, that of processes that it started and that ended included."""

    def used_s() -> float:
        both = getrusage(RUSAGE_SELF), getrusage(RUSAGE_CHILDREN)
        return sum(usage.ru_utime + usage.ru_stime for usage in both)

    begin_s = used_s()
    work()
    return used_s() - begin_s


def medians_s(works: Mapping[str, Callable[[], object]], runs: int) -> dict[str, float]:
    """Median processor time of each of these calls, s; they run in turn."""
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(runs):
        for name, work in works.items():
            times[name].append(cpu_s(work))
    return {name: statistics.median(row) for name, row in times.items()}


def quantile(values: Sequence[float], share: float) -> float:
    """The value that this share of all does not exceed."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


@dataclass(frozen=True)
class Row:
    """A title and cells of a table."""

    title: str
    cells: Sequence[str]


def print_table(heads: Sequence[str], rows: Sequence[Row]) -> None:
    """Print a plain table, titles to the left, figures to the right."""
    left = max(len(row.title) for row in rows)
    widths = [max(len(head), *(len(row.cells[i]) for row in rows)) for i, head in enumerate(heads)]
    print(" " * left, *(h.rjust(w) for h, w in zip(heads, widths, strict=True)), sep="  ")
    for row in rows:
        cells = (c.rjust(w) for c, w in zip(row.cells, widths, strict=True))
        print(row.title.ljust(left), *cells, sep="  ", flush=True)


# -- figures of the pages ----------------------------------------------------------------------


@dataclass(frozen=True)
class Figure:
    """A figure that a page shows.

    Attributes:
        title: with its unit.
        peer: program or part that is measured with it in the same run, if any.
        most: the figure that is allowed, if any is required.
        most_ratio: the ratio to the peer that is allowed, if any is required.
    """

    title: str
    peer: str = ""
    most: float | None = None
    most_ratio: float | None = None

    def line(self, measured: float, peer: float | None = None) -> str:
        """Row of the page's table."""
        ratio = measured / peer if peer else None
        required = ""
        if self.most is not None:
            required = f"at most {self.most:g}: {'yes' if measured <= self.most else 'no'}"
        elif self.most_ratio is not None and ratio is not None:
            met = "yes" if ratio <= self.most_ratio else "no"
            required = f"ratio at most {self.most_ratio:g}: {met}"
        with_peer = "" if peer is None else f"{self.peer} {digits(peer)}"
        cells = (self.title, digits(measured), with_peer, ratio and f"{ratio:.2f}", required)
        return f"| {' | '.join(cell or '' for cell in cells)} |"


def digits(value: float) -> str:
    """Three digits, or all before the point."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def publish(figures: Sequence[Figure], values: Sequence[Sequence[float]]) -> None:
    """Print the table of a page: measured and peer of each figure; and the conditions."""
    print(f"\n{CONDITIONS}{conditions()}")
    print(f"| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}")
    for figure, numbers in zip(figures, values, strict=True):
        print(figure.line(*numbers), flush=True)


def progress(text: str) -> None:
    """Print what is done."""
    print(f"  {text}", file=sys.stderr, flush=True)


def in_lane() -> bool:
    """Whether this is the virtual machine with CAN interfaces."""
    return os.environ.get("CANSHAPER_LANE") == "tcg"


def conditions() -> str:
    """Processor or clock, kernel and Python of this machine."""
    programs = f"kernel {platform.release()}, Python {platform.python_version()}"
    if in_lane():
        return f"1 instruction = 1 ns, {os.cpu_count()} core, {programs}"
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    models = [line.partition(": ")[2] for line in lines if line.startswith("model name")]
    return f"{models[0] if models else platform.machine()}, {os.cpu_count()} cores, {programs}"
