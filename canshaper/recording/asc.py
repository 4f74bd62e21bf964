"""Readers of Vector's ASC and PEAK's TRC 1.0 to 2.1, and the line reader that text logs share.

TRC: PEAK CAN TRC File Format, document of PEAK-System.
"""

import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import BinaryIO

from canshaper.codec.layout import CLASSICAL_BYTES, FD_LENGTHS
from canshaper.errors import LogError
from canshaper.recording.channels import MOST_BYTES, Place, TimedFrame

SECOND_NS = 1_000_000_000
# Far longer than any line of a log; a file without line ends must not fill the memory.
LONGEST_LINE = 65_536
SHOWN = 60


def lines(file: BinaryIO, place: Place, *, last: bool = False) -> Iterator[bytes]:
    """Yield lines with their line end.

    Args:
        file: the log.
        place: position of the reader, in which the lines are counted.
        last: the last line needs no end; else a line without one raises CutOffError.

    Raises:
        LogError: a line is as long as ``LONGEST_LINE``, or cut off.
    """
    for line in iter(partial(file.readline, LONGEST_LINE), b""):
        place.number += 1
        if line[-1] != 10:
            if len(line) == LONGEST_LINE:
                raise place.error(f"{LONGEST_LINE} bytes without a line end", "a log that is text")
            if not last:
                raise place.cut_off(f"no line end after {shown(line)}")
        yield line


def shown(line: bytes) -> str:
    """Return a line in quotes for a person; only the beginning of a long line."""
    text = line.decode("utf-8", "replace").rstrip()
    return repr(text if len(text) <= SHOWN else text[: SHOWN - 3] + "...")


