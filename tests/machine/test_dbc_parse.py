"""A DBC text as far as cantools gets it: what is too much, what is broken, and where."""

import logging
from pathlib import Path
from typing import Any

import cantools
import pytest

from canshaper.errors import Problem
from canshaper.machine import dbc_parse as module
from canshaper.machine.dbc_parse import letters, parsed_messages
from canshaper.machine.dbc_text import WIDE_ID

GOOD = """VERSION ""

BU_: A

BO_ 1 First: 8 A
 SG_ One : 0|8@1+ (1,0) [0|0] "" A

BO_ 2 Second: 4 A
"""
PATH = Path("a.dbc")


def problem(text: str, *, bounded: bool = True) -> tuple[int | None, str]:
    """Line and text of the one problem."""
    result = parsed_messages(PATH, text, bounded=bounded)
    assert isinstance(result, Problem)
    assert (result.file, result.where) == ("a.dbc", "")
    start = "not a DBC file that can be used: "
    assert result.message.startswith(start)
    return result.line, result.message.removeprefix(start)


def names(text: str, *, bounded: bool = True) -> list[str]:
    result = parsed_messages(PATH, text, bounded=bounded)
    assert isinstance(result, list)
    return [message.name for message in result]


@pytest.mark.parametrize(
    ("limit", "count", "text"),
    [
        ("MOST_PARSED", letters(GOOD), "bytes at most in what is used of it"),
        ("MOST_WORDS", len(GOOD.split()), "words at most"),
        ("MOST_PAYLOAD", 12, "bytes at most in its messages"),
    ],
)
def test_as_much_as_there_may_be(
    monkeypatch: pytest.MonkeyPatch, limit: str, count: int, text: str
) -> None:
    monkeypatch.setattr(module, limit, count)
    assert names(GOOD) == ["First", "Second"]
    monkeypatch.setattr(module, limit, count - 1)
    assert problem(GOOD) == (None, f"expected {count - 1} {text}, got {count}")
    assert names(GOOD, bounded=False) == ["First", "Second"]


@pytest.mark.parametrize(
    ("old", "new"),
    [("First: 8", "First: 100000"), ("0|8@1+", "100000|8@1+"), ("0|8@1+", "0|100000@1+")],
)
def test_the_line_of_what_is_too_large(old: str, new: str) -> None:
    text = "\n" + GOOD.replace(old, new)
    line = text[: text.index(new)].count("\n") + 1
    for bounded in (True, False):
        assert problem(text, bounded=bounded) == (
            line,
            "expected 99999 bytes or bits at most, got 100000",
        )


def test_the_line_of_a_message() -> None:
    """An empty first line counts."""
    text = "\n" + GOOD.replace("8 A\n SG_ One : 0", "1 A\n SG_ One : 4")
    line, why = problem(text)
    assert (line, why.split(" in message ")[1].split(".")[0]) == (6, "First")


def test_an_id_that_is_too_wide_without_its_bit() -> None:
    _, why = problem(GOOD.replace("BO_ 1 ", "BO_ 418119422 "))
    assert why.endswith(f"({WIDE_ID})")
    assert "more than 11 bits" in why


def test_another_format_is_none() -> None:
    """cantools would find it out by itself; the rest of canshaper would not understand it."""
    kcd = (
        '<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Document/>'
        '<Bus name="b"><Message id="0x1" name="M" length="1"/></Bus></NetworkDefinition>'
    )
    assert cantools.database.load_string(kcd)
    assert problem(kcd)[0] == 1


def test_a_parser_that_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_args: object, **_named: object) -> Any:
        raise AssertionError

    monkeypatch.setattr(cantools.database, "load_string", broken)
    assert problem(GOOD) == (None, "AssertionError")


def test_of_two_messages_with_one_id_cantools_alone_logs_nothing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    for name in (None, "cantools"):
        monkeypatch.setattr(logging.getLogger(name), "level", logging.INFO)
    names(GOOD.replace("BO_ 2", "BO_ 1"))
    assert caplog.records == []
    assert logging.getLogger().level == logging.INFO
