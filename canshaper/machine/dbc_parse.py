"""Messages parsed from a DBC text by cantools, within limits of time and memory."""

import logging
import re
from pathlib import Path
from typing import Any

import cantools
from cantools.database.can import Database, Message

from canshaper.errors import Problem
from canshaper.machine.dbc_text import WIDE_ID, keyword

# Most bytes of a deployment for cantools: messages that are used, and text of no message.
MOST_PARSED = 400_000
# Most words, as in a file full of signals; other text costs cantools the same time for fewer bytes.
MOST_WORDS = 90_000
# Most bytes of all messages: cantools takes 10 us for each byte, whatever is in it.
MOST_PAYLOAD = 100_000
_MESSAGE = rf"{keyword('BO_')}\s+\d+\s+\w+\s*:\s*"
_LENGTH = re.compile(rf"{_MESSAGE}(\d{{1,5}})")
# Bytes of a message, first bit or bits of a signal with 6 digits: cantools makes a list of as many
# entries, and memory would run out. The longest message of J1939 has 1785 bytes.
_TOO_LARGE = re.compile(
    rf"{_MESSAGE}(\d{{6,}})|{keyword('SG_')}\s+\w+(?:\s+\w+)?\s*:\s*(?:\d+\s*\|\s*)?(\d{{6,}})"
)
_WHOLE = re.compile(r"\s*(-?\d{1,9})(?:\.0*)?\s*", re.ASCII)
UNUSABLE = "not a DBC file that can be used"
SYNTAX = "Invalid syntax"


def parsed_messages(path: Path, text: str, *, bounded: bool) -> list[Message] | Problem:
    """Return the messages that cantools finds, or why it cannot parse the text.

    With ``bounded`` the text must not exceed ``MOST_PARSED``, ``MOST_WORDS`` and ``MOST_PAYLOAD``.
    """
    if large := _too_large(text, bounded=bounded):
        line, why = large
        return Problem(str(path), line, "", f"{UNUSABLE}: {why}")
    # Of two messages with one id cantools drops the first, and only logs that; our callers check.
    logging.getLogger("cantools").setLevel(logging.ERROR)
    try:
        database = cantools.database.load_string(text, database_format="dbc")
    except Exception as error:  # whatever a broken file makes the parser raise
        cause = getattr(error, "e_dbc", None) or error  # without the names of other formats
        why = " ".join(str(cause).split()) or type(cause).__name__
        if "more than 11 bits" in why:
            why += f" ({WIDE_ID})"
        if explanation := _explained(text, cause, why):
            line, why = explanation
        elif at := re.search(r"at line (\d+)", why):
            line = int(at.group(1))
        elif at := re.search(r"in message (\w+)|unused \w+ entries in DBC: (\w+ \d+ \w+)", why):
            line = _line_of(text, rf"BO_\s+\d+\s+{at[1]}\b" if at[1] else re.escape(at[2]))
        else:
            line = None
        return Problem(str(path), line, "", f"{UNUSABLE}: {why}")
    assert isinstance(database, Database)
    for message in database.messages:
        message.cycle_time = _whole(message.cycle_time)
    return database.messages


def _whole(cycle: object) -> Any:
    """Return a cycle time as an int if a FLOAT or STRING attribute holds a whole number."""
    if isinstance(cycle, float) and cycle.is_integer():
        return int(cycle)
    if isinstance(cycle, str) and (number := _WHOLE.fullmatch(cycle)):
        return int(number[1])
    return cycle


def _explained(text: str, cause: Exception, why: str) -> tuple[int, str] | None:
    """Return (line, what to write) for mistakes that cantools reports without a line, or None."""
    if isinstance(cause, KeyError) and (at := _attribute(text, str(cause.args[0]))):
        kind = "STRING" if '"' in at[2] else "INT 0 65535"
        expected = f"expected BA_DEF_ {at[1]}{at[0].split()[1]} {kind}; before it"
        return _line_at(text, at.start()), expected
    if "Expected int or float" in why and (at := _attribute(text, "GenSigStartValue")):
        return _line_at(text, at.start()), "expected GenSigStartValue as INT, HEX or FLOAT"
    twice = re.search(r"signals (\w+) and \1 are overlapping in message (\w+)", why)
    name, message = twice.groups() if twice else ("", "")
    both = rf"BO_\s+\d+\s+{message}\b.*?SG_\s+{name}\b.*?SG_\s+{name}\b"
    if twice and (at := re.search(both, text, re.DOTALL)):
        return _line_at(text, at.end()), f"{message} has the signal {name} twice: rename one"
    return None


def _attribute(text: str, name: str) -> re.Match[str] | None:
    """Find the first statement that gives an attribute a value; None without one."""
    value = rf'^[^\S\n]*BA_\s+"{re.escape(name)}"\s+((?:(?:BU|BO|SG|EV)_\s)?)([^;]*)'
    return re.search(value, text, re.MULTILINE)


def _line_at(text: str, place: int) -> int:
    return text.count("\n", 0, place) + 1


def letters(text: str) -> int:
    """Return the number of characters but line ends, which stay of messages that are left out."""
    return len(text) - text.count("\n")


def _too_large(text: str, *, bounded: bool) -> tuple[int | None, str] | None:
    """Return (line, reason) if a text would cost cantools too much time or memory, or None."""
    if large := _TOO_LARGE.search(text):
        line = _line_at(text, large.end())
        return line, f"expected 99999 bytes or bits at most, got {large[1] or large[2]}"
    if not bounded:
        return None
    if (count := letters(text)) > MOST_PARSED:
        why = f"expected {MOST_PARSED} bytes at most in what is used of it, got {count}"
        return None, why
    if (words := len(text.split())) > MOST_WORDS:
        return None, f"expected {MOST_WORDS} words at most, got {words}"
    if (payload := sum(map(int, _LENGTH.findall(text)))) > MOST_PAYLOAD:
        return None, f"expected {MOST_PAYLOAD} bytes at most in its messages, got {payload}"
    return None


def _line_of(text: str, pattern: str) -> int | None:
    """Return the number of the first line that starts with a pattern, or None."""
    start = re.search(rf"^[^\S\n]*{pattern}", text, re.MULTILINE)
    return _line_at(text, start.start()) if start else None
