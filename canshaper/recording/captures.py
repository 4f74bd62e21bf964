"""Readers of Vector's BLF, and of captures of SocketCAN by tcpdump and Wireshark.

BLF packs objects in containers; this module reads the objects that are frames. Captures are pcap
and pcapng (draft-ietf-opsawg-pcapng).
"""

import struct
from collections.abc import Iterable, Iterator
from io import BufferedReader
from typing import Any, BinaryIO

import can

from canshaper.codec.frame import ERR_FLAG, RTR_FLAG, id_of
from canshaper.codec.layout import CLASSICAL_BYTES
from canshaper.recording.channels import MOST_BYTES, Place, TimedFrame

_new = tuple.__new__  # TimedFrame(...) in half the time
# The start of every object, containers too: LOBJ, size of the header, its version, length, kind.
_OBJECT = struct.Struct("<4sHHLL")
# In both versions unit and value of the time follow; by version, the offset of the frame.
_TIME = struct.Struct("<L4xQ")
_FRAME_AT = {1: 32, 2: 40}
_CAN_KINDS = _CAN, _CAN_2 = 1, 86
_ERROR, _FD, _FD_64 = 73, 100, 101
_CAN_FRAME = struct.Struct("<HBBL8s")  # channel, flags, length, id, data
_FD_FRAME = struct.Struct("<HBxL5xBB5x")  # channel, flags, id, flags of FD, length; data
_FD_64_FRAME = struct.Struct("<BxBxL4xL19xB4x")  # channel, length, id, flags, end of data; data
_BYTES = {
    _CAN: _CAN_FRAME.size,
    _CAN_2: _CAN_FRAME.size,
    _ERROR: 0,
    _FD: _FD_FRAME.size,
    _FD_64: _FD_64_FRAME.size,
}
_REMOTE, _IS_FD = 0x80, 0x01
_REMOTE_64, _IS_FD_64 = 0x10, 0x1000
_EXTENDED = 0x80000000
_TEN_MICROSECONDS = 1
# Largest distance from the end of an object to the next one, because of padding.
_PADDING = 8


