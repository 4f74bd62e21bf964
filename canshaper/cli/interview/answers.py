"""Answers to questions: checked when given, asked again until valid, or all accepted at once."""

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
    """Answers out of a file, for questions that no one is asked.

    A line is ``QUESTION = ANSWER``, the question by its first words, that of an axis after its
    name; ``#`` begins a comment. A question without a line takes what Enter would.

    Args:
        path: the file; None for no line at all.

    Raises:
        OSError: it cannot be read.
        ConfigError: it is no text, or a line is none.
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
        """The answer to a question.

        Raises:
            ConfigError: it is none.
        """
        question = text.strip()
        if text.startswith("    "):  # one more on the same axis
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
        """Refuse answers to what was not asked.

        Raises:
            ConfigError: there are some.
        """
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
    """The proposals of all questions as their answers, for a person to look at before.

    Attributes:
        rows: question and proposal.
    """

    def __init__(self) -> None:
        self.rows: list[tuple[str, str]] = []

    def answer(self, text: str, parse: Callable[[str], _T], default: str) -> _T:
        """The proposal.

        Raises:
            ValueError: there is none.
        """
        value = parse(default)
        self.rows.append((text, default))
        return value


_given: Given | Proposed | None = None


@contextmanager
def _answered(given: Given | Proposed | None) -> Iterator[None]:
    global _given  # noqa: PLW0603  # of the one command that runs
    _given = given
    try:
        yield
    finally:
        _given = None


@contextmanager
def answered_by(path: Path | None, *, yes: bool = False) -> Iterator[None]:
    """Take the answers to all questions in the block from a file, where there is one.

    With ``yes`` what has no line in it is answered as by Enter, without a file everything.
    """
    given = Given(path) if path or yes else None
    with _answered(given):
        yield
        if given:
            given.check_all_used()


def confirmed(text: str, *, default: bool) -> bool:
    """Ask for yes or no."""
    if _given:
        return _given.answer(text, one(("yes", "no")), "yes" if default else "no") == "yes"
    return typer.confirm(text, default=default)


def ask(text: str, parse: Callable[[str], _T], default: str) -> _T:
    """Ask until the answer is one."""
    if _given:
        return _given.answer(text, parse, default)
    while True:
        try:
            shown = typer.prompt(text, default=default, show_default=bool(default))
            return parse(str(shown).strip())
        except ValueError as error:
            echo(f"  {error}", err=True)


def name(used: Collection[str]) -> Callable[[str], str]:
    """Takes a word that can be a name in a deployment file and is not in use, or NONE."""

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
    """The name of a CAN interface."""
    if not text or not text.isprintable() or " " in text:
        raise ValueError(f"expected a name without spaces, such as can0, got {text!r}")
    return text


def _listed(allowed: Sequence[str], text: str) -> str:
    """Those that are allowed, not more than a person reads, and the one that looks like a text."""
    names = ", ".join(allowed[:MOST_LISTED])
    more = f" and {len(allowed) - MOST_LISTED} more" if len(allowed) > MOST_LISTED else ""
    return f"{names}{more}, got {text!r}{did_you_mean(text, allowed)}"


def one(allowed: Sequence[str]) -> Callable[[str], str]:
    """Takes one of these."""

    def parse(text: str) -> str:
        if text not in allowed:
            raise ValueError(f"expected one of {_listed(allowed, text)}")
        return text

    return parse


def several(allowed: Sequence[str]) -> Callable[[str], list[str]]:
    """Takes one or more of these, with spaces or commas between."""

    def parse(text: str) -> list[str]:
        names = text.replace(",", " ").split()
        if not names or not {*names} <= {*allowed}:
            raise ValueError(f"expected some of {_listed(allowed, text)}")
        return names

    return parse


def number(low: float, high: float) -> Callable[[str], float]:
    """Takes a number within [low, high]."""

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
    """Takes a whole number within [low, high]."""

    def parse(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise ValueError(f"expected a whole number, {low:.0f} to {high:.0f}, got {text!r}")
        return int(text)

    return parse


def period_ms(message: str) -> int:
    """Ask for the period of a message, in ms."""
    return ask(f"{message}: period in ms, which the DBC does not say", whole(1, 1000), "20")


# What may be answered, as the end of a question says it.
_CHOICES = re.compile(r", (of|such as) .*|, - for none")


def accepted(ask: Callable[[], _T]) -> _T | None:
    """Ask for all answers at once: show what Enter would answer, and whether to accept it.

    Args:
        ask: asks the questions.

    Returns:
        None where not, or where a question has no proposal: then they have to be asked.
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
    echo("What no DBC says, such as swing and speeds, is a guess until it is measured.")
    question = "Accept all of these (no: answer them one by one)"
    return made if confirmed(question, default=True) else None
