"""Measure the figures of the pages again: show which moved by more than 10 %, or write them.

A table of README.md or docs/ between the marks

    <!-- measured: make bench -->
    <!-- end: make bench -->

holds the figures of the quick benchmarks (make bench-realtime: of the slow ones), and the commit
and the machine that gave them. --write takes no tree with changes: the commit would not say what
was measured. Write on a quiet machine.

    .venv/bin/python benchmarks/figures.py                      those that take minutes together
    .venv/bin/python benchmarks/figures.py tick                 one benchmark
    .venv/bin/python benchmarks/figures.py --write              write the tables of the quick ones
    .venv/bin/python benchmarks/figures.py --slow --write       those of the others
    .venv/bin/python benchmarks/figures.py --all                also those of no page
"""

import argparse
import re
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from measure import CONDITIONS, HEADS, Row, print_table, progress

from tools.marks import STAMP, marked, section_lines, stamped, with_sections

ROOT = Path(__file__).resolve().parents[1]
MOST_CHANGE = 0.1
ELSEWHERE = ("stops and silence",)  # tests/hil/stops.py writes it
# Options of each.
QUICK: Mapping[str, Sequence[str]] = {
    "frames": (),
    "kilohertz": (),
    "startup": (),
    "tick": (),
    "lockstep": (),
    "replay": ("--minutes", "3"),
    "large_dbc": (),
}
SLOW: Mapping[str, Sequence[str]] = {
    "lateness": ("--ticks", "1000"),
    "gateway": (),
    "memory": ("--vcan", "--minutes", "60", "--every", "30"),
}
TABLES = {"make bench": QUICK, "make bench-realtime": SLOW}
OTHERS = ("path", "logs", "identify", "tune", "hostile", "control", "campaign")
NUMBER = re.compile(r"(.*?)(-?\d+(?:\.\d+)?)?")
SOURCES = ("canshaper", "sim", "benchmarks", "config", "dbc", "pyproject.toml")


class BenchmarkError(Exception):
    """A benchmark ended with an error, or printed no figures."""


@dataclass(frozen=True)
class Table:
    """A table of a page.

    Attributes:
        page: that has it.
        command: name of its mark.
        lines: between the marks.
    """

    page: Path
    command: str
    lines: Sequence[str]

    @property
    def names(self) -> list[str]:
        """Its benchmarks."""
        return [*TABLES[self.command]]

    @property
    def rows(self) -> list[list[str]]:
        """Cells of its rows, without the heads."""
        return [cells_of(line) for line in self.lines if line.startswith("| ")][1:]

    def faults(self) -> list[str]:
        """Differences from the form in which the benchmarks write it."""
        where = f"{self.page.name}: {self.command}"
        if self.command not in TABLES:
            return [f"{where}: expected a mark of {' or '.join(TABLES)}"]
        faults = []
        if [cells_of(line) for line in self.lines[:1]] != [list(HEADS)]:
            faults.append(f"{where}: expected the columns {', '.join(HEADS)}")
        titles = [one.title for n in self.names for one in import_module(n).FIGURES]
        if [row[0] for row in self.rows] != titles:
            faults.append(f"{where}: expected the rows {'; '.join(titles)}")
        if not self.lines or not STAMP.match(self.lines[-1]):
            faults.append(f"{where}: expected a last line that begins with Commit `HASH`")
        return faults


@dataclass(frozen=True)
class Measured:
    """Lines of the table, as a benchmark printed them, and its conditions."""

    lines: list[str]
    conditions: str


def cells_of(line: str) -> list[str]:
    """Cells of a row of a Markdown table."""
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def tables(root: Path) -> list[Table]:
    """All measured tables of the pages."""
    found = []
    for page in (root / "README.md", *sorted((root / "docs").rglob("*.md"))):
        text = page.read_text(encoding="utf-8")
        names = [name for name in marked(text, "measured") if name not in ELSEWHERE]
        found += [Table(page, name, section_lines(text, "measured", name)) for name in names]
    return found


def measure(name: str) -> Measured:
    """Run a benchmark.

    Raises:
        BenchmarkError: it failed.
    """
    options = {**QUICK, **SLOW}.get(name, ())
    command = [sys.executable, str(ROOT / "benchmarks" / f"{name}.py"), *options]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise BenchmarkError(f"exit {done.returncode}\n{done.stdout}")
    lines = done.stdout.splitlines()
    figures = [line for line in lines if line.startswith("| ")][1:]
    at = [line.removeprefix(CONDITIONS) for line in lines if line.startswith(CONDITIONS)]
    if name in OTHERS:
        print(done.stdout)
    elif not figures or not at:
        raise BenchmarkError(f"no figures\n{done.stdout}")
    return Measured(figures, at[0] if at else "")


