"""DBC files of a deployment: loading them, finding messages, problems with file and line."""

import re
import zlib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from cantools.database.can import Message

from canshaper.codec.frame import EFF_FLAG
from canshaper.codec.layout import is_j1939, layout_fault
from canshaper.config.source import read_bounded
from canshaper.errors import MOST_PROBLEMS, Problem, there_are
from canshaper.machine.dbc_parse import MOST_PARSED, SYNTAX, UNUSABLE, letters, parsed_messages
from canshaper.machine.dbc_text import MOST_MESSAGES, MOST_STATEMENTS, WIDE_ID, Entry, dbc_text

# Most bytes of all DBC files of a deployment: five times those of a machine.
MOST_BYTES = 16 << 20
_DEFINITION = re.compile(r"\s*BO_\s+(-?\d{1,10})\s+(\w+)")


@dataclass(frozen=True)
class DbcFile:
    """A loaded DBC file.

    Attributes:
        path: path of the file.
        packed: content, compressed by zlib.
        sha256: SHA-256 of the content, in hexadecimal digits.
        entries: every message of the file.
        messages: the messages that were loaded.
        warnings: the first faults of the other messages.
        count: number of faults of the other messages.
        statements: number of statements that belong to messages.
        used_bytes: bytes of text that cantools parsed.
    """

    path: Path
    packed: bytes
    sha256: str
    entries: list[Entry]
    messages: list[Message]
    warnings: list[Problem]
    count: int
    statements: int
    used_bytes: int

    def problem(self, message: Message, text: str) -> Problem:
        """Return a problem of this file at the line that defines the message."""
        number = message.frame_id | (EFF_FLAG if message.is_extended_frame else 0)
        lines = (e.line for e in self.entries if (e.number, e.name) == (number, message.name))
        return Problem(str(self.path), next(lines, None), message.name, text)

    def read(self, name: str) -> Message | str:
        """Read the file again for one more message; return it, or why it cannot be loaded.

        Raises:
            OSError: the file cannot be read.
        """
        file, problems = load_dbc(self.path, {name})
        if problems or file is None:
            return "\n".join(str(problem) for problem in problems)
        if file.sha256 != self.sha256:
            return f"{self.path}: has changed since it was read"
        # cantools gives it another name: a long name with a line end or a quote in it.
        why = f"{self.path}: {name!r} has another name for the parser"
        return next((m for m in file.messages if m.name == name), why)


def load_dbc(
    path: Path, names: Collection[str] | None = None
) -> tuple[DbcFile | None, list[Problem]]:
    """Load messages of a DBC file strictly; return the file and its problems.

    The file is None if it, or a named message, cannot be used. Faults of messages that are not
    loaded are warnings.

    Args:
        path: path of the file.
        names: names of the messages to load, ignored where the file lacks them; by default all
            that can be loaded.

    Raises:
        OSError: the file cannot be read.
    """
    data = read_bounded(path, MOST_BYTES)
    try:
        text = dbc_text(data)
    except ValueError as error:
        return None, [Problem(str(path), None, "", f"{UNUSABLE}: {error}")]
    packed, digest = zlib.compress(data, 1), sha256(data).hexdigest()
    bounded = names is not None
    if text.entries is None:
        content = text.whole()
        parsed = parsed_messages(path, content, bounded=bounded)
        if isinstance(parsed, Problem):
            return None, [parsed]
        count = letters(content)
        file = DbcFile(path, packed, digest, _entries(parsed, content), parsed, [], 0, 0, count)
        return _checked(file, named=bounded)
    entries = text.entries
    used = {e.number for e in entries if names is None or e.name in names}
    if names is None:
        used -= {e.number for e in entries if e.fault} | text.without_type()
        used -= {entry.number for entry, _ in _same_id(entries)}
    rest = text.of(used)
    # If no message is used, nothing may be left of the file, and cantools refuses an empty text.
    parsed = parsed_messages(path, rest, bounded=bounded) if rest.strip() or not entries else []
    if isinstance(parsed, Problem):
        if SYNTAX in parsed.message and len(rest) < len(text.data):
            # A statement without its end is seen at the next one, which may be left out here.
            whole = parsed_messages(path, text.whole(), bounded=True)
            if isinstance(whole, Problem) and SYNTAX in whole.message:
                parsed = whole
        return None, [parsed]
    warnings = list(_faults(path, entries, used))
    leftover = text.leftover(used)
    count = len(warnings) + len(leftover)
    for line, fault in text.leftover_faults(leftover[:MOST_PROBLEMS]):
        warnings.append(Problem(str(path), line, "", fault))
    del warnings[MOST_PROBLEMS:]
    counts = count, text.statements, letters(rest)
    return _checked(
        DbcFile(path, packed, digest, entries, parsed, warnings, *counts), named=bounded
    )


