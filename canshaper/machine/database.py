"""DBC files of a deployment: loading them, finding messages, problems with file and line."""

import logging
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import cantools
from cantools.database.can import Database, Message

from canshaper.codec.layout import is_j1939, layout_fault
from canshaper.config.bounded import read_bounded
from canshaper.config.source import MOST_LETTERS, MOST_PROBLEMS, Problem
from canshaper.machine.dbc_text import (
    EXTENDED,
    MOST_MESSAGES,
    MOST_STATEMENTS,
    WIDE_ID,
    Entry,
    dbc_text,
)

# Of all DBC files of a deployment: five times those of a machine.
MOST_BYTES = 16 << 20
# What cantools gets of a file: the messages that are used, and what belongs to no message.
MOST_PARSED = 400_000
# Words of a file that is full of signals; what is no signal takes cantools as long for fewer bytes.
MOST_WORDS = 90_000
# Bytes of all messages: cantools takes 10 us for each, whatever is in it.
MOST_PAYLOAD = 100_000
_LENGTH = re.compile(r"\bBO_\s+\d+\s+\w+\s*:\s*(\d{1,5})")
# Bytes of a message, first bit and bits of a signal: cantools makes a list of as many, and the
# memory would not last. The longest of J1939 has 1785 bytes.
_TOO_LARGE = re.compile(
    r"\bBO_\s+\d+\s+\w+\s*:\s*(\d{6,})|\bSG_\s+\w+(?:\s+\w+)?\s*:\s*(?:\d+\s*\|\s*)?(\d{6,})"
)
_SYNTAX = "Invalid syntax"
UNUSABLE = "not a DBC file that can be used"
_DEFINITION = re.compile(r"\s*BO_\s+(\d{1,10})\s+(\w+)")


@dataclass(frozen=True)
class DbcFile:
    """A loaded DBC file.

    Attributes:
        sha256: of its bytes, in hexadecimal digits.
        entries: every message that stands in it.
        messages: those of them that were asked for.
        warnings: what is wrong with the others, the first of it.
        count: how many warnings there are.
        statements: how many of its statements belong to messages.
    """

    path: Path
    sha256: str
    entries: list[Entry]
    messages: list[Message]
    warnings: list[Problem]
    count: int
    statements: int

    def problem(self, message: Message, text: str) -> Problem:
        """A problem of this file at the line where the message is defined."""
        number = message.frame_id | (EXTENDED if message.is_extended_frame else 0)
        lines = (e.line for e in self.entries if (e.number, e.name) == (number, message.name))
        return Problem(str(self.path), next(lines, None), message.name, text)

    def read(self, name: str) -> Message | str:
        """Another message of it, or why there is none.

        Raises:
            OSError: the file cannot be read.
        """
        file, problems = load_dbc(self.path, {name})
        if problems or file is None:
            return "\n".join(str(problem) for problem in problems)
        if file.sha256 != self.sha256:
            return f"{self.path}: has changed since it was read"
        # Not the same name for cantools: a long one with a line end or a quote in it.
        why = f"{self.path}: {name!r} has another name for the parser"
        return next((m for m in file.messages if m.name == name), why)


def load_dbc(
    path: Path, names: Collection[str] | None = None
) -> tuple[DbcFile | None, list[Problem]]:
    """Load messages of a DBC file strictly; instead of a file its problems, where it is none.

    What is wrong with messages that are not loaded is a warning.

    Args:
        path: the file.
        names: of the messages; by default all that can be loaded, as many as there are.

    Raises:
        OSError: the file cannot be read.
    """
    data = read_bounded(path, MOST_BYTES)
    try:
        text = dbc_text(data)
    except ValueError as error:
        return None, [Problem(str(path), None, "", f"{UNUSABLE}: {error}")]
    digest = sha256(data).hexdigest()
    bounded = names is not None
    if text.entries is None:
        content = text.whole()
        parsed = _parsed(path, content, bounded=bounded)
        if isinstance(parsed, Problem):
            return None, [parsed]
        return _checked(DbcFile(path, digest, _entries(parsed, content), parsed, [], 0, 0))
    entries = text.entries
    used = {e.number for e in entries if (e.fault is None if names is None else e.name in names)}
    rest = text.of(used)
    # Of a file of messages alone nothing may be left, which cantools would not have as a file.
    parsed = _parsed(path, rest, bounded=bounded) if rest.strip() or not entries else []
    if isinstance(parsed, Problem):
        # A statement without its end is seen at the next one, which a file that is whole has.
        whole = _parsed(path, text.whole(), bounded=True) if _SYNTAX in parsed.message else None
        if isinstance(whole, Problem) and _SYNTAX in whole.message:
            parsed = whole
        return None, [parsed]
    warnings = list(_faults(path, entries, used))
    leftover = text.leftover(used)
    count = len(warnings) + len(leftover)
    for line, fault in text.leftover_faults(leftover[:MOST_PROBLEMS]):
        warnings.append(Problem(str(path), line, "", fault))
    del warnings[MOST_PROBLEMS:]
    file = DbcFile(path, digest, entries, parsed, warnings, count, text.statements)
    return _checked(file)


def too_many(files: Sequence[DbcFile]) -> str | None:
    """Why the files of a deployment take too long together, or None."""
    for what, count, most in (
        ("messages", sum(len(file.entries) for file in files), MOST_MESSAGES),
        ("statements of messages", sum(file.statements for file in files), MOST_STATEMENTS),
    ):
        if count > most:
            return f"found {count} {what} in all, allowed are {most} at most"
    return None


