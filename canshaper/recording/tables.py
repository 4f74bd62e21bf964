"""Logs that are tables with commas, python-can's and GVRET's, and the writer of logs."""

import re
from base64 import b64decode
from binascii import unhexlify
from collections.abc import Collection, Iterator, Mapping
from decimal import Decimal
from typing import BinaryIO, TextIO

from canshaper.codec.frame import Frame
from canshaper.codec.layout import CLASSICAL_BYTES
from canshaper.machine.routing import Key
from canshaper.recording.asc import SECOND_NS, id_text, lines, shown
from canshaper.recording.channels import LATEST_S, MOST_BYTES, Place, TimedFrame
from canshaper.recording.ticks import Result, Tick

_CSV = re.compile(
    rb"([0-9.e+-]+),(0x[0-9a-f]{1,8}),([01]),([01]),([01]),([0-9]{1,2}),([A-Za-z0-9+/]*=*)\s*"
)
CSV_HEADER = "timestamp,arbitration_id,extended,remote,error,dlc,data"
# SavvyCAN before 2018 had no column for the direction.
GVRET_HEADERS = ("Time Stamp,ID,Extended,Dir,Bus,LEN,D1", "Time Stamp,ID,Extended,Bus,LEN,D1")
_GVRET = re.compile(
    rb"(-?\d{1,19}),([0-9A-Fa-f]{1,8}),(true|false|[01]),(?:[RT]x,)?(\d+),(\d{1,2}),"
    rb"((?:[0-9A-Fa-f]{1,2},)*[0-9A-Fa-f]{0,2})\s*",
    re.IGNORECASE,
)
WRAP_NS = (1 << 32) * 1000  # of a clock of 32 bits that counts microseconds
_TRUE = frozenset((b"true", b"1"))
_new = tuple.__new__  # TimedFrame(...) in half the time


def is_log(header: str) -> bool:
    """Whether this first line of a table is that of a log of frames, or nearly one."""
    return "arbitration_id" in header or header.startswith(GVRET_HEADERS)


def csv(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """A table by its header."""
    rows = lines(file, place)
    header = next(rows, b"").strip().decode("utf-8", "replace")
    if header == CSV_HEADER:
        yield from filter(None, (_python_can(row, place) for row in rows))
    elif header.startswith(GVRET_HEADERS):
        yield from _unwrapped(filter(None, (_gvret(row, place) for row in rows)))
    else:
        expected = f"the header of python-can, {CSV_HEADER}, or of GVRET, {GVRET_HEADERS[0]}..."
        raise place.error(shown(header.encode()), expected)


def _unwrapped(frames: Iterator[TimedFrame]) -> Iterator[TimedFrame]:
    """Frames of a clock of 32 bits, signed or not: from 0 where it began below, and on over it."""
    offset_ns: int | None = None
    before_ns = 0
    for frame in frames:
        if offset_ns is None:
            offset_ns = before_ns = max(0, -frame.time_ns)
        elif before_ns - frame.time_ns - offset_ns > WRAP_NS // 2:
            offset_ns += WRAP_NS
        before_ns = frame.time_ns + offset_ns
        yield frame._replace(time_ns=before_ns) if offset_ns else frame


def _python_can(row: bytes, place: Place) -> TimedFrame | None:
    """A row of python-can's table, which has no channels."""
    match = _CSV.fullmatch(row)
    if match is None:
        raise place.error(shown(row), f"a row of {CSV_HEADER}")
    time, number, extended, remote, error, length, data = match.groups()
    if error == b"1" or remote == b"1":
        place.left_out["error" if error == b"1" else "remote"] += 1
        return None
    try:
        payload = b64decode(data)
        time_ns = _time_ns(time)
    except (ArithmeticError, ValueError):
        raise place.error(shown(row), f"a row of {CSV_HEADER}") from None
    if len(payload) > MOST_BYTES:
        place.left_out["impossible"] += 1
        return None
    if len(payload) != int(length):
        raise place.error(f"{len(payload)} of {length.decode()} bytes", "all of them")
    can_id, wide = int(number, 16), extended == b"1"
    if can_id >> (29 if wide else 11):
        raise place.error(id_text(can_id), "an id of 11 bits, or of 29 with extended 1")
    frame: TimedFrame = _new(TimedFrame, (time_ns, "", can_id, wide, payload))
    return frame


def _time_ns(time: bytes) -> int:
    """A time in seconds, without a float.

    Raises:
        ValueError, ArithmeticError: it is none, or none of a clock.
    """
    whole, _, part = time.partition(b".")
    if whole.isdigit() and part.isdigit() and len(whole) <= 10 and len(part) <= 9:
        return int(whole) * SECOND_NS + int(part.ljust(9, b"0"))
    seconds = Decimal(time.decode("ascii"))
    if abs(seconds) > LATEST_S:  # before it is a number of a million digits
        raise ValueError
    return int(seconds.scaleb(9).to_integral_value())


def _gvret(row: bytes, place: Place) -> TimedFrame | None:
    """A row of SavvyCAN's table: microseconds, buses from 0."""
    if not row.strip():
        return None
    match = _GVRET.fullmatch(row)
    if match is None:
        raise place.error(shown(row), f"a row of {GVRET_HEADERS[0]}...")
    time, number, extended, bus, length, data = match.groups()
    count = int(length)
    if count > MOST_BYTES:
        place.left_out["impossible"] += 1
        return None
    if len(data) == 3 * count:  # as SavvyCAN writes them
        payload = unhexlify(data.replace(b",", b""))
    else:
        payload = bytes([int(byte, 16) for byte in data.split(b",")[:count] if byte])
    if len(payload) != count:
        raise place.error(f"{len(payload)} of {count} bytes", "all of them")
    can_id, wide = int(number, 16), extended.lower() in _TRUE
    if can_id >> (29 if wide else 11):
        raise place.error(id_text(can_id), "an id of 11 bits, or of 29 with Extended true")
    content = (int(time) * 1000, bus.decode(), can_id, wide, payload)
    frame: TimedFrame = _new(TimedFrame, content)
    return frame


class LogWriter:
    """Writes what was received and what was sent, as ``candump -L`` does.

    Args:
        file: where to.
        channel_of: channel by bus.
        fd: messages of CAN FD; what is longer than classical frames is one, too.
    """

    def __init__(
        self, file: TextIO, channel_of: Mapping[str, str], fd: Collection[Key] = ()
    ) -> None:
        self._file, self._fd = file, fd
        # A log without channels gets the names of the buses.
        self._channel_of = {bus: channel or bus for bus, channel in channel_of.items()}
        self._last_ns = 0

    def write(self, tick: Tick, result: Result) -> None:
        """Write one tick; its others are without a time of their own."""
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