def too_many(files: Sequence[DbcFile]) -> str | None:
    """Return why the DBC files of a deployment are too large together, or None."""
    for what, count, most in (
        ("messages", sum(len(file.entries) for file in files), MOST_MESSAGES),
        ("statements of messages", sum(file.statements for file in files), MOST_STATEMENTS),
        ("bytes in what is used of them", sum(file.used_bytes for file in files), MOST_PARSED),
    ):
        if count > most:
            return f"expected {most} {what} in all at most, got {count}"
    return None


def _checked(file: DbcFile, *, named: bool) -> tuple[DbcFile | None, list[Problem]]:
    """Return the file, and the faults of its messages that cantools does not report.

    A faulty message that was named makes the file None; without names it is left out instead.
    """
    problems = []
    loaded = {(message.frame_id, message.is_extended_frame) for message in file.messages}
    for entry, other in _same_id(file.entries):
        if entry.key in loaded:
            text = _same_text(entry, other)
            problems.append(Problem(str(file.path), entry.line, entry.name, text))
    faults = [(m, fault) for m in file.messages if (fault := layout_fault(m) or _id_fault(m))]
    layout_problems = [file.problem(*fault) for fault in faults]
    if named:
        return None if faults else file, [*problems, *layout_problems]
    wrong = {id(message) for message, _ in faults}
    messages = [message for message in file.messages if id(message) not in wrong]
    warnings = [*file.warnings, *layout_problems][:MOST_PROBLEMS]
    count = file.count + len(layout_problems)
    return replace(file, messages=messages, warnings=warnings, count=count), problems


def _faults(path: Path, entries: list[Entry], used: set[int]) -> Iterator[Problem]:
    """Yield the faults of messages that are not used."""
    for entry in entries:
        if entry.fault and entry.number not in used:
            yield Problem(str(path), entry.line, entry.name, entry.fault)
    for entry, other in _same_id(entries):
        if entry.number not in used:
            yield Problem(str(path), entry.line, entry.name, _same_text(entry, other))


def _same_id(entries: list[Entry]) -> Iterator[tuple[Entry, Entry]]:
    """Yield each message whose id an earlier message has, with the earlier message."""
    seen: dict[int, Entry] = {}
    for entry in entries:
        if entry.number in seen:
            yield entry, seen[entry.number]
        seen[entry.number] = entry


def _same_text(entry: Entry, other: Entry) -> str:
    return f"has the id {entry.key[0]:#x} of {other.name}"


def _entries(messages: list[Message], text: str) -> list[Entry]:
    """Return the entries of a file that cantools has parsed as a whole."""
    lines: dict[tuple[int, str], int] = {}
    for line, row in enumerate(text.split("\n"), 1):
        if match := _DEFINITION.match(row):
            lines.setdefault((int(match[1]), match[2]), line)
    numbers = [m.frame_id | (EFF_FLAG if m.is_extended_frame else 0) for m in messages]
    return [
        Entry(m.name, number, lines.get((number, m.name)))
        for m, number in zip(messages, numbers, strict=True)
    ]


def _id_fault(message: Message) -> str | None:
    """Return why the id of a message cannot be the intended one, or None."""
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
        """Return (id, extended) of every message, whether it is loaded or not."""
        return {entry.key for file in self.files for entry in file.entries}

    def all(self) -> list[Message]:
        """Return every message loaded with its file, but none that ``find`` has loaded later."""
        return [message for file in self.files for message in file.messages]

    def named(self, ids: Collection[tuple[int, bool]]) -> list[str]:
        """Return the sorted names of the messages, loaded or not, with these (id, extended)."""
        return sorted(e.name for file in self.files for e in file.entries if e.key in ids)

    def warnings(self) -> tuple[int, list[Problem]]:
        """Return the number of faults in messages that are not used, and the first of them."""
        problems = [warning for file in self.files for warning in file.warnings]
        return sum(file.count for file in self.files), problems

    def find(self, name: str) -> tuple[DbcFile, Message] | str:
        """Return a message and its file, or why there is none; load the message if necessary."""
        holders = self._files.get(name, [])
        if not holders:
            text = f"expected a message of the DBC files, got {name!r}"
            return text + there_are(name, sorted(self._files))
        if len(holders) > 1:
            files = ", ".join(str(file.path) for file in holders)
            return f"{name!r} stands more than once in the DBC files: {files}"
        (file,) = holders
        if name not in self._loaded:
            try:
                message = file.read(name)
            except OSError as error:
                return f"{file.path}: {error.strerror or error}"
            if isinstance(message, str):
                return message
            self._loaded[name] = message
        return file, self._loaded[name]
