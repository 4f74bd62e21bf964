"""Questions and their answers: typed by a person, read from a file, or proposals accepted at once.

Every answer is parsed; a person is asked again until it is valid.
"""

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

import typer

from canshaper.cli.common import echo
from canshaper.errors import ConfigError, Problem, UsageError, did_you_mean

_T = TypeVar("_T")
NONE = "-"
MOST_OFFERED = 6
MOST_LISTED = 20


class Given:
    """Answers from a file, so that no one is asked.

    A line is ``QUESTION = ANSWER`` and answers one question. The question is given by its first
    words, that of an axis with its name first, as in ``slew: time of ten``; ``#`` begins a comment.
    A question without a line gets its default.

    Args:
        path: the file; None answers every question with its default.

    Raises:
        OSError: the file cannot be read.
        ConfigError: the file is no UTF-8 text, or a line is no ``QUESTION = ANSWER``.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._left: dict[int, tuple[str, str]] = {}
        self._axis = ""
        if path:
            self._read(path)

    def _read(self, path: Path) -> None:
        problems = []
        try:
            lines = path.read_text(encoding="utf-8-sig").splitlines()  # an editor may put a mark
        except UnicodeDecodeError as error:
            before = error.object[: error.start].count(b"\n")
            text = f"expected UTF-8, got the byte 0x{error.object[error.start]:02X}"
            raise ConfigError([Problem(str(path), before + 1, "", text)]) from None
        for number, line in enumerate(lines, 1):
            question, equals, answer = line.partition("#")[0].partition("=")
            if equals and question.strip():
                self._left[number] = question.strip(), answer.strip()
            elif line.partition("#")[0].strip():
                problems.append(
                    Problem(str(path), number, "", f"expected QUESTION = ANSWER, got {line!r}")
                )
        if problems:
            raise ConfigError(problems)

    def answer(self, text: str, parse: Callable[[str], _T], default: str) -> _T:
        """Return the parsed answer of the first unused line that fits ``text``, else the default.

        A question with two leading spaces names its axis; those with four are about the same axis.

        Raises:
            ConfigError: the answer or the default is invalid.
        """
        question = text.strip()
        if text.startswith("    "):  # another question about the same axis
            question = f"{self._axis}: {question}"
        elif text.startswith("  "):
            self._axis = question.partition(":")[0]
        matches = (n for n, (words, _) in self._left.items() if question.startswith(words))
        number = next(matches, None)
        words, answer = self._left.pop(number) if number else (question, default)
        try:
            return parse(answer)
        except ValueError as error:
            raise ConfigError([Problem(str(self._path), number, words, str(error))]) from None

    def check_all_used(self) -> None:
        """Raise a ConfigError with every line that answered no question."""
        problems = [
            Problem(
                str(self._path),
                number,
                words,
                "expected a question of this command, once, got another",
            )
            for number, (words, _) in self._left.items()
        ]
        if problems:
            raise ConfigError(problems)


class Proposed:
    """Answers every question with its proposal, and keeps both for a person to look at.

    Attributes:
        rows: (question, proposal) of the answered questions, in their order.
    """

    def __init__(self) -> None:
        self.rows: list[tuple[str, str]] = []

    def answer(self, text: str, parse: Callable[[str], _T], default: str) -> _T:
        """Return the parsed proposal, and keep it in ``rows``.

        Raises:
            ValueError: the question has no valid proposal.
        """
        value = parse(default)
        self.rows.append((text, default))
        return value


_given: Given | Proposed | None = None


@contextmanager
def _answered(given: Given | Proposed | None) -> Iterator[None]:
    global _given  # noqa: PLW0603  # a process runs one command
    _given = given
    try:
        yield
    finally:
        _given = None


@contextmanager
def answered_by(path: Path | None, *, yes: bool = False) -> Iterator[None]:
    """Answer the questions in the block from a file, else by defaults (``yes``), else ask a person.

    A question without a line in the file gets its default.

    Raises:
        OSError: the file cannot be read.
        ConfigError: the file is wrong, or a line of it answered no question.
    """
    given = Given(path) if path or yes else None
    with _answered(given):
        yield
        if given:
            given.check_all_used()


def confirmed(text: str, *, default: bool) -> bool:
    """Ask a question of yes or no; return whether the answer is yes."""
    if _given:
        return _given.answer(text, one(("yes", "no")), "yes" if default else "no") == "yes"
    return typer.confirm(text, default=default)


def ask(text: str, parse: Callable[[str], _T], default: str) -> _T:
    """Return the answer to a question, parsed; a person is asked until ``parse`` accepts it.

    ``default`` is the proposal, "" for none. An invalid answer of a file raises a ConfigError; so
    does an invalid proposal, or a ValueError where all proposals are accepted at once.
    """
    if _given:
        return _given.answer(text, parse, default)
    while True:
        try:
            shown = typer.prompt(text, default=default, show_default=bool(default))
            return parse(str(shown).strip())
        except ValueError as error:
            echo(f"  {error}", err=True)


def name(used: Collection[str]) -> Callable[[str], str]:
    """Return a parser of an unused name for the deployment file, or of "-" for none."""

    from canshaper.edit.edit import plain

    def parse(text: str) -> str:
        if text != NONE and not (text.isidentifier() and plain(text) == text):
            allowed = "a word of letters, digits and _, other than true, false and null"
            raise ValueError(f"expected {allowed}, got {text!r}")
        if text in used:
            raise ValueError(f"expected another one than {', '.join(used)}, got {text!r}")
        return text

    return parse


def channel(text: str) -> str:
    """Return the text if it can name a CAN interface, printable without spaces; else ValueError."""
    if not text or not text.isprintable() or " " in text:
        raise ValueError(f"expected a name without spaces, such as can0, got {text!r}")
    return text


def _listed(allowed: Sequence[str], text: str) -> str:
    """Return the end of an error text: the first allowed words, the typed one, a similar one."""
    names = ", ".join(allowed[:MOST_LISTED])
    more = f" and {len(allowed) - MOST_LISTED} more" if len(allowed) > MOST_LISTED else ""
    return f"{names}{more}, got {text!r}{did_you_mean(text, allowed)}"


def one(allowed: Sequence[str]) -> Callable[[str], str]:
    """Return a parser that accepts one of these words."""

    def parse(text: str) -> str:
        if text not in allowed:
            raise ValueError(f"expected one of {_listed(allowed, text)}")
        return text

    return parse


def several(allowed: Sequence[str]) -> Callable[[str], list[str]]:
    """Return a parser of one or more of these words, separated by spaces or commas."""

    def parse(text: str) -> list[str]:
        names = text.replace(",", " ").split()
        if not names or not {*names} <= {*allowed}:
            raise ValueError(f"expected some of {_listed(allowed, text)}")
        return names

    return parse


def number(low: float, high: float) -> Callable[[str], float]:
    """Return a parser of a number within [low, high]."""

    def parse(text: str) -> float:
        fault = f"expected a number, {low:g} to {high:g}, got {text!r}"
        try:
            value = float(text)
        except ValueError:
            raise ValueError(fault) from None
        if not low <= value <= high:
            raise ValueError(fault)
        return value

    return parse


def whole(low: float, high: float) -> Callable[[str], int]:
    """Return a parser of a whole number within [low, high]."""

    def parse(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise ValueError(f"expected a whole number, {low:.0f} to {high:.0f}, got {text!r}")
        return int(text)

    return parse


def period_ms(message: str, default: int = 20) -> int:
    """Ask for the period of a message, by name, whose DBC states none; return it in ms."""
    return ask(f"{message}: period in ms, which the DBC does not say", whole(1, 1000), str(default))


# End of a question, which lists possible answers; the table of proposals leaves it out.
_CHOICES = re.compile(r", (of|such as) .*|, - for none")


def accepted(ask: Callable[[], _T]) -> _T | None:
    """Show the proposals of all questions, and ask whether to accept them at once.

    Args:
        ask: asks the questions, and returns a result from the answers.

    Returns:
        The result; None if the person declines, a proposal is invalid, or on a UsageError.
    """
    from canshaper.report.console import SafeConsole, new_table

    proposed = Proposed()
    made = None
    with suppress(UsageError, ValueError), _answered(proposed):
        made = ask()
    if made is None:
        return None
    table = new_table("question", "proposal")
    for question, proposal in proposed.rows:
        table.add_row(_CHOICES.sub("", question), "none" if proposal == NONE else proposal)
    SafeConsole().print(table)
    echo("Numbers that no DBC states, such as swing and speeds, are guesses until measured.")
    question = "Accept all of these (no: answer them one by one)"
    return made if confirmed(question, default=True) else None
