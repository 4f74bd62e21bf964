"""Logs that are not text: MF4, read by asammdf, and the database of python-can's logger."""

import heapq
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from operator import itemgetter
from typing import Any, BinaryIO

from canshaper.codec.layout import CLASSICAL_BYTES
from canshaper.errors import LogError
from canshaper.recording.channels import MOST_BYTES, Place, TimedFrame
from canshaper.recording.form import install

GROUPS = {"": "CAN_DataFrame", "error": "CAN_ErrorFrame", "remote": "CAN_RemoteFrame"}
"""Names of ASAM's bus logging by the kind of a frame."""
PROJECT = "canshaper"
"""Project in the header of our MF4 files: a comment names the buses of their channels."""
AT_ONCE = 50_000
"""Records of MF4 that are in memory."""
BUS_EVENT = 0x2  # ASAM MDF 4.1, flags of a channel group
ID_MASK = 0x1FFFFFFF

# A float of that many seconds still holds nanoseconds; a date holds microseconds.
FINE_S = 4e6
_new = tuple.__new__  # TimedFrame(...) in half the time


def mf4(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """ASAM MDF 4 of a bus logger; times to the ns, frames of one group in their order."""
    try:
        from asammdf import MDF  # noqa: PLC0415  (an extra)
    except ModuleNotFoundError as error:
        raise LogError(f"{place}: MF4 logs need {error.name}, {install('mf4')}") from None
    try:
        with MDF(place.path if place.path.suffix.lower() == ".mf4" else file) as mdf:
            yield from _frames(mdf, place)
    except LogError:
        raise
    except Exception as error:  # of many kinds, where the file is damaged
        raise place.error(_reason(error), "an MF4 log that is whole") from error


def _frames(mdf: Any, place: Place) -> Iterator[TimedFrame]:
    """Its data frames; those that none can be are left out too."""
    kinds = {name: kind for kind, name in GROUPS.items()}
    found, parts = False, []
    start_ns = int(mdf.header.start_time.timestamp()) * 10**9
    start_ns += mdf.header.start_time.microsecond * 1000
    for index, group in enumerate(mdf.groups):
        events = group.channel_group.flags & BUS_EVENT
        name = next((one.name for one in group.channels if one.name in kinds), None)
        if not events or name is None:
            continue
        found = True
        if kinds[name]:
            place.left_out[kinds[name]] += group.channel_group.cycles_nr
        elif group.channel_group.cycles_nr:
            comment = group.channel_group.comment if mdf.header.project == PROJECT else ""
            names = {int(number): bus for number, bus in re.findall(r"(\d+)=(\S+)", comment)}
            parts.append(_records(mdf, index, start_ns, names))
    if not found:
        got = f"{len(mdf.groups)} groups of channels, none of them bus events of CAN"
        raise place.error(got, "an MF4 log with bus logging, or the log of its logger")
    for row in (
        heapq.merge(*parts, key=itemgetter(0)) if len(parts) > 1 else parts[0] if parts else ()
    ):
        place.number += 1
        time_ns, channel, can_id, extended, data, most = row
        if can_id >> (29 if extended else 11) or len(data) > most:
            place.left_out["impossible"] += 1
            continue
        yield _new(TimedFrame, (time_ns, channel, can_id, extended, data))


def _records(mdf: Any, index: int, start_ns: int, names: dict[int, str]) -> Iterator[Any]:
    """Times, channels and contents of a group, with the bytes that its frames may have."""
    for offset in range(0, mdf.groups[index].channel_group.cycles_nr, AT_ONCE):
        signal = mdf.get(GROUPS[""], index, record_offset=offset, record_count=AT_ONCE)
        columns = {name.rpartition(".")[2]: signal[name] for name in signal.samples.dtype.names}
        count = len(signal)
        times = (signal.timestamps * 1e9).round().astype("i8") + start_ns
        data, ids = columns["DataBytes"], columns["ID"].astype("u4")
        width, blob = data.shape[1], data.astype("u1").tobytes()
        lengths = columns["DataLength"].tolist()
        zeros = [0] * count
        channels = columns["BusChannel"].tolist() if "BusChannel" in columns else [""] * count
        texts = {one: names.get(one, str(one)) for one in {*channels}}
        wide = columns["IDE"].tolist() if "IDE" in columns else (ids >> 31).tolist()
        fd = columns["EDL"].tolist() if "EDL" in columns else zeros
        rows = zip(
            times.tolist(), channels, (ids & ID_MASK).tolist(), wide, lengths, fd, strict=True
        )
        at = 0
        for time_ns, channel, can_id, extended, length, is_fd in rows:
            most = MOST_BYTES if is_fd else CLASSICAL_BYTES
            content = blob[at : at + length]
            at += width
            yield time_ns, texts[channel], can_id, bool(extended), content, most


def database(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """The database of python-can's logger; without channels, and which frames are of CAN FD."""
    left_out = place.left_out
    try:
        with closing(sqlite3.connect(place.path)) as connection:
            rows = connection.execute("SELECT * FROM messages")
            for number, (time_s, can_id, wide, remote, error, _, data) in enumerate(rows, start=1):
                place.number = number
                if error or remote:
                    left_out["error" if error else "remote"] += 1
                    continue
                content = b"" if data is None else data
                if can_id >> (29 if wide else 11) or len(content) > MOST_BYTES:
                    left_out["impossible"] += 1
                    continue
                frame = (_nanoseconds(time_s), "", can_id, bool(wide), bytes(content))
                yield _new(TimedFrame, frame)
    except (sqlite3.Error, OverflowError, TypeError, ValueError) as error:
        raise place.error(_reason(error), "a database of python-can's logger") from error


def _nanoseconds(time_s: float) -> int:
    """Round a time to what a float can hold: ns of a short one, us of a date."""
    return round(time_s * 1e9) if time_s < FINE_S else round(time_s * 1e6) * 1000


def _reason(error: Exception) -> str:
    return f"{type(error).__name__} {error}".rstrip()
