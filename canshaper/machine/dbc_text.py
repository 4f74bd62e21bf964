"""Assigns the text of a DBC file to its messages, in one pass over the statements, no parser.

cantools gets the text of the messages that are used (docs/decisions.md#cantools-at-the-desk).
Strings and comments end where cantools ends them: nothing inside one is taken for a statement.
"""

import re
from array import array
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from canshaper.codec.frame import EFF_FLAG, EFF_MASK, SFF_MASK
from canshaper.config.source import encoding_of

# Most messages and statements in all DBC files of a deployment: several times those of a machine.
MOST_MESSAGES = 20_000
MOST_STATEMENTS = 300_000
WIDE_ID = "an id of 29 bits stands in a DBC file with bit 31 set: 0x80000000 more"
# A message of this name holds the signals that belong to no message; cantools leaves it out.
_NO_MESSAGE = b"VECTOR__INDEPENDENT_SIG_MSG"
_OF_NO_MESSAGE = -1  # in place of an id: value tables, which no one reads

_STRING = r'"[^"\\]*+(?:\\"?[^"\\]*+)*+"'
_GAP = r"[ \t\n]*+(?://[^\n]*\n[ \t\n]*+)*+"
_NAME = r"[A-Za-z_]\w*+"
_NUMBER = r"[-+]?\d++(?:\.\d*+)?(?:[eE][-+]?\d++)?"
_VALUE = f"(?:{_NUMBER}|{_STRING})"
_TABLE = f"(?:{_NUMBER}{_GAP}{_STRING}{_GAP})*+"
_NAMES = f"{_NAME}(?:{_GAP},{_GAP}{_NAME})*+"


def _row(*parts: str) -> str:
    return _GAP.join(parts)


def keyword(word: str) -> str:
    """Return the pattern of a keyword; its look-behind comes last, so it starts with a letter."""
    return rf"{word}(?<!\w{word})\b"


def _id(kind: str) -> str:
    return rf"(?P<{kind}_id>\d{{1,10}}+)(?![\w.])"


_SIGNAL = _row(
    *(r"SG_\b", _NAME, f"(?:{_NAME})?+", ":", _NUMBER, r"\|", _NUMBER, "@", r"\d++", "[-+]"),
    *(r"\(", _NUMBER, ",", _NUMBER, r"\)", r"\[", _NUMBER, r"\|", _NUMBER, r"\]"),
    *(_STRING, _NAMES),
)
_BO, _SG, _BA, _CM, _REL = (keyword(word) for word in ("BO_", "SG_", "BA_", "CM_", "BA_REL_"))
# In ``_SCAN`` an empty group with the name of the pattern follows each. No pattern can run on from
# one statement into the next, so that all of them together take linear time.
_STATEMENTS = {
    "message": _row(
        _BO, _id("message"), f"(?P<name>{_NAME})", ":", r"(?P<length>\d{1,5}+)(?![\w.])"
    )
    + f"{_GAP}{_NAME}(?P<signals>(?:{_GAP}{_SIGNAL})*+)(?!{_GAP}SG_\\b)",
    "table": _row(keyword("VAL_"), _id("table"), _NAME, f"{_TABLE};"),
    "type": _row(keyword("SIG_VALTYPE_"), _id("type"), _NAME, ":", r"\d++", ";"),
    "long": _row(
        _BA, '"SystemMessageLongSymbol"', _BO, _id("long"), r'"(?P<symbol>[^"\\\n]*+)"', ";"
    ),
    "of_message": _row(_BA, _STRING, _BO, _id("of_message"), _VALUE, ";"),
    "of_signal": _row(_BA, _STRING, _SG, _id("of_signal"), _NAME, _VALUE, ";"),
    "message_text": _row(_CM, _BO, _id("message_text"), _STRING, ";"),
    "signal_text": _row(_CM, _SG, _id("signal_text"), _NAME, _STRING, ";"),
    "sender": _row(keyword("BO_TX_BU_"), _id("sender"), ":", _NAMES, ";"),
    "group": _row(
        keyword("SIG_GROUP_"), _id("group"), _NAME, _NUMBER, ":", f"(?:{_NAME}{_GAP})*+;"
    ),
    "choosing": _row(keyword("SG_MUL_VAL_"), _id("choosing"), _NAME, _NAME, r"[-\d \t\n,]++;"),
    "to_node": _row(_REL, _STRING, keyword("BU_BO_REL_"), _NAME, _id("to_node"), _VALUE, ";"),
    "in_node": _row(_REL, _STRING, keyword("BU_SG_REL_"), _NAME, _SG, _id("in_node"), _NAME)
    + f"{_GAP}{_VALUE}{_GAP};",
    "no_message": _row(keyword("VAL_TABLE_"), _NAME, f"{_TABLE};"),
    # Text that no statement has matched: an unexpected form of a message, and the rest.
    "odd": _row(_BO, r"[-+\d]"),
    "strings": rf'(?:{_STRING}[^"/BCSV]*+)++',
    "comment": r"//[^\n]*+",
    "endless": '"',
}
_SCAN = re.compile("|".join(f"{text}(?P<{kind}>)" for kind, text in _STATEMENTS.items()).encode())
# A signal without receiver or a message without sender, whose node name is missing in the file.
_NO_NODE = re.compile(
    rb'^[ \t]*(?:SG_[ \t][^"\n]*"[^"\n]*"|BO_[ \t]+\d+[ \t]+\w+[ \t]*:[ \t]*\d+)'
    rb"(?=\s*(?:[A-Z_]+_\b|\Z))",
    re.MULTILINE,
)
_OF_SIGNAL = re.compile(_row(r"(\w++)", r"\d++", f"({_NAME})").encode())
# Longest message (bytes) whose signals are compared: the most that ISO 15765-2 sends at once.
LONGEST = 4095
_PLACE = re.compile(
    _GAP.join((r"SG_\b", r"(\w++)", r"(\w*+)", ":", r"([^ \t\n|/]++)", r"\|")).encode()
    + _GAP.join(("", r"([^ \t\n@/]++)", "@", r"(\d++)")).encode()
)
_DIGITS = re.compile(rb"\d{1,5}")


