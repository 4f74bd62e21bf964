"""DBC files of a deployment: loading them, finding messages, problems with file and line."""

import logging
import re
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import cantools
from cantools.database.can import Database, Message

from canshaper.codec.layout import is_j1939, layout_fault
from canshaper.config.bounded import read_bounded
from canshaper.config.source import Problem

# Of all DBC files of a deployment: ten times those of a machine.
MOST_BYTES = 400_000
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
_DEFINITION = re.compile(r"\s*BO_\s+(\d{1,10})\s+(\w+)")
WIDE_ID = "an id of 29 bits stands in a DBC file with bit 31 set: 0x80000000 more"


@dataclass(frozen=True)
class DbcFile:
    """A loaded DBC file.

    Attributes:
        sha256: of its bytes, in hexadecimal digits.
    """

    path: Path
    database: Database
    sha256: str
    _lines: dict[tuple[int, str], int]

    def problem(self, message: Message, text: str) -> Problem:
        """A problem of this file at the line where the message is defined."""
        number = message.frame_id | (0x80000000 if message.is_extended_frame else 0)
        return Problem(str(self.path), self._lines.get((number, message.name)), message.name, text)


def _line_of(text: str, pattern: str) -> int | None:
    """Number of the first line of a text that starts with a pattern."""
    start = re.search(rf"^[^\S\n]*{pattern}", text, re.MULTILINE)
    return text.count("\n", 0, start.start()) + 1 if start else None


def load_dbc(path: Path) -> tuple[DbcFile | None, list[Problem]]:
    """Load a DBC file strictly; instead of a file its problems, where it is none.

    Raises:
        OSError: the file cannot be read.
    """
    data = read_bounded(path, MOST_BYTES)
    # Line ends as open() reads them: they stand in comments too.
    text = data.decode("cp1252", errors="replace").replace("\r\n", "\n").replace("\r", "\n")
    if large := _too_large(text):
        line, why = large
        return None, [Problem(str(path), line, "", f"not a DBC file that can be used: {why}")]
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
        elif at := re.search(r"in message (\w+)|unused VAL_ entries in DBC: (VAL_ \d+ \w+)", why):
            line = _line_of(text, rf"BO_\s+\d+\s+{at[1]}\b" if at[1] else re.escape(at[2]))
        else:
            line = None
        return None, [Problem(str(path), line, "", f"not a DBC file that can be used: {why}")]
    assert isinstance(database, Database)
    loaded = DbcFile(path, database, sha256(data).hexdigest(), _definitions(text))
    problems = []
    seen: dict[tuple[int, bool], str] = {}
    for message in database.messages:
        key = (message.frame_id, message.is_extended_frame)
        if key in seen:
            text = f"has the id {message.frame_id:#x} of {seen[key]}"
            problems.append(loaded.problem(message, text))
        seen[key] = message.name
    faults = [(m, fault) for m in database.messages if (fault := layout_fault(m) or _id_fault(m))]
    problems += [loaded.problem(*fault) for fault in faults]
    return None if faults else loaded, problems


def _too_large(text: str) -> tuple[int | None, str] | None:
    """Line and reason, where a file would take cantools more time or memory than there is."""
    if large := _TOO_LARGE.search(text):
        line = text.count("\n", 0, large.end()) + 1
        return line, f"found {large[1] or large[2]} bytes or bits, allowed are 99999 at most"
    if (payload := sum(map(int, _LENGTH.findall(text)))) > MOST_PAYLOAD:
        return None, f"found {payload} bytes in its messages, allowed are {MOST_PAYLOAD} at most"
    if (words := len(text.split())) > MOST_WORDS:
        return None, f"found {words} words, allowed are {MOST_WORDS} at most"
    return None


def _definitions(text: str) -> dict[tuple[int, str], int]:
    """Line of each message by its number in the file and its name."""
    lines: dict[tuple[int, str], int] = {}
    for number, row in enumerate(text.split("\n"), 1):
        if found := _DEFINITION.match(row):
            lines.setdefault((int(found[1]), found[2]), number)
    return lines


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
        self._by_name: dict[str, list[tuple[DbcFile, Message]]] = {}
        for file in files:
            for message in file.database.messages:
                self._by_name.setdefault(message.name, []).append((file, message))

    def ids(self) -> set[tuple[int, bool]]:
        """(id, extended) of every message."""
        return {(message.frame_id, message.is_extended_frame) for message in self.all()}

    def all(self) -> list[Message]:
        """Every message."""
        return [message for entries in self._by_name.values() for _, message in entries]

    def find(self, name: str) -> tuple[DbcFile, Message] | str:
        """The message and its file, or why there is none."""
        found = self._by_name.get(name, [])
        if not found:
            names = ", ".join(sorted(self._by_name)) or "none"
            return f"found {name!r}, messages of the DBC files are {names}"
        if len(found) > 1:
            files = ", ".join(str(f.path) for f, _ in found)
            return f"{name!r} stands more than once in the DBC files: {files}"
        return found[0]
