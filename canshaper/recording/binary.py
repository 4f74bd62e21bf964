"""Logs that are not text: BLF, MF4 and python-can's database, read by python-can."""

import sqlite3
import struct
from collections.abc import Iterator
from typing import BinaryIO

import can

from canshaper.codec.layout import CLASSICAL_BYTES
from canshaper.recording.frames import MOST_BYTES, Place, TimedFrame

# A float of that many seconds still holds nanoseconds; a date holds microseconds.
FINE_S = 4e6
_new = tuple.__new__  # TimedFrame(...) in half the time
# The start of every object of a BLF file, containers too: LOBJ, sizes and versions, length, kind.
_OBJECT = struct.Struct("<4sHHLL")
_LENGTH = struct.Struct("<L")


class _Reader(can.BLFReader):
    """python-can's, which never ends where an object of a damaged file has no length."""

    def _parse_data(self, data: bytes) -> Iterator[can.Message]:
        find, length_at, least = data.find, _LENGTH.unpack_from, _OBJECT.size
        at, last = find(b"LOBJ", 0, 8), len(data) - least
        while 0 <= at <= last:
            (length,) = length_at(data, at + 8)
            if length < least:
                raise ValueError(f"an object of {length} bytes")
            at += length
            at = find(b"LOBJ", at, at + 8)
        return super()._parse_data(data)


def blf(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Vector's BLF; times to the nanosecond or ten microseconds, as the logger had them."""
    wrong = _cut_off(file)  # which python-can passes over in silence
    file.seek(0)
    try:
        reader = _Reader(file)
        # It adds the start to every time, and rounds the sum to what a float holds.
        start_ns = round(reader.start_timestamp * 1000) * 1_000_000
        reader.start_timestamp = 0.0
        yield from _frames(reader, place, start_ns, 1)
    except Exception as error:  # of many kinds, where the file is damaged
        if not wrong:
            raise place.error(_reason(error), "a BLF log that is whole") from error
    if wrong:
        raise place.cut_off(wrong)


def _cut_off(file: BinaryIO) -> str:
    """Where a BLF file ends within an object; empty where it does not."""
    file.seek(0)
    head = file.read(8)
    if len(head) < 8 or head[:4] != b"LOGG":
        return ""
    at = int.from_bytes(head[4:], "little")
    while True:
        file.seek(at)
        header = file.read(_OBJECT.size)
        if not header:
            return ""
        if len(header) == _OBJECT.size:
            signature, _, _, length, _ = _OBJECT.unpack(header)
            if signature != b"LOBJ" or length < _OBJECT.size:
                return ""  # damaged in another way
            file.seek(at + length - 1)
            if file.read(1):
                at += length + length % 4
                continue
        return f"it ends within the part that begins at byte {at}"


def mf4(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """ASAM MDF 4 of a bus logger; times to the microsecond."""
    try:
        yield from _frames(can.MF4Reader(file), place, 0, 0)
    except NotImplementedError:
        needs = "MF4 logs need asammdf, which is missing: pip install asammdf"
        raise place.error("an MF4 log", f"another format, or: {needs}") from None
    except Exception as error:  # of many kinds, where the file is damaged
        raise place.error(_reason(error), "an MF4 log that is whole") from error


def database(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """The database of python-can's logger; it has no channels."""
    try:
        reader = can.SqliteReader(place.path)
        try:
            yield from _frames(reader, place, 0, 0)
        finally:
            reader.stop()
    except (sqlite3.Error, TypeError, ValueError) as error:
        raise place.error(_reason(error), "a database of python-can's logger") from error


def _frames(
    reader: can.io.generic.MessageReader, place: Place, start_ns: int, first: int
) -> Iterator[TimedFrame]:
    """Its data frames; ``first`` is the number of the first channel for people.

    A frame that none can be, which python-can takes as it stands, is left out too.
    """
    names: dict[object, str] = {}
    left_out = place.left_out
    number = 0
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
            name = str(channel + first) if isinstance(channel, int) else str(channel or "")
            names[channel] = name
        time_s = message.timestamp
        ns = round(time_s * 1e9) if time_s < FINE_S else round(time_s * 1e6) * 1000
        yield _new(TimedFrame, (start_ns + ns, name, can_id, extended, bytes(data)))


def _reason(error: Exception) -> str:
    return f"{type(error).__name__} {error}".rstrip()
