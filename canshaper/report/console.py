"""Text on a terminal: names of others are text, one look of tables, one bar."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.segment import Segment
from rich.table import Table

from canshaper.errors import printable

MOST_COLUMNS = 10_000  # of a terminal that takes any table


class SafeConsole(Console):
    """A console of rich on which names out of files and logs are text, whatever is in them.

    Brackets are no markup, and control characters are shown, so that a file can neither colour nor
    clear the terminal, nor give it commands.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Segments of text; rich's own, which move the cursor, stay as they are."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text), style, control)


class WholeTable(Table):
    """A table that loses no digit on a narrow terminal: several below each other instead."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the table where it fits, else its first column with the others part by part."""
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
        """Columns of a terminal that it needs."""
        return self.__rich_measure__(console, options.update(max_width=MOST_COLUMNS)).maximum

    def _part(self, numbers: list[int]) -> "WholeTable":
        """The first column and these; the first is wrapped where it has to be."""
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
    """A table without rows: a column of words, then columns of figures; no cell is wrapped."""
    table = WholeTable(
        title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False
    )
    table.add_column(first, no_wrap=True)
    for head in heads:
        table.add_column(head, justify="right", no_wrap=True)
    return table


class OnProgress(Protocol):
    """Called with how much is done, and with what comes now where that changes."""

    def __call__(self, done: float, what: str | None = None) -> None:
        """Show it."""


@contextmanager
def progress_bar(what: str, total: float = 1.0, *, refresh_hz: float = 10) -> Iterator[OnProgress]:
    """A bar on the terminal, next to the output; gone when done, and none where no person looks."""
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