RTR = 0x10  # a remote frame, in the flags of a line of CAN FD
_BASE = re.compile(r"base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.IGNORECASE)
_ASC = re.compile(
    r"\s*(\d+)\.(\d{1,9})\s+(\d+)\s+(\S+)\s+(Rx|Tx|TxRq)\s+(?:([dr])\b\s*(.*))", re.ASCII
)
_ASC_ERROR = re.compile(r"\s*\d+\.\d+\s+(?:\d+|CANFD\s+\d+\s+\S+)\s+ErrorFrame", re.IGNORECASE)
_ASC_FD = re.compile(r"\s*(\d+)\.(\d{1,9})\s+CANFD\s+(\d+)\s+(Rx|Tx|TxRq)\s+(\S+)\s+(.*)", re.ASCII)
_BEFORE = re.compile(r"\s*-\d+\.\d+\s+(?:\d+|CANFD)\s", re.ASCII)
_STAMP = re.compile(r"\s*(\d{1,10})\.(\d{1,9})\s", re.ASCII)
ASC_NUMBERS = "a line of an ASC log, such as 0.015991 1 110 Rx d 2 01 02, with numbers"


def asc(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Yield the data frames of Vector's ASC; count other frames, skip other lines silently."""
    base, relative, before_ns = 16, False, 0
    for raw in lines(file, place):
        line = raw.decode("utf-8", "replace").rstrip()
        if relative and (stamp := _STAMP.match(line)):
            before_ns += int(stamp[1]) * SECOND_NS + int(stamp[2].ljust(9, "0"))
        if match := _ASC.match(line):
            seconds, fraction, channel, number, direction, kind, rest = match.groups()
            count, *data = rest.split() or [""]
            on_fd = False
        elif _ASC_ERROR.match(line):
            place.left_out["error"] += 1
            continue
        elif match := _ASC_FD.match(line):
            seconds, fraction, channel, direction, number, rest = match.groups()
            count, *data = _data(rest.split())
            on_fd = True
            kind = "r" if count == "R" else "d"
        else:
            base, relative = _read_on(line, base, relative, place)
            continue
        if direction == "TxRq":  # asked for, not yet on the bus; its Tx follows
            continue
        if kind == "r":
            place.left_out["remote"] += 1
            continue
        extended = number[-1] in "xX"
        try:
            own_ns = int(seconds) * SECOND_NS + int(fraction.ljust(9, "0"))
            time_ns = (relative and before_ns) or own_ns
            can_id, length, payload = _numbers(number, count, data, base, fd=on_fd)
        except ValueError:
            raise place.error(shown(raw), ASC_NUMBERS) from None
        yield place.checked(TimedFrame(time_ns, channel, can_id, extended, payload), length)


def _read_on(line: str, base: int, relative: bool, place: Place) -> tuple[int, bool]:
    """Return number base and whether times are relative, after this line without a data frame."""
    if header := _BASE.match(line):
        base = 10 if header[1].lower() == "dec" else 16
        relative = bool(header[2]) and header[2].lower() == "relative"
    elif _BEFORE.match(line):
        place.left_out["before the start"] += 1
    return base, relative


def _numbers(
    number: str, count: str, data: list[str], base: int, *, fd: bool
) -> tuple[int, int, bytes]:
    """Return id, length in bytes and data of a line.

    On a CAN FD channel the length is decimal; on another it is in ``base``, and at most 8.

    Raises:
        ValueError: a cell is no number, or a byte is more than 255.
    """
    length = int(count) if fd else min(8, int(count, base))
    digits = "".join((number, count, *data[:length]))
    if not (digits.isascii() and digits.isalnum()):  # int() takes signs, _ and foreign digits too
        raise ValueError
    payload = bytes([int(byte, base) for byte in data[:length]])
    return int(number.rstrip("xX"), base), length, payload


def _data(words: list[str]) -> list[str]:
    """Return [length, byte, ...] from the words after the id, in a line of a CAN FD channel.

    A remote frame gives ["R"]; a wrong length or wrong flags give [""], which the caller reports.
    Before the data stand a name (not always), two flags, the length code and the length; after the
    data stand the frame's duration, number of bits and flags.
    """
    if words and words[0] not in ("0", "1"):
        words = words[1:]
    try:
        length, data = int(words[3]), words[4:]
        flags = int(data[length:][2], 16)
    except (IndexError, ValueError):
        return [""]
    if length > MOST_BYTES:
        return [""]
    return ["R"] if flags & RTR else [words[3], *data[:length]]


# Columns by version: number, offset of time (ms), bus, type, id, reserved, length, data. From 2.0
# on the file names them.
COLUMNS: Mapping[str, str] = {"1.0": "NOILD", "1.1": "NOTILD", "1.2": "NOBTILD", "1.3": "NOBTIRLD"}
NAMED = ("2.0", "2.1")
_EPOCH = datetime(1899, 12, 30, tzinfo=UTC)  # day 0 of Delphi's dates and of spreadsheets
# Kinds of lines that are frames, and kinds that are left out by name; others are events.
_FD = frozenset(("FD", "FB", "FE", "BI"))
_DATA = frozenset(("Rx", "Tx", "DT")) | _FD
_LEFT_OUT = {**dict.fromkeys(("Error", "ER"), "error"), "RR": "remote"}
_NO_ID = "FFFFFFFF"  # id of a warning, in version 1.0


def trc(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Yield the data frames of a TRC log; its last line needs no end."""
    begin_us = 0
    version = "1.0"
    columns = COLUMNS[version]
    for raw in lines(file, place, last=True):
        line = raw.decode("utf-8", "replace").strip()
        if not line or line[0] == ";":
            key, _, value = line.partition("=")
            if key == ";$FILEVERSION":
                version = value.strip()
                columns = COLUMNS.get(version, "")
                if not columns and version not in NAMED:
                    raise place.error(version, f"a version of {', '.join((*COLUMNS, *NAMED))}")
            elif key == ";$STARTTIME":
                begin_us = _begin_us(value, place)
            elif key == ";$COLUMNS":
                columns = value.replace(",", "").replace(" ", "")
            continue
        if not columns:
            raise place.error("none", ";$COLUMNS=, which versions from 2.0 on have")
        try:
            frame = _frame(line.split(maxsplit=len(columns) - 1), columns, begin_us * 1000, place)
        except LogError:
            raise
        except (ValueError, IndexError):
            raise place.error(shown(raw), f"a line of TRC {version}: {' '.join(columns)}") from None
        if frame is not None:
            yield frame


def _begin_us(days: str, place: Place) -> int:
    """Return the start time of the log in microseconds since 1970.

    Raises:
        LogError: ``days`` is no number of days since 1899-12-30, or far from any date.
    """
    try:
        return round((_EPOCH + timedelta(days=float(days))).timestamp() * 1e6)
    except (ValueError, OverflowError):
        raise place.error(shown(days.encode()), "days since 1899-12-30") from None


def _frame(cells: list[str], columns: str, begin_ns: int, place: Place) -> TimedFrame | None:
    """Return the data frame of a line; None for a line with another frame or an event.

    Each letter of ``columns`` names a cell, as in ``COLUMNS``; ``begin_ns`` is the log's start.

    Raises:
        LogError: the frame is not complete, is too long, or its id does not fit.
        ValueError, IndexError: the line does not have these columns.
    """
    at = columns.index
    kind = cells[at("T")] if "T" in columns else "DT"
    if kind not in _DATA:
        if kind in _LEFT_OUT:
            place.left_out[_LEFT_OUT[kind]] += 1
        return None
    number = cells[at("I")]
    if number == _NO_ID:
        return None
    length = int(cells[at("l")]) if "l" in columns else FD_LENGTHS[int(cells[at("L")])]
    data = cells[at("D")] if length else ""
    if data[:3] == "RTR":
        place.left_out["remote"] += 1
        return None
    payload = bytes.fromhex(data[: 3 * length - 1] if length else "")
    most = MOST_BYTES if kind in _FD else CLASSICAL_BYTES
    if len(payload) != length or length > most:
        raise place.error(f"{len(payload)} of {length} bytes", f"all of them, {most} at most")
    can_id, extended = int(number, 16), len(number) > 4
    whole, _, part = cells[at("O")].partition(".")
    time_ns = begin_ns + int(whole) * 1_000_000 + int((part or "0").ljust(6, "0")[:6])
    channel = cells[at("B")] if "B" in columns else "1"
    return place.checked(TimedFrame(time_ns, channel, can_id, extended, payload), length)
