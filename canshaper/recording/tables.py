"""Readers of logs that are tables with named columns, and the writer of logs.

They read the tables of python-can, GVRET (SavvyCAN), CANedge, Kvaser and Vector, with commas,
semicolons or tabs, also after Excel has saved them.
"""

import csv as quoted
import re
from base64 import b64decode
from collections.abc import Collection, Iterator, Mapping, Sequence
from decimal import Decimal
from operator import itemgetter
from pathlib import Path
from typing import BinaryIO, TextIO

from canshaper.codec.frame import Frame, MessageKey
from canshaper.codec.layout import CLASSICAL_BYTES, FD_LENGTHS
from canshaper.errors import LogError
from canshaper.recording.asc import lines, shown
from canshaper.recording.channels import LATEST_S, MOST_BYTES, Place, TimedFrame
from canshaper.recording.ticks import Result, Tick

# Names of columns without case, units and signs; the first two groups and one of data are needed.
NAMES: Mapping[str, str] = {
    "time": "time|timestamp|timestampepoch|zeit",
    "id": "id|arbitrationid|canid|identifier",
    "data": "data|databytes",
    "channel": "channel|chn|chan|ch|bus|buschannel|kanal",
    "extended": "extended|ide|ext",
    "remote": "remote|rtr",
    "error": "error",
    "flags": "flags",
    "kind": "eventtype|type",
    "direction": "dir|direction",
    "length": "datalength|length|len",
    "code": "dlc",
}
_COLUMN = re.compile("|".join(f"(?P<{name}>{words})" for name, words in NAMES.items()))
_BYTE = re.compile(r"(?:d|data)(\d{1,2})")
_UNIT = re.compile(r"[\[( ](ms|us|µs|ns)\b")
_UNITS = {"ms": 6, "us": 3, "µs": 3, "ns": 0}
FORMAT = re.compile(r"format of (id|data) field\W+(hex|dec)", re.IGNORECASE)  # Kvaser's
_TRUE = frozenset(("1", "true", "wahr"))
_REMOTE, _EXTENDED, _ERROR = 1, 4, 0x20  # Kvaser's flags
WRAP_NS = (1 << 32) * 1000  # period of a 32-bit clock in microseconds
_new = tuple.__new__  # TimedFrame(...) in half the time
MOST_KNOWN = 10_000
MOST_ABOVE = 30  # lines above the header
HEADER = "a header that names time, id and data, such as Time;Channel;ID;DLC;Data"
# Channel, id, whether that is extended, and length; or of what kind it is that is left out.
Known = tuple[str, int, bool, int | None] | str


def is_log(header: str) -> bool:
    """Return whether a first line is that of a log of frames, even if it lacks a column."""
    of_kvaser = header.strip().startswith(("CSV CAN data", "Kvaser Memorator Log"))
    return of_kvaser or "arbitration_id" in header or Table.of(header) is not None


def is_table(path: Path) -> bool:
    """Return whether a .csv, .tsv or .txt file is a table of numbers, no log of CAN frames.

    Raises:
        OSError: it cannot be read.
    """
    if path.suffix.lower() not in (".csv", ".tsv", ".txt"):
        return False
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        return not is_log(file.readline(10_000))