class Entry(NamedTuple):
    """A message of a DBC file.

    Attributes:
        name: name of the message; the long one, where it has two.
        number: id as in the file, with bit 31 set for an id of 29 bits.
        line: line of its definition; None where unknown.
        fault: why it cannot be used, as far as our scan shows, or None.
    """

    name: str
    number: int
    line: int | None
    fault: str | None = None

    @property
    def key(self) -> tuple[int, bool]:
        """(id, extended)."""
        return self.number & ~EFF_FLAG, self.number >= EFF_FLAG


@dataclass(frozen=True)
class DbcText:
    """Text of a DBC file, divided by message.

    Attributes:
        data: the whole text in cp1252, with line ends ``\\n``.
        entries: messages of the file; None where only cantools can find them.
    """

    data: bytes
    entries: list[Entry] | None
    _starts: "array[int]"
    _ends: "array[int]"
    _numbers: "array[int]"
    _leftover: "array[int]"

    def of(self, numbers: Collection[int]) -> str:
        """Return the text without messages of other ids and leftover tables; lines keep numbers."""
        return b"".join(self._parts(numbers)).decode("cp1252", errors="replace")

    def whole(self) -> str:
        """Return the whole text."""
        return self.data.decode("cp1252", errors="replace")

    @property
    def statements(self) -> int:
        """Number of statements on messages and signals, and of value tables."""
        return len(self._starts)

    def without_type(self) -> set[int]:
        """Return the ids of messages with the value type of a missing signal: its bits are open."""
        return {self._numbers[i] for i in self._leftover if not self._is_table(i)}

    def leftover(self, numbers: Collection[int]) -> list[int]:
        """Return indices of value tables and types of missing signals, no types in ``numbers``."""
        return [i for i in self._leftover if self._is_table(i) or self._numbers[i] not in numbers]

    def leftover_faults(self, places: Iterable[int]) -> Iterator[tuple[int, str]]:
        """Yield (line, fault) of these statements, as ``leftover`` gives them, in its order."""
        line = at = 0
        for i in places:
            start = self._starts[i]
            line, at = line + self.data.count(b"\n", at, start), start
            match = _OF_SIGNAL.match(self.data, start)
            assert match  # it is one of the statements
            what = f"{match[1].decode()} {self._numbers[i]} {match[2].decode()}"
            yield line + 1, f"{what} is of a signal that there is not"

    def _is_table(self, i: int) -> bool:
        """Return whether a statement is a table of values, which only names them."""
        return self.data.startswith(b"VAL_", self._starts[i])

    def _parts(self, numbers: Collection[int]) -> Iterator[bytes]:
        at = 0
        unnamed = {self._starts[i] for i in self._leftover if self._is_table(i)}
        for start, end, number in zip(self._starts, self._ends, self._numbers, strict=True):
            if number not in numbers or start in unnamed:
                yield self.data[at:start]
                yield b"\n" * self.data.count(b"\n", start, end)
                at = end
        yield self.data[at:]


