"""Text on a terminal: safe names, one look of tables, one progress bar, report of two drives."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from canshaper.errors import printable
from canshaper.report.metrics import HORIZONTAL_DEG, MIN_RAW_DEG

MOST_COLUMNS = 10_000  # of a terminal wide enough for any table


class SafeConsole(Console):
    """A console of rich that prints names from files and logs as plain text, whatever is in them.

    Brackets are no markup, and control characters are printed visibly, so that a file can neither
    colour nor clear the terminal, nor give it commands.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield segments of printable text; rich's own control segments stay as they are."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text), style, control)


class WholeTable(Table):
    """A table that loses no digit on a narrow terminal: it splits into several tables instead."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the whole table if it fits, else parts that each repeat the first column."""
        if len(self.columns) < 2 or self._width(console, options) <= options.max_width:
            yield from super().__rich_console__(console, options)
            return
        groups: list[list[int]] = [[]]
        for number in range(1, len(self.columns)):
            wider = self._part([*groups[-1], number])
            if groups[-1] and wider._width(console, options) > options.max_width:
                groups.append([])
            groups[-1].append(number)
        for number, group in enumerate(groups):
            part = self._part(group)
            part.title = None if number else self.title
            yield from Table.__rich_console__(part, console, options)

    def _width(self, console: Console, options: ConsoleOptions) -> int:
        """Return the number of terminal columns that the table needs."""
        return self.__rich_measure__(console, options.update(max_width=MOST_COLUMNS)).maximum

    def _part(self, numbers: list[int]) -> "WholeTable":
        """Return a table of the first column and these; only the first column may wrap."""
        part = WholeTable(
            title_justify="left", box=self.box, padding=self.padding, pad_edge=self.pad_edge
        )
        chosen = [self.columns[0], *(self.columns[number] for number in numbers)]
        for column in chosen:
            part.add_column(
                column.header,
                justify=column.justify,
                width=column.width,
                no_wrap=column is not self.columns[0],
            )
        cells = zip(*(column.cells for column in chosen), strict=True)
        for row, texts in zip(self.rows, cells, strict=True):
            part.add_row(*texts, style=row.style, end_section=row.end_section)
        return part


def new_table(first: str, *heads: str, title: str | None = None) -> Table:
    """Return a table without rows: a column of words, then columns of figures; no cell wraps."""
    table = WholeTable(
        title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False
    )
    table.add_column(first, no_wrap=True)
    for head in heads:
        table.add_column(head, justify="right", no_wrap=True)
    return table


class OnProgress(Protocol):
    """A function called with the part done, and with the name of the next step when it changes."""

    def __call__(self, done: float, what: str | None = None) -> None:
        """Show that ``done`` of the bar's total is done."""


@contextmanager
def progress_bar(what: str, total: float = 1.0, *, refresh_hz: float = 10) -> Iterator[OnProgress]:
    """Show a bar on stderr until done, none if stderr is no terminal; give its ``OnProgress``."""
    console = SafeConsole(stderr=True)
    with Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        refresh_per_second=refresh_hz,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(what, total=total)

        def on_progress(done: float, what: str | None = None) -> None:
            bar.update(task, completed=min(done, total), description=what)

        yield on_progress


PairRow = tuple[str, str, float, int]  # words, name of the measure, scale, digits

NOTHING = "-"
_DRIVES = {"filters off": "raw", "filters on": "shaped"}
_AXES_A_TABLE = 3  # as many as fit 80 columns
_SWAY_ROWS = (
    ("peak sway, deg", "peak"),
    ("RMS sway, deg", "rms"),
    ("residual sway, deg", "residual"),
)
STILL_S = "still_s"
_STILL: PairRow = ("still after, s", STILL_S, 1.0, 1)
_CRANE_ROWS: Sequence[PairRow] = (
    ("run-on, s", "run_on_s", 1.0, 2),
    ("run-on, m", "run_on_m", 1.0, 2),
)
_PAIR_ROWS: Sequence[PairRow] = (
    ("time to 95 %, s", "time_to_95_s", 1.0, 2),
    ("run-on, s", "run_on_s", 1.0, 2),
    ("dip after press, %", "dip", 100.0, 0),
    ("re-rise, %", "re_rise", 100.0, 0),
)