def _parsed(path: Path, text: str, *, bounded: bool) -> list[Message] | Problem:
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


def _checked(file: DbcFile) -> tuple[DbcFile | None, list[Problem]]:
    """The file, and what is wrong with its messages that cantools does not see."""
    problems = []
    loaded = {(message.frame_id, message.is_extended_frame) for message in file.messages}
    for entry, other in _same_id(file.entries):
        if entry.key in loaded:
            text = _same_text(entry, other)
            problems.append(Problem(str(file.path), entry.line, entry.name, text))
    faults = [(m, fault) for m in file.messages if (fault := layout_fault(m) or _id_fault(m))]
    problems += [file.problem(*fault) for fault in faults]
    return None if faults else file, problems


def _faults(path: Path, entries: list[Entry], used: set[int]) -> Iterator[Problem]:
    """What is wrong with the messages that are not used."""
    for entry in entries:
        if entry.fault and entry.number not in used:
            yield Problem(str(path), entry.line, entry.name, entry.fault)
    for entry, other in _same_id(entries):
        if entry.number not in used:
            yield Problem(str(path), entry.line, entry.name, _same_text(entry, other))


def _same_id(entries: list[Entry]) -> Iterator[tuple[Entry, Entry]]:
    """Messages whose id another one before them has, with that one."""
    seen: dict[int, Entry] = {}
    for entry in entries:
        if entry.number in seen:
            yield entry, seen[entry.number]
        seen[entry.number] = entry


def _same_text(entry: Entry, other: Entry) -> str:
    return f"has the id {entry.key[0]:#x} of {other.name}"


def _too_large(text: str, *, bounded: bool) -> tuple[int | None, str] | None:
    """Line and reason, where a file would take cantools more time or memory than there is."""
    if large := _TOO_LARGE.search(text):
        line = text.count("\n", 0, large.end()) + 1
        return line, f"found {large[1] or large[2]} bytes or bits, allowed are 99999 at most"
    if not bounded:
        return None
    if (parsed := len(text) - text.count("\n")) > MOST_PARSED:
        return (
            None,
            f"found {parsed} bytes in what is used of it, allowed are {MOST_PARSED} at most",
        )
    if (words := len(text.split())) > MOST_WORDS:
        return None, f"found {words} words, allowed are {MOST_WORDS} at most"
    if (payload := sum(map(int, _LENGTH.findall(text)))) > MOST_PAYLOAD:
        return None, f"found {payload} bytes in its messages, allowed are {MOST_PAYLOAD} at most"
    return None


def _line_of(text: str, pattern: str) -> int | None:
    """Number of the first line of a text that starts with a pattern."""
    start = re.search(rf"^[^\S\n]*{pattern}", text, re.MULTILINE)
    return text.count("\n", 0, start.start()) + 1 if start else None


def _entries(messages: list[Message], text: str) -> list[Entry]:
    """Messages of a file that cantools has read as a whole."""
    lines: dict[tuple[int, str], int] = {}
    for line, row in enumerate(text.split("\n"), 1):
        if found := _DEFINITION.match(row):
            lines.setdefault((int(found[1]), found[2]), line)
    numbers = [m.frame_id | (EXTENDED if m.is_extended_frame else 0) for m in messages]
    return [
        Entry(m.name, number, lines.get((number, m.name)))
        for m, number in zip(messages, numbers, strict=True)
    ]


def _id_fault(message: Message) -> str | None:
    """Why the id of a message is not the one that was meant, or None."""
    if is_j1939(message) and not message.is_extended_frame:
        return f"is one of J1939 with an id of 11 bits; {WIDE_ID}"
    return None


class Messages:
    """Messages of several DBC files by name.

    Attributes:
        files: the DBC files in the order of the deployment.
    """

    def __init__(self, files: list[DbcFile]) -> None:
        self.files = files
        self._files: dict[str, list[DbcFile]] = {}
        for file in files:
            for entry in file.entries:
                self._files.setdefault(entry.name, []).append(file)
        self._loaded = {message.name: message for message in self.all()}

    def ids(self) -> set[tuple[int, bool]]:
        """(id, extended) of every message, whether it is loaded or not."""
        return {entry.key for file in self.files for entry in file.entries}

    def all(self) -> list[Message]:
        """Every message that is loaded."""
        return [message for file in self.files for message in file.messages]

    def named(self, ids: Collection[tuple[int, bool]]) -> list[str]:
        """Names of the messages with these (id, extended)."""
        return sorted(e.name for file in self.files for e in file.entries if e.key in ids)

    def warnings(self) -> tuple[int, list[Problem]]:
        """How many faults messages have that are not used, and the first of them."""
        found = [warning for file in self.files for warning in file.warnings]
        return sum(file.count for file in self.files), found

    def find(self, name: str) -> tuple[DbcFile, Message] | str:
        """The message and its file, or why there is none; one that is not loaded is read now."""
        found = self._files.get(name, [])
        if not found:
            names = ", ".join(sorted(self._files)) or "none"
            return f"found {name!r}, messages of the DBC files are {names[:MOST_LETTERS]}"
        if len(found) > 1:
            files = ", ".join(str(file.path) for file in found)
            return f"{name!r} stands more than once in the DBC files: {files}"
        (file,) = found
        if name not in self._loaded:
            try:
                message = file.read(name)
            except OSError as error:
                return f"{file.path}: {error.strerror or error}"
            if isinstance(message, str):
                return message
            self._loaded[name] = message
        return file, self._loaded[name]