def dbc_text(data: bytes) -> DbcText:
    """Scan a DBC file, in time and memory that are linear in its length.

    Raises:
        ValueError: the file has too many messages or statements.
    """
    data = _NO_NODE.sub(rb"\g<0> Vector__XXX", _cp1252(data))
    starts, ends, numbers, tables = (array("q") for _ in range(4))
    statements: list[tuple[bytes, int, int, str | None]] = []
    signals: dict[int, set[bytes]] = {}
    long: dict[int, str] = {}
    line = at = 0
    for match in _SCAN.finditer(data):
        kind = match.lastgroup
        assert kind  # each has one
        if kind in ("strings", "comment"):
            continue
        if kind in ("odd", "endless"):
            return DbcText(data, None, starts, ends, numbers, tables)
        start = match.start()
        number = _OF_NO_MESSAGE if kind == "no_message" else int(match[f"{kind}_id"])
        if kind == "message":
            line, at = line + data.count(b"\n", at, start), start
            names, fault = signals_fault(match["signals"], int(match["length"]))
            signals.setdefault(number, set()).update(names)
            statements.append((match["name"], number, line + 1, fault))
        elif kind == "long":
            long[number] = match["symbol"].decode("cp1252", errors="replace")
        elif kind in ("table", "type"):
            tables.append(len(starts))
        if len(statements) > MOST_MESSAGES or len(starts) >= MOST_STATEMENTS:
            raise ValueError(f"more than {MOST_MESSAGES} messages or {MOST_STATEMENTS} statements")
        starts.append(start)
        ends.append(match.end())
        numbers.append(number)
    entries = [
        Entry(long.get(number, name.decode()), number, line, _id_fault(number) or fault)
        for name, number, line, fault in statements
        if name != _NO_MESSAGE
    ]
    leftover = array("q")
    for i in tables:
        of_signal = _OF_SIGNAL.match(data, starts[i])
        if of_signal and of_signal[2] not in signals.get(numbers[i], ()):
            leftover.append(i)
    return DbcText(data, entries, starts, ends, numbers, leftover)


def _cp1252(data: bytes) -> bytes:
    """Return a text in cp1252 with line ends ``\\n``; decode it if it has a byte order mark."""
    if encoding := encoding_of(data[:4]):
        data = data.decode(encoding, "replace").encode("cp1252", "replace")
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _id_fault(number: int) -> str | None:
    """Return why no frame can have this id, or None."""
    if number < EFF_FLAG:
        text = f"has the id {number:#x} of more than 11 bits; {WIDE_ID}"
        return text if number > SFF_MASK else None
    can_id = number - EFF_FLAG
    return None if can_id <= EFF_MASK else f"has the id {can_id:#x} of more than 29 bits"


def signals_fault(text: bytes, length: int) -> tuple[list[bytes], str | None]:
    """Return a message's signal names, and its first fault: overlap, no room, name twice; or None.

    Args:
        text: the signals of the message.
        length: bytes of the message.
    """
    rows = _PLACE.findall(text)
    fault = _fault(rows, length) if length <= LONGEST else None
    return [row[0] for row in rows], fault


def _fault(rows: list[tuple[bytes, ...]], length: int) -> str | None:
    multiplexers = sum(mark.endswith(b"M") for _, mark, *_ in rows)
    every = 0  # bits of all signals so far; bit 0 is the lowest bit of the first byte
    used: dict[bytes, int] = {b"": 0}  # bits by value of the multiplexer
    masks: list[tuple[bytes, int]] = []
    names: set[tuple[bytes, bytes]] = set()
    for name, mark, first, count, order in rows:
        mask = _mask(first, count, order, length)
        if mask is None:
            return f"has {length} bytes, and the signal {name.decode()} is not within them"
        chosen = b"" if mark.endswith(b"M") else mark
        if multiplexers > 1 and mark.startswith(b"m"):
            continue  # with several multiplexers we do not know which signals exclude each other
        if (name, chosen) in names:
            return f"has two signals of the name {name.decode()}"
        names.add((name, chosen))
        before = used[b""] | used.get(chosen, 0) if chosen else every
        if before & mask:
            other = next(n for n, m in masks if m & mask & before)
            return f"has overlapping signals, {other.decode()} and {name.decode()}"
        used[chosen] = used.get(chosen, 0) | mask
        every |= mask
        masks.append((name, mask))
    return None


def _mask(first: bytes, count: bytes, order: bytes, length: int) -> int | None:
    """Return the mask of a signal's bits; None where they are not all within the message."""
    if not (_DIGITS.fullmatch(first) and _DIGITS.fullmatch(count)):
        return None
    begin, bits = int(first), int(count)
    if order == b"0":  # from the highest bit downwards, and on in the next byte
        begin = begin // 8 * 8 + 7 - begin % 8
    left = 8 * length - begin - bits
    if bits == 0 or left < 0:
        return None
    ones = (1 << bits) - 1
    if order == b"0":
        return int.from_bytes((ones << left).to_bytes(length, "big"), "little")
    return ones << begin
