"""What all text on a terminal shares: names of others are text, one look of tables, one bar."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.segment import Segment
from rich.table import Table

from canshaper.config.printable import printable


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


def new_table(first: str, *heads: str, title: str | None = None) -> Table:
    """A table without rows: a column of words, then columns of figures; no cell is wrapped."""
    table = Table(
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