def csv(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Yield the data frames of a table; its header may stand below up to 29 other lines."""
    rows, bases = lines(file, place), {}
    first = header = next(rows, b"").decode("utf-8", "replace").strip()
    while (table := Table.of(header)) is None:
        if match := FORMAT.search(header):
            bases[match[1].lower()] = 16 if match[2].lower() == "hex" else 10
        if place.number >= MOST_ABOVE or not (row := next(rows, b"")):
            place.number = 1
            raise place.error(shown(first.encode()), HEADER)
        header = row.decode("utf-8", "replace").strip()
    table.bases.update(bases)
    frames = table.frames(rows, place)
    return _unwrapped(frames) if table.of_gvret else frames


def _unwrapped(frames: Iterator[TimedFrame]) -> Iterator[TimedFrame]:
    """Yield frames with the wraps of a 32-bit clock undone; a negative first time becomes 0."""
    offset_ns: int | None = None
    before_ns = 0
    for frame in frames:
        if offset_ns is None:
            offset_ns = before_ns = max(0, -frame.time_ns)
        elif before_ns - frame.time_ns - offset_ns > WRAP_NS * 9 // 10:
            offset_ns += WRAP_NS
        before_ns = frame.time_ns + offset_ns
        yield frame._replace(time_ns=before_ns) if offset_ns else frame


class Table:
    """The columns of a table, by the names in ``NAMES``, and the reader of its rows.

    Attributes:
        bases: number bases of identifiers ("id") and bytes ("data").
        of_gvret: GVRET wrote the table: its times are in microseconds, without a unit.
    """

    def __init__(self, header: str, delimiter: str, at: dict[str, int], *, cells: bool) -> None:
        self.bases = {"id": 16, "data": 16}
        self._header, self._delimiter, self._at, self._cells = header, delimiter, at, cells
        self._packed = "arbitration_id" in header  # python-can's, in Base64
        unit = _UNIT.search(header.lower().split(delimiter)[at["time"]])
        self.of_gvret = cells and header.lower().startswith("time stamp")
        self._power = _UNITS[unit[1]] if unit else 3 if self.of_gvret else 9

    @classmethod
    def of(cls, header: str) -> "Table | None":
        """Return the table under a header; None if it names no time, no id or no data."""
        delimiter = next((one for one in ";\t," if one in header), ",")
        at: dict[str, int] = {}
        cells = False
        for place, cell in enumerate(header.replace('"', "").lower().split(delimiter)):
            name = re.sub(r"[^a-z0-9]", "", re.sub(r"[\[(].*", "", cell))
            if _BYTE.fullmatch(name):
                cells = cells or "data" not in at
                at.setdefault("data", place)
            elif (match := _COLUMN.fullmatch(name)) and match.lastgroup:
                at.setdefault(match.lastgroup, place)
        if not {"time", "id", "data"} <= at.keys():
            return None
        return cls(header, delimiter, at, cells=cells)

    def frames(self, rows: Iterator[bytes], place: Place) -> Iterator[TimedFrame]:
        """Yield the data frames of these rows."""
        others = [at for name, at in self._at.items() if name not in ("time", "data")]
        key_of = itemgetter(*others)
        width, delimiter, at_time = max(self._at.values()) + 1, self._delimiter, self._at["time"]
        known: dict[object, Known] = {}  # most rows are of a few kinds
        for row in rows:
            text = row.decode("utf-8", "replace").strip()
            if not text:
                continue
            try:
                cells = text.split(delimiter)
                if '"' in text:
                    (cells,) = quoted.reader([text], delimiter=delimiter)
                if len(cells) < width:
                    cells += [""] * (width - len(cells))
                key = key_of(cells)
                if (what := known.get(key)) is None:
                    if len(known) == MOST_KNOWN:
                        known.clear()
                    known[key] = what = self._kind(cells, place)
                if isinstance(what, str):
                    place.left_out[what] += 1
                    continue
                channel, can_id, extended, length = what
                payload, time_ns = self._payload(cells, length), self._time_ns(cells[at_time])
            except LogError:
                raise
            except (ArithmeticError, ValueError, quoted.Error):
                raise place.error(shown(row), f"a row of {self._header}") from None
            frame = _new(TimedFrame, (time_ns, channel, can_id, extended, payload))
            if length is None or len(payload) != length:
                place.checked(frame, len(payload) if length is None else length)
            yield frame

    def _kind(self, cells: Sequence[str], place: Place) -> Known:
        """Return (channel, id, extended, length or None) of a row; or why the row is left out."""
        row = {name: cells[at].strip().lower() for name, at in self._at.items()}
        flags = int(row.get("flags") or "0")
        for name, bit in (("error", _ERROR), ("remote", _REMOTE)):
            if flags & bit or name in row.get("kind", "") or row.get(name) in _TRUE:
                return name
        if not (word := row["id"]):
            return "without id"
        if row.get("direction") == "txrq":  # a Tx row follows it
            return "asked for"
        if self._packed and not word.startswith("0x"):
            raise ValueError
        digits = word.removeprefix("0x").removesuffix("h").removesuffix("x")
        number = _number(digits, self.bases["id"])
        extended = row.get("extended") in _TRUE or bool(flags & _EXTENDED)
        if not {"extended", "flags"} & row.keys():
            extended = word.endswith("x") or len(digits) == 8 or number > 0x7FF
        length = int(row["length"]) if row.get("length") else None
        if length is None and row.get("code"):
            length = int(row["code"])
            if not self._packed and CLASSICAL_BYTES < length < len(FD_LENGTHS):
                length = FD_LENGTHS[length]
        if (length or 0) > MOST_BYTES:
            return "impossible"
        channel = cells[self._at["channel"]].strip() if "channel" in row else ""
        place.checked(TimedFrame(0, channel, number, extended, b""), 0)
        return channel, number, extended, length

    def _payload(self, cells: Sequence[str], length: int | None) -> bytes:
        at, base = self._at["data"], self.bases["data"]
        if self._packed:
            return b64decode(cells[at], validate=True)
        if self._cells:
            end = at + (CLASSICAL_BYTES if length is None else length)
            words = [cell for cell in cells[at:end] if cell]
        elif base == 16:
            return bytes.fromhex(cells[at])
        else:
            words = cells[at].split()
        text = "".join(words)
        if base == 16 and len(text) == 2 * len(words):
            return bytes.fromhex(text)
        return bytes([_number(word.strip(), base) for word in words])

    def _time_ns(self, word: str) -> int:
        power = self._power
        if power == 3 and word.isdecimal() and len(word) <= 19:
            return int(word) * 1000
        whole, _, part = word.partition(".")
        if whole.isdigit() and len(whole) <= 19 and len(part) <= power and (part or "0").isdigit():
            return int(whole + part.ljust(power, "0"))
        seconds = Decimal(word.replace(",", "."))
        if abs(seconds) > LATEST_S * 10 ** (9 - power):  # before it has a million digits
            raise ValueError
        return int(seconds.scaleb(power).to_integral_value())


def _number(word: str, base: int) -> int:
    if not (word.isascii() and word.isalnum() and len(word) <= 10):  # int() takes more
        raise ValueError
    return int(word, base)


class LogWriter:
    """Writes received and sent frames as ``candump -L`` does.

    Args:
        file: the open log.
        channel_of: channel by bus; an empty one becomes the name of the bus.
        fd: messages of CAN FD; a frame longer than a classical one is also written as CAN FD.
    """

    def __init__(
        self, file: TextIO, channel_of: Mapping[str, str], fd: Collection[MessageKey] = ()
    ) -> None:
        self._file, self._fd = file, fd
        # A log without channels gets the names of the buses.
        self._channel_of = {bus: channel or bus for bus, channel in channel_of.items()}
        self._last_ns = 0

    def write(self, tick: Tick, result: Result) -> None:
        """Write a tick but its ``logged``; its ``others`` get the time of the line before."""
        for time_ns, frame in tick.received:
            self._line(time_ns, frame)
        for frame in tick.others:
            self._line(self._last_ns, frame)
        for frame in result.sent:
            self._line(tick.now_ns, frame)

    def _line(self, time_ns: int, frame: Frame) -> None:
        self._last_ns = time_ns = max(time_ns, self._last_ns)
        seconds, ns = divmod(time_ns, 10**9)
        can_id = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
        channel = self._channel_of[frame.bus]
        fd = "#0" if frame[:3] in self._fd or len(frame.data) > CLASSICAL_BYTES else ""
        data = f"{fd}{frame.data.hex().upper()}"
        self._file.write(f"({seconds}.{ns // 1000:06d}) {channel} {can_id}#{data}\n")
