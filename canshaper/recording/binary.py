"""Logs that are not text: MF4, read by python-can, and the database of its logger."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from typing import BinaryIO

import can

from canshaper.codec.layout import CLASSICAL_BYTES
from canshaper.recording.channels import MOST_BYTES, Place, TimedFrame

# A float of that many seconds still holds nanoseconds; a date holds microseconds.
FINE_S = 4e6
_new = tuple.__new__  # TimedFrame(...) in half the time


def mf4(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """ASAM MDF 4 of a bus logger; times to the microsecond."""
    try:
        yield from _frames(can.MF4Reader(file), place)
    except NotImplementedError:
        needs = "MF4 logs need asammdf, which is missing: pip install asammdf"
        raise place.error("an MF4 log", f"another format, or: {needs}") from None
    except Exception as error:  # of many kinds, where the file is damaged
        raise place.error(_reason(error), "an MF4 log that is whole") from error


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


def _frames(reader: can.io.generic.MessageReader, place: Place) -> Iterator[TimedFrame]:
    """Its data frames.

    A frame that none can be, which python-can takes as it stands, is left out too.
    """
    names: dict[object, str] = {}
    left_out = place.left_out
    for number, message in enumerate(reader, start=1):
        place.number = number
        if message.is_error_frame or message.is_remote_frame:
            left_out["error" if message.is_error_frame else "remote"] += 1
            continue
        can_id, extended, data = message.arbitration_id, message.is_extended_id, message.data
        most = MOST_BYTES if message.is_fd else CLASSICAL_BYTES
        if can_id >> (29 if extended else 11) or len(data) > most:
            left_out["impossible"] += 1
            continue
        channel = message.channel
        if (name := names.get(channel)) is None:
            name = names[channel] = str("" if channel is None else channel)
        yield _new(
            TimedFrame, (_nanoseconds(message.timestamp), name, can_id, extended, bytes(data))
        )


def _nanoseconds(time_s: float) -> int:
    """Round a time to what a float can hold: ns of a short one, us of a date."""
    return round(time_s * 1e9) if time_s < FINE_S else round(time_s * 1e6) * 1000


def _reason(error: Exception) -> str:
    return f"{type(error).__name__} {error}".rstrip()