def print_report(report: Mapping[str, Any], console: Console) -> None:
    """Print a report of ``metrics.report_dict``; it fits in 80 columns.

    Sway is printed in degrees, raw then shaped, with its change; dip and re-rise in percent of
    full command. A row appears if at least one axis has this measure; "-" marks the other axes.
    """
    arrow = "→" if (console.encoding or "").lower().startswith("utf") else "->"
    if crane := report["crane"]:
        peaks = {name: crane[one]["peak_deg"] or 0.0 for name, one in _DRIVES.items()}
        if over := [name for name, peak in peaks.items() if peak > HORIZONTAL_DEG]:
            text = f"The grapple swung above the horizontal with {' and '.join(over)}"
            console.print(Text(f"{text}: these figures say nothing", "bold red"))
        console.print(_table({"whole crane": crane}, _CRANE_ROWS, arrow))
    axes = list(report["axes"].items())
    for first in range(0, len(axes), _AXES_A_TABLE):
        table = _table(dict(axes[first : first + _AXES_A_TABLE]), _PAIR_ROWS, arrow)
        if table.row_count:
            console.print(table)
    same = f"raw {arrow} shaped: the same script with filters off, then on; still: below"
    console.print(Text(f"{same} {report['still_deg']:g} deg", "dim"))
    for name, axis in report["axes"].items():
        line = _cross_line(name, axis, arrow)
        if line is not None:
            console.print(line)
    console.print(_drive_line(report))


def axis_title(name: str) -> str:
    """Return the name of an axis as a reader expects it: ``near_far`` becomes ``Near-far``."""
    return name.replace("_", "-").capitalize()


def _table(axes: Mapping[str, Any], pairs: Sequence[PairRow], arrow: str) -> Table:
    """Return a table with one column for each axis and one row for each measure."""
    table = new_table("", *map(axis_title, axes))
    title, key, scale, digits = _STILL
    rows = [(title, [_pair_cell(axis, key, scale, digits, arrow) for axis in axes.values()])]
    rows += [
        (title, [_sway_cell(axis, measure, arrow) for axis in axes.values()])
        for title, measure in _SWAY_ROWS
    ] + [
        (title, [_pair_cell(axis, key, scale, digits, arrow) for axis in axes.values()])
        for title, key, scale, digits in pairs
    ]
    for title, cells in rows:
        if any(cell.plain != NOTHING for cell in cells):
            table.add_row(title, *cells)
    return table


def _sway_cell(axis: Mapping[str, Any], measure: str, arrow: str) -> Text:
    cell = _pair_cell(axis, f"{measure}_deg", 1.0, 1, arrow)
    reduction = axis[f"{measure}_reduction_pct"]
    if reduction is not None:
        change, style = _change(reduction)
        cell.append(f"  {change:>5}", style)
    return cell


def _pair_cell(axis: Mapping[str, Any], key: str, scale: float, digits: int, arrow: str) -> Text:
    values = [axis[drive][key] for drive in ("raw", "shaped")]
    if values == [None, None]:
        return Text(NOTHING, style="dim")
    numbers = [_number(None if v is None else scale * v, digits) for v in values]
    if key == STILL_S:  # a drive that ended earlier has only a lower bound
        on = (axis[drive]["swings_on"] for drive in ("raw", "shaped"))
        numbers = [f">{one}" if more else one for one, more in zip(numbers, on, strict=True)]
    return Text(f" {arrow} ".join(numbers))


def _cross_line(name: str, axis: Mapping[str, Any], arrow: str) -> Text | None:
    """Return a line on residual sway in the other plane; None below ``MIN_RAW_DEG`` in both."""
    raw, shaped = axis["raw"]["cross_residual_deg"], axis["shaped"]["cross_residual_deg"]
    if max(raw or 0.0, shaped or 0.0) < MIN_RAW_DEG:
        return None
    line = Text(
        f"After {axis_title(name).lower()}, residual sway in the other plane: "
        f"{_number(raw, 1)} {arrow} {_number(shaped, 1)} deg"
    )
    reduction = axis["cross_residual_reduction_pct"]
    if reduction is not None:
        line.append("  ").append(*_change(reduction))
    return line


def _drive_line(report: Mapping[str, Any]) -> Text:
    missed = report["missed_deadlines"]
    line = Text("Missed deadlines: ")
    line.append(NOTHING if missed is None else str(missed), style="bold red" if missed else "bold")
    line.append(f"   transport: {report['transport']}   drive: {report['duration_s']:.1f} s")
    if missed:
        line.append("\nA busy machine disturbed the drives; demo --lockstep needs no clock.")
    return line


def change_text(reduction_pct: float) -> str:
    """Return a reduction as a signed change: 97 % becomes "-97 %"; nearly all is never "-100 %"."""
    change = round(-reduction_pct)
    if change == -100 and reduction_pct < 100.0:
        return f"{-reduction_pct:+.1f} %" if reduction_pct < 99.95 else "-99.9 %"
    return f"{change:+d} %" if change else "0 %"


def _change(reduction_pct: float) -> tuple[str, str]:
    """Return the change as text, and its style: red for more, else green."""
    return change_text(reduction_pct), "bold red" if round(-reduction_pct) > 0 else "bold green"


def _number(value: float | None, digits: int) -> str:
    return NOTHING if value is None else f"{value:.{digits}f}"
