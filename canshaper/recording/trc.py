"""PEAK's TRC, versions 1.0 to 2.1 (PEAK CAN TRC File Format, document of PEAK-System)."""

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from typing import BinaryIO

from canshaper.codec.layout import CLASSICAL_BYTES, FD_LENGTHS
from canshaper.errors import LogError
from canshaper.recording.asc import lines, shown
from canshaper.recording.channels import MOST_BYTES, Place, TimedFrame

# Columns by version: number, offset of time (ms), bus, type, id, reserved, length, data. From 2.0
# on the file names them.
COLUMNS: Mapping[str, str] = {
    "1.0": "NOILD",
    "1.1": "NOTILD",
    "1.2": "NOBTILD",
    "1.3": "NOBTIRLD",
}
NAMED = ("2.0", "2.1")
_EPOCH = datetime(1899, 12, 30, tzinfo=UTC)  # of Delphi's dates, and of spreadsheets
# Kinds of lines that are frames, and kinds that are left out by name; others are events.
_FD = frozenset(("FD", "FB", "FE", "BI"))
_DATA = frozenset(("Rx", "Tx", "DT")) | _FD
_LEFT_OUT = {
    **dict.fromkeys(("Error", "ER"), "error"),
    "RR": "remote",
}
_NO_ID = "FFFFFFFF"  # of a warning, in version 1.0


def trc(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Its data frames; the last line needs no end."""
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
    """The begin of the log from the epoch of all others, us.

    Raises:
        LogError: it is no day.
    """
    try:
        return round((_EPOCH + timedelta(days=float(days))).timestamp() * 1e6)
    except (ValueError, OverflowError):
        raise place.error(shown(days.encode()), "days since 1899-12-30") from None


def _frame(cells: list[str], columns: str, begin_ns: int, place: Place) -> TimedFrame | None:
    """The frame of a line; None where it is another one, or none.

    Raises:
        LogError: it is no whole frame.
        ValueError, IndexError: it is no line of these columns.
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
