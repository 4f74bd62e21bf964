"""Answers to questions: each is checked when it is given, and asked again until it is one."""

from collections.abc import Callable, Collection, Sequence
from typing import TypeVar

import typer

from canshaper.cli.common import echo

_T = TypeVar("_T")
NONE = "-"
MOST_OFFERED = 6


def asked(text: str, parse: Callable[[str], _T], default: str) -> _T:
    """Ask until the answer is one."""
    while True:
        try:
            return parse(str(typer.prompt(text, default=default)).strip())
        except ValueError as error:
            echo(f"  {error}", err=True)


def name(taken: Collection[str]) -> Callable[[str], str]:
    """Takes a word that can be a name in a deployment file and is none of those taken, or NONE."""

    from canshaper.config.first import plain

    def parse(text: str) -> str:
        if text != NONE and not (text.isidentifier() and plain(text) == text):
            allowed = "a word of letters, digits and _, other than true, false and null"
            raise ValueError(f"expected {allowed}, got {text!r}")
        if text in taken:
            raise ValueError(f"expected another one than {', '.join(taken)}, got {text!r}")
        return text

    return parse


def channel(text: str) -> str:
    """The name of a CAN interface."""
    if not text or not text.isprintable() or " " in text:
        raise ValueError(f"expected a name without spaces, such as can0, got {text!r}")
    return text


def one(allowed: Sequence[str]) -> Callable[[str], str]:
    """Takes one of these."""

    def parse(text: str) -> str:
        if text not in allowed:
            raise ValueError(f"expected one of {', '.join(allowed)}, got {text!r}")
        return text

    return parse


def several(allowed: Sequence[str]) -> Callable[[str], list[str]]:
    """Takes one or more of these, with spaces or commas between."""

    def parse(text: str) -> list[str]:
        names = text.replace(",", " ").split()
        if not names or not {*names} <= {*allowed}:
            raise ValueError(f"expected some of {', '.join(allowed)}, got {text!r}")
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
