"""The person at the terminal, led through the steps of ``canshaper commission``."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from canshaper.cli.answers import ask, one
from canshaper.cli.common import echo
from canshaper.report.console import OnProgress, progress_bar


class Terminal:
    """Reads and answers; with ``--yes`` or ``--answers`` no one is waited for."""

    def ready(self, words: str) -> None:
        """Say what to do, and wait for Enter."""
        echo(f"\n  {words}")
        ask("Enter begins", str, "")

    def answer(self, question: str, default: str, allowed: Sequence[str] = ()) -> str:
        """Ask for a word, until it is one that is allowed."""
        return ask(question, one(allowed) if allowed else str, default)

    @contextmanager
    def progress(self, what: str) -> Iterator[OnProgress]:
        """A bar on the terminal."""
        with progress_bar(what) as on_progress:
            yield on_progress