def blf(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Yield the data frames of Vector's BLF; times to the ns or to ten us, as the logger wrote."""
    wrong = cut_off(file)  # python-can ignores this silently
    file.seek(0)
    try:
        frames: Iterable[Any] = _Reader(file, place)
        yield from frames
    except Exception as error:  # many kinds, if the file is damaged
        if not wrong:
            got = f"{type(error).__name__} {error}".rstrip()
            raise place.error(got, "a BLF log that is whole") from error
    if wrong:
        raise place.cut_off(wrong)


class _Reader(can.BLFReader):
    """python-can's reader, which opens and unpacks the file; this class reads the frames.

    python-can's own loop takes twice as long, and never ends at a damaged object of length 0.
    """

    def __init__(self, file: BinaryIO, place: Place) -> None:
        super().__init__(file)
        self._place = place
        self._start_ns = round(self.start_timestamp * 1000) * 1_000_000

    def _parse_data(self, data: bytes) -> Iterator[Any]:
        """Yield the data frames of a container; set ``_pos`` to the first object not read."""
        find, start, frame_of = data.find, _OBJECT.unpack_from, self._frame
        at, end, last = 0, len(data), len(data) - _OBJECT.size
        while True:
            self._pos = at
            begin = find(b"LOBJ", at, at + _PADDING)
            if begin < 0 and at + _PADDING <= end:
                raise ValueError("no object where the next one should be")
            if not 0 <= begin <= last:
                return
            _, _, version, length, kind = start(data, begin)
            if length < _OBJECT.size:
                raise ValueError(f"an object of {length} bytes")
            at = begin + length
            if at > end:  # the rest of it is in the next container
                return
            if kind in _BYTES and version in _FRAME_AT:
                frame = frame_of(data, kind, begin, begin + _FRAME_AT[version], at)
                if frame is not None:
                    yield frame

    def _frame(self, data: bytes, kind: int, begin: int, body: int, end: int) -> TimedFrame | None:
        """Return the data frame of an object; count another or an impossible one, and return None.

        ``begin`` and ``end`` bound the object in ``data``; its own fields begin at ``body``.
        """
        place = self._place
        place.number += 1
        if body + _BYTES[kind] > end:
            raise ValueError(f"a frame of {end - begin} bytes")
        if kind in _CAN_KINDS:
            channel, flags, count, number, content = _CAN_FRAME.unpack_from(data, body)
            remote, most, content = flags & _REMOTE, CLASSICAL_BYTES, content[:count]
        elif kind == _ERROR:
            place.left_out["error"] += 1
            return None
        else:
            channel, remote, most, number, content = _fd(data, kind, begin, body, end)
        can_id, extended = number & 0x1FFFFFFF, number >= _EXTENDED
        if remote:
            place.left_out["remote"] += 1
            return None
        if (can_id > 0x7FF and not extended) or len(content) > most:
            place.left_out["impossible"] += 1
            return None
        unit, ticks = _TIME.unpack_from(data, begin + _OBJECT.size)
        ns = self._start_ns + (ticks * 10_000 if unit == _TEN_MICROSECONDS else ticks)
        frame: TimedFrame = _new(TimedFrame, (ns, str(channel), can_id, extended, content))
        return frame


def _fd(
    data: bytes, kind: int, begin: int, body: int, end: int
) -> tuple[int, int, int, int, bytes]:
    """Return (channel, remote flag, largest length, id with its flag, data) of a CAN FD object."""
    if kind == _FD:
        channel, flags, number, fd_flags, count = _FD_FRAME.unpack_from(data, body)
        remote, is_fd = flags & _REMOTE, fd_flags & _IS_FD
        at = body + _FD_FRAME.size
    else:
        channel, count, number, flags, more_at = _FD_64_FRAME.unpack_from(data, body)
        remote, is_fd = flags & _REMOTE_64, flags & _IS_FD_64
        at = body + _FD_64_FRAME.size
        end = begin + more_at if more_at else end
    # The data may be shorter than its length: loggers leave out zeros.
    content = data[at : min(at + count, end)].ljust(count, b"\0")
    return channel, remote, MOST_BYTES if is_fd else CLASSICAL_BYTES, number, content


def cut_off(file: BinaryIO) -> str:
    """Return where a BLF file ends within an object; empty if not, or if damaged otherwise."""
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


SOCKETCAN = 227  # link type of SocketCAN
UNITS_NS = {0xA1B2C3D4: 1000, 0xA1B23C4D: 1}  # unit by the first number of a pcap
SECTION, INTERFACE, PACKET = b"\n\r\r\n", 1, 6
NAME, RESOLUTION = 2, 9  # options of an interface
MOST_BLOCK = 1 << 24


def pcap(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    """Yield the data frames of a pcap or pcapng capture, by its first bytes."""
    head = file.peek(4)[:4]
    try:
        if head == SECTION:
            yield from _blocks(file, place)
            return
        for order, name in (("<", "little"), (">", "big")):
            if unit_ns := UNITS_NS.get(int.from_bytes(head, name)):  # type: ignore[arg-type]
                yield from _records(file, place, order, unit_ns)
                return
    except (struct.error, IndexError, OverflowError):
        raise place.error("a damaged part", "a capture that is whole") from None
    raise place.error(f"the first bytes {head!r}", "a capture: pcap or pcapng")


def _read(file: BufferedReader, place: Place, count: int) -> bytes:
    data = file.read(min(count, MOST_BLOCK))
    if len(data) < count:
        raise place.cut_off("its last part is not whole")
    return data


def _records(file: BufferedReader, place: Place, order: str, unit_ns: int) -> Iterator[TimedFrame]:
    _check_link(struct.unpack(f"{order}20xL", _read(file, place, 24))[0] & 0xFFFF, place)
    while file.peek(1):
        second, part, count, _ = struct.unpack(f"{order}4L", _read(file, place, 16))
        time_ns = second * 1_000_000_000 + part * unit_ns
        yield from _frame(_read(file, place, count), time_ns, "", place)


def _blocks(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    order, interfaces = "<", list[tuple[str, int]]()
    while file.peek(1):
        head = _read(file, place, 12)
        if head[:4] == SECTION:  # in its own order of bytes
            order, interfaces = "<" if head[8] == 0x4D else ">", []
        kind, length = struct.unpack_from(f"{order}2L", head)
        body = head[8:] + _read(file, place, max(length - 12, 0))
        if kind == INTERFACE:
            _check_link(struct.unpack_from(f"{order}H", body)[0], place)
            interfaces.append(_interface(body, order, str(len(interfaces))))
        elif kind == PACKET:
            number, high, low, count = struct.unpack_from(f"{order}4L", body)
            name, per_s = interfaces[number]
            time_ns = ((high << 32) + low) * 1_000_000_000 // per_s
            yield from _frame(body[20 : 20 + count], time_ns, name, place)


def _interface(body: bytes, order: str, name: str) -> tuple[str, int]:
    """Return the name of an interface, ``name`` if it has none, and its time units per second."""
    per_s, at = 1_000_000, 8
    while at + 8 <= len(body):
        code, count = struct.unpack_from(f"{order}2H", body, at)
        value = body[at + 4 : at + 4 + count]
        if code == NAME:
            name = value.decode("utf-8", "replace").strip("\0")
        elif code == RESOLUTION:
            per_s = 2 ** (value[0] & 0x7F) if value[0] & 0x80 else 10 ** value[0]
        at += 4 + count + -count % 4
    return name, per_s


def _check_link(link: int, place: Place) -> None:
    if link != SOCKETCAN:
        expected = f"{SOCKETCAN}, SocketCAN (capture at one interface, such as can0, not any)"
        raise place.error(f"the link type {link}", expected)


def _frame(data: bytes, time_ns: int, channel: str, place: Place) -> Iterator[TimedFrame]:
    """Yield the data frame of a packet, or count it as left out."""
    place.number += 1
    word = int.from_bytes(data[:4])
    if len(data) < 8 or not data[4] <= min(len(data) - 8, MOST_BYTES):
        place.left_out["impossible"] += 1
    elif word & (ERR_FLAG | RTR_FLAG):
        place.left_out["error" if word & ERR_FLAG else "remote"] += 1
    else:
        yield TimedFrame(time_ns, channel, *id_of(word), data[8 : 8 + data[4]])
