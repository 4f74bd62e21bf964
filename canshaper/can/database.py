"""DBC files of a deployment: loading them, finding messages, problems with file and line."""

import logging
import re
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import cantools
from cantools.database.can import Database, Message

from canshaper.can.layout import is_j1939, layout_fault
from canshaper.config.source import Problem

# Bytes of a message, first bit and bits of a signal: cantools makes a list of as many, and the
# memory would not last. The longest of J1939 has 1785 bytes.
_TOO_LARGE = re.compile(
    r"\bBO_\s+\d+\s+\w+\s*:\s*(\d{6,})|\bSG_\s+\w+(?:\s+\w+)?\s*:\s*(?:\d+\s*\|\s*)?(\d{6,})"
)
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

    def problem(self, message: Message, text: str) -> Problem:
        """A problem of this file at the line where the message is defined."""
        number = message.frame_id | (0x80000000 if message.is_extended_frame else 0)
        line = _line_of(self.path, rf"BO_\s+{number}\s+{message.name}\b")
        return Problem(str(self.path), line, message.name, text)


def _line_of(path: Path, pattern: str) -> int | None:
    """Number of the first line of a file that starts with a pattern."""
    rows = path.read_text(encoding="cp1252", errors="replace").splitlines()
    start = re.compile(rf"\s*{pattern}")
    return next((i for i, row in enumerate(rows, 1) if start.match(row)), None)


def load_dbc(path: Path) -> tuple[DbcFile | None, list[Problem]]:
    """Load a DBC file strictly; instead of a file its problems, where it is none.

    Raises:
        OSError: the file cannot be read.
    """
    data = path.read_bytes()
    # Line ends as open() reads them: they stand in comments too.
    text = data.decode("cp1252", errors="replace").replace("\r\n", "\n").replace("\r", "\n")
    if large := _TOO_LARGE.search(text):
        line: int | None = text.count("\n", 0, large.end()) + 1
        text = f"found {large[1] or large[2]} bytes or bits, allowed are 99999 at most"
        return None, [Problem(str(path), line, "", f"not a DBC file that can be used: {text}")]
    # cantools only logs that of two messages with one id the first is lost; found below.
    logging.getLogger("cantools").setLevel(logging.ERROR)
    try:
        database = cantools.database.load_string(text, database_format="dbc")
    except Exception as error:  # whatever a broken file makes the parser raise
        cause = getattr(error, "e_dbc", None) or error  # without the names of other formats
        text = " ".join(str(cause).split()) or type(cause).__name__
        if "more than 11 bits" in text:
            text += f" ({WIDE_ID})"
        if at := re.search(r"at line (\d+)", text):
            line = int(at.group(1))
        elif at := re.search(r"in message (\w+)|unused VAL_ entries in DBC: (VAL_ \d+ \w+)", text):
            line = _line_of(path, rf"BO_\s+\d+\s+{at[1]}\b" if at[1] else re.escape(at[2]))
        else:
            line = None
        return None, [Problem(str(path), line, "", f"not a DBC file that can be used: {text}")]
    assert isinstance(database, Database)
    loaded = DbcFile(path, database, sha256(data).hexdigest())
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
