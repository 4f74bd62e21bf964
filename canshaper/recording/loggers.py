"""Text logs of Kvaser's converter and of BUSMASTER."""

import re
from collections.abc import Iterator
from io import BufferedReader
from typing import Any

from canshaper.codec.layout import FD_LENGTHS
from canshaper.recording.asc import SECOND_NS, lines, shown
from canshaper.recording.candump import candump
from canshaper.recording.channels import Place, TimedFrame
from canshaper.recording.tables import FORMAT

DAY_NS = 86_400 * SECOND_NS
# Sign, time, channel, id, direction, flags, length, data and a counter.
_KVASER = re.compile(
    r"\s*(-?)(\d{1,10})[.,](\d{1,9})\s+(\d+)\s+([0-9A-F]{1,10})(x?)\s+(Rx|TxRq|Tx)\s+"
    r"((?:[EFBPRW#]\s*)*)(\d{1,3})\s+(.*)",
    re.ASCII,
)
_NO_FRAME = re.compile(r"\s*(?:-?\d+[.,]\d+\s+Trigger |DateTime:|$)")
_BUSMASTER = re.compile(
    r"(\d{1,4}):(\d\d?):(\d\d?):(\d{1,4})\s+[RT]x\s+(\d+)\s+(?:0x)?([0-9A-F]{1,10})\s+(s|x|sr|xr)"
    r"\s+(\d{1,2})\s*(.*)",
    re.ASCII | re.IGNORECASE,
)


def log(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    """A file ``.log``: of BUSMASTER by its first line, else of candump."""
    return (busmaster if file.peek(12)[:12] == b"***BUSMASTER" else candump)(file, place)


def kvaser(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    """Kvaser's plain text."""
    bases, below = {"id": 16, "data": 16}, False
    for raw in lines(file, place):
        line = raw.decode("utf-8", "replace").rstrip()
        if not below:
            if match := FORMAT.search(line):
                bases[match[1]] = 16 if match[2] == "HEX" else 10
            below = line.startswith("=" * 40)  # under the names of the columns
        elif "ErrorFrame" in line:
            place.left_out["error"] += 1
        elif match := _KVASER.fullmatch(line):
            minus, whole, part, channel, number, wide, direction, flags, count, data = (
                match.groups()
            )
            if minus or "R" in flags:
                place.left_out["before the start" if minus else "remote"] += 1
            elif direction != "TxRq":  # its Tx follows
                time_ns = int(whole) * SECOND_NS + int(part.ljust(9, "0"))
                fd = "F" in flags and int(count) < len(FD_LENGTHS)
                length = FD_LENGTHS[int(count)] if fd else int(count)
                words = data.split()[:-1]  # the last is the counter
                yield _frame(place, raw, bases, time_ns, channel, number, bool(wide), length, words)
        elif not _NO_FRAME.match(line):
            raise place.error(shown(raw), "a line of Kvaser's plain text")


def busmaster(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    """BUSMASTER's log, with times of the day, from the start or from frame to frame."""
    base, relative, day_ns, before_ns = 16, False, 0, 0
    for raw in lines(file, place):
        line = raw.decode("utf-8", "replace").strip()
        if not line or line.startswith("***"):
            relative = relative or line == "***RELATIVE MODE***"
            base = 10 if line == "***DEC***" else base
            continue
        if (match := _BUSMASTER.fullmatch(line)) is None:
            raise place.error(shown(raw), "a line of BUSMASTER's log")
        *clock, channel, number, kind, count, data = match.groups()
        hours, minutes, seconds, part = map(int, clock)
        since_ns = ((hours * 60 + minutes) * 60 + seconds) * SECOND_NS + part * 100_000
        day_ns += before_ns if relative else DAY_NS * (before_ns - since_ns > DAY_NS // 2)
        before_ns = since_ns
        if "r" in kind.lower():
            place.left_out["remote"] += 1
        else:
            what = channel, number, kind.lower() == "x", int(count), data.split()
            yield _frame(place, raw, {"id": base, "data": base}, day_ns + since_ns, *what)


def _frame(place: Place, raw: bytes, bases: dict[str, int], *what: Any) -> TimedFrame:
    """A frame of time, channel, id, whether that is extended, length and data."""
    time_ns, channel, number, extended, length, words = what
    try:
        can_id = int(number, bases["id"])
        payload = bytes([int(word, bases["data"]) for word in words[:length]])
    except ValueError:
        raise place.error(shown(raw), "an id and bytes that are numbers") from None
    return place.checked(TimedFrame(time_ns, channel, can_id, extended, payload), length)