def measured_all(names: Sequence[str]) -> tuple[dict[str, Measured], dict[str, str]]:
    """Output of the benchmarks, by name; those that failed, with the reason."""
    results, failed = {}, {}
    for number, name in enumerate(names, 1):
        progress(f"[{number}/{len(names)}] {name}")
        begin = time.monotonic()
        try:
            results[name] = measure(name)
        except BenchmarkError as error:
            failed[name] = str(error)
        end = "FAILED" if name in failed else "done"
        progress(f"[{number}/{len(names)}] {name}: {end} after {time.monotonic() - begin:.0f} s")
    return results, failed


def change(then: str, now: str) -> str | None:
    """Change of a cell: per cent of its number beyond 10, or ``new`` for other text."""
    (text, old), (new_text, new) = (NUMBER.fullmatch(cell).groups() for cell in (then, now))  # type: ignore[union-attr]
    if text != new_text or (old is None) != (new is None):
        return "new"
    if old is None or float(old) == float(new):
        return None
    if not float(old):
        return "new"
    part = round(float(new) / float(old) - 1.0, 9)
    return f"{100 * part:+.0f} %" if abs(part) > MOST_CHANGE else None


def moved(table: Table, results: Mapping[str, Measured]) -> list[Row]:
    """Cells that are no more as the page shows them."""
    there, found = {title: cells for title, *cells in table.rows}, []
    for name in table.names:
        for line in results[name].lines if name in results else ():
            title, *now = cells_of(line)
            for head, old, new in zip(HEADS[1:], there.get(title, [""] * 4), now, strict=True):
                if by := change(old, new):
                    found.append(Row(table.page.name, [title, head, old, new, by]))
    return found


def written(table: Table, results: Mapping[str, Measured], stamp: str) -> list[str]:
    """Lines of a table with what was measured now."""
    rows = [line for name in table.names for line in results[name].lines]
    heads = [f"| {' | '.join(HEADS)} |", f"|{'---|' * len(HEADS)}"]
    machines: dict[str, list[str]] = {}
    for name in table.names:
        machines.setdefault(results[name].conditions, []).append(name)
    conditions = [f"{', '.join(names)}: {machine}" for machine, names in machines.items()]
    return [*heads, *rows, "", f"{stamp}; {'; '.join(conditions)}."]


def report(rows: Sequence[Row], failed: Mapping[str, str]) -> None:
    """Print what moved, and the benchmarks that failed."""
    if rows:
        print_table(["figure", "column", "then", "now", "change"], rows)
    print(f"{len(rows)} cells moved by more than {MOST_CHANGE:.0%}")
    for name, reason in failed.items():
        print(f"FAILED: {name}: {reason}")


def chosen(
    options: argparse.Namespace, all_tables: Iterable[Table]
) -> tuple[list[str], list[Table]]:
    """Benchmarks to run and tables to compare; a table is written as a whole."""
    names = options.names or [*(SLOW if options.slow else QUICK), *(OTHERS if options.all else ())]
    shown = [table for table in all_tables if set(table.names) & set(names)]
    if options.write:
        names = list(dict.fromkeys(name for table in shown for name in table.names))
    return names, shown


def main(words: Sequence[str] | None = None) -> int:
    """Run, compare, write; the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    known = {*QUICK, *SLOW, *OTHERS}
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(sorted(known))}")
    parser.add_argument("--slow", action="store_true", help=", ".join(SLOW))
    parser.add_argument("--all", action="store_true", help=f"also {', '.join(OTHERS)}")
    parser.add_argument("--write", action="store_true", help="write the tables")
    options = parser.parse_args(words)
    if unknown := sorted({*options.names} - known):
        parser.error(f"no benchmark {', '.join(unknown)}; there are {', '.join(sorted(known))}")
    every = tables(ROOT)
    # A table that is written may be wrong before.
    judged = [table for table in every if not options.write or table.command not in TABLES]
    if wrong := [fault for table in judged for fault in table.faults()]:
        parser.error("\n".join(wrong))
    names, shown = chosen(options, every)
    stamp = stamped(*SOURCES) if options.write else ""
    results, failed = measured_all(names)
    report([row for table in shown for row in moved(table, results)], failed)
    for table in shown if options.write else ():
        if failed.keys() & set(table.names):
            print(f"not written: {table.page.name}: {table.command}")
            continue
        text = table.page.read_text(encoding="utf-8")
        lines = written(table, results, stamp)
        table.page.write_text(with_sections(text, {table.command: lines}, "measured"), "utf-8")
        print(f"written: {table.page.name}: {table.command}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
