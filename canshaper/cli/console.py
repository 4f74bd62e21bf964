"""What a command prints: control characters and marks of what others wrote are text, no orders."""

from collections.abc import Iterable
from typing import Any

import typer
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from canshaper.config.printable import printable


class SafeConsole(Console):
    """A console of rich on which names out of files and logs are text, whatever is in them.

    Brackets are no markup, and control characters are shown, so that a file can neither colour nor
    clear the terminal, nor give it commands.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Segments of text; rich's own, which move the cursor, stay as they are."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text), style, control)


def echo(text: str, *, err: bool = False) -> None:
    """Print lines."""
    typer.echo(printable(text), err=err)
