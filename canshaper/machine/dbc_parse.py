"""Messages parsed from a DBC text by cantools, within limits of time and memory."""

import logging
import re
from pathlib import Path

import cantools
from cantools.database.can import Database, Message

from canshaper.errors import Problem
from canshaper.machine.dbc_text import WIDE_ID, keyword

# What cantools gets of the files of a deployment: messages that are used, and what is of none.
MOST_PARSED = 400_000
# Words of a file that is full of signals; what is no signal takes cantools as long for fewer bytes.
MOST_WORDS = 90_000
# Bytes of all messages: cantools takes 10 us for each, whatever is in it.
MOST_PAYLOAD = 100_000
_MESSAGE = rf"{keyword('BO_')}\s+\d+\s+\w+\s*:\s*"
_LENGTH = re.compile(rf"{_MESSAGE}(\d{{1,5}})")
# Bytes of a message, first bit and bits of a signal: cantools makes a list of as many, and the
# memory would not last. The longest of J1939 has 1785 bytes.
_TOO_LARGE = re.compile(
    rf"{_MESSAGE}(\d{{6,}})|{keyword('SG_')}\s+\w+(?:\s+\w+)?\s*:\s*(?:\d+\s*\|\s*)?(\d{{6,}})"
)
UNUSABLE = "not a DBC file that can be used"
SYNTAX = "Invalid syntax"


def parsed_messages(path: Path, text: str, *, bounded: bool) -> list[Message] | Problem:
    """Messages that cantools finds, or why it can find none."""
    if large := _too_large(text, bounded=bounded):
        line, why = large
        return Problem(str(path), line, "", f"{UNUSABLE}: {why}")
    # cantools only logs that of two messages with one id the first is lost; found below.
    logging.getLogger("cantools").setLevel(logging.ERROR)
    try:
        database = cantools.database.load_string(text, database_format="dbc")
    except Exception as error:  # whatever a broken file makes the parser raise
        cause = getattr(error, "e_dbc", None) or error  # without the names of other formats
        why = " ".join(str(cause).split()) or type(cause).__name__
        if "more than 11 bits" in why:
            why += f" ({WIDE_ID})"
        if at := re.search(r"at line (\d+)", why):
            line = int(at.group(1))
        elif at := re.search(r"in message (\w+)|unused \w+ entries in DBC: (\w+ \d+ \w+)", why):
            line = _line_of(text, rf"BO_\s+\d+\s+{at[1]}\b" if at[1] else re.escape(at[2]))
        else:
            line = None
        return Problem(str(path), line, "", f"{UNUSABLE}: {why}")
    assert isinstance(database, Database)
    return database.messages


def letters(text: str) -> int:
    """Return the number of letters without line ends, which other messages leave behind."""
    return len(text) - text.count("\n")


def _too_large(text: str, *, bounded: bool) -> tuple[int | None, str] | None:
    """Line and reason, where a file would take cantools more time or memory than there is."""
    if large := _TOO_LARGE.search(text):
        line = text.count("\n", 0, large.end()) + 1
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
    """Number of the first line of a text that starts with a pattern."""
    start = re.search(rf"^[^\S\n]*{pattern}", text, re.MULTILINE)
    return text.count("\n", 0, start.start()) + 1 if start else None
