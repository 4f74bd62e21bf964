"""Logs that are not text: BLF and MF4, read by python-can."""

import struct
from collections.abc import Iterator
from typing import BinaryIO

import can

from canshaper.recording.frames import Place, TimedFrame, fits

# A float of that many seconds still holds nanoseconds; a date holds microseconds.
FINE_S = 4e6
# The start of every object of a BLF file, containers too: LOBJ, sizes and versions, length, kind.
_OBJECT = struct.Struct("<4sHHLL")


class _Reader(can.BLFReader):
    """python-can's, which never ends where an object of a damaged file has no length."""

    def _parse_data(self, data: bytes) -> Iterator[can.Message]:
        at = data.find(b"LOBJ", 0, 8)
        while 0 <= at <= len(data) - _OBJECT.size:
            length = _OBJECT.unpack_from(data, at)[3]
            if length < _OBJECT.size:
                raise ValueError(f"an object of {length} bytes")
            at = data.find(b"LOBJ", at + length, at + length + 8)
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
            raise place.error(_told(error), "a BLF log that is whole") from error
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
        raise place.error(_told(error), "an MF4 log that is whole") from error


def _frames(
    reader: can.io.generic.MessageReader, place: Place, start_ns: int, first: int
) -> Iterator[TimedFrame]:
    """Its data frames; ``first`` is the number of the first channel for people.

    Raises:
        ValueError: a frame that none can be; python-can takes it as it stands.
    """
    for message in reader:
        place.number += 1
        if message.is_error_frame or message.is_remote_frame or message.is_fd:
            kind = "error" if message.is_error_frame else "remote"
            place.left_out["CAN FD" if message.is_fd else kind] += 1
            continue
        can_id, data = message.arbitration_id, bytes(message.data)
        if not fits(can_id, extended=message.is_extended_id):
            raise ValueError(f"id {can_id:#x}")
        if len(data) > 8:
            raise ValueError(f"{len(data)} bytes in a classical frame")
        channel = message.channel
        name = str(channel + first) if isinstance(channel, int) else str(channel or "")
        yield TimedFrame(
            start_ns + _ns(message.timestamp), name, can_id, message.is_extended_id, data
        )


def _told(error: Exception) -> str:
    return f"{type(error).__name__} {error}".rstrip()


def _ns(time_s: float) -> int:
    return round(time_s * 1e9) if time_s < FINE_S else round(time_s * 1e6) * 1000
