"""Readers of logs of candump (as files and as on the screen), Kvaser's converter and BUSMASTER."""

import re
from binascii import unhexlify
from collections.abc import Iterator
from datetime import datetime
from io import BufferedReader
from itertools import pairwise
from typing import Any

from canshaper.codec.frame import ERR_FLAG
from canshaper.codec.layout import FD_LENGTHS
from canshaper.recording.asc import SECOND_NS, lines, shown
from canshaper.recording.channels import Place, TimedFrame, fits
from canshaper.recording.tables import FORMAT

_new = tuple.__new__  # TimedFrame(...) in half the time

# What nearly every line is: microseconds, and a data frame. Whether its digits are pairs is left to
# who reads them: that is three times as quick as an expression of pairs.
_QUICK = re.compile(rb"\((\d+)\.(\d{6})\) (\S+ [0-9A-Fa-f]+)#([0-9A-Fa-f]{0,16})(?: [RT])?\n")
_CANDUMP = re.compile(
    rb"\((\d+)\.(\d{1,9})\) (\S+ [0-9A-Fa-f]+)#"
    rb"(?:((?:[0-9A-Fa-f]{2}){0,8})(?:_[0-9A-Fa-f])?|(R[0-9]?(?:_[0-9A-Fa-f])?)"
    rb"|#[0-9A-Fa-f]((?:[0-9A-Fa-f]{2}){0,64}))(?: [RTrt])?\s*"
)
# A line on the screen, with -t a, A or z; the length of CAN FD has two digits.
_SCREEN = re.compile(
    rb"\s*(?:\(([^)]*)\)\s+)?(\S+)\s+(?:[RT]X [B -] [E -]\s+)?([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})"
    rb"\s+\[(\d{1,2})\]\s*(remote request|(?:[0-9A-Fa-f]{2}(?:\s+|$))*)(.*)",
    re.DOTALL,
)
_STAMP = re.compile(r"(?:(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d)|(\d+))\.(\d{1,9})")
CANDUMP_ALLOWED = "a line of candump -L, such as (1436509052.249713) can0 110#0102"
TIMES = "times before the frames: candump -L, or candump -t a"


# candump's times of -t d, and of -t z.
_PADDED = re.compile(rb"(\s*\()(\d{3,6})\.(\d{6})(?=\))")
LEAST_STAMPS, MOST_STAMPS = 8, 400
# The lines below an error frame, with -e.
_OF_ERROR = re.compile(rb"\s+[a-z][a-z-]+(?:[{,].*)?\s*")
_DROPPED = re.compile(rb"DROPCOUNT: dropped (\d{1,10}) CAN frames? on .*\s*")


def candump(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    """Yield the data frames of candump, in a file or on the screen, and of python-can's logger.

    Times from frame to frame (``candump -t d``) are summed up, with a note in ``place``.
    """
    quick = _QUICK.fullmatch
    sources: dict[bytes, tuple[str, int, bool] | None] = {}
    rows = lines(file, place)
    if _are_differences(file.peek()):
        place.notes.append("its times are those from frame to frame (candump -t d), and summed up")
        rows = _summed(rows)
    for line in rows:
        match = quick(line)
        if match is not None:
            seconds, fraction, source, data = match.groups()
            ns = int(fraction) * 1000
        else:
            if not line.strip():
                continue
            if (match := _CANDUMP.fullmatch(line)) is None:
                if (frame := _screen(line, place)) is not None:
                    yield frame
                continue
            seconds, fraction, source, data, _remote, of_fd = match.groups()
            data = of_fd if data is None else data
            ns = int(fraction.ljust(9, b"0"))
        if source not in sources:
            sources[source] = _source(source, line, place)
        known = sources[source]
        if known is None:
            place.left_out["error"] += 1
        elif data is None:
            place.left_out["remote"] += 1
        else:
            try:  # int() refuses thousands of digits
                time_ns, content = int(seconds) * SECOND_NS + ns, unhexlify(data)
            except ValueError:
                raise place.error(shown(line), CANDUMP_ALLOWED) from None
            yield _new(TimedFrame, (time_ns, *known, content))


def _are_differences(head: bytes) -> bool:
    """Return whether times in the first lines seem to be differences; False if there are few."""
    matches = (_PADDED.match(line) for line in head.split(b"\n", MOST_STAMPS)[:-1])
    stamps = [int(f"{one[2].decode()}{one[3].decode()}") for one in matches if one]
    if len(stamps) < LEAST_STAMPS:
        return False
    half = len(stamps) // 2
    latest = max(stamps[:half])
    # Two logs in one file go back once; the times of two sockets go back by little.
    back = sum(after < before for before, after in pairwise(stamps))
    same = len(set(stamps[1:])) == 1
    return (same or 8 * back >= half) and 4 * sum(t <= latest for t in stamps[half:]) >= 3 * half


def _summed(rows: Iterator[bytes]) -> Iterator[bytes]:
    """Yield lines with each time since the line before replaced by the sum of all up to it."""
    time_us = 0
    for row in rows:
        if (stamp := _PADDED.match(row)) is None:
            yield row
        else:
            time_us += int(stamp[2] + stamp[3])
            yield b"%s%d.%06d%s" % (stamp[1], *divmod(time_us, 10**6), row[stamp.end() :])


def _source(source: bytes, line: bytes, place: Place) -> tuple[str, int, bool] | None:
    """Return (channel, id, extended) of a ``source`` b"CHANNEL ID"; None for an error frame.

    Raises:
        LogError: the id has neither 3 nor 8 digits, or does not fit.
    """
    channel, word = source.split()
    can_id, extended = int(word, 16), len(word) == 8
    if len(word) not in (3, 8):
        raise place.error(shown(line), CANDUMP_ALLOWED)
    if extended and can_id & ERR_FLAG:
        return None
    if not fits(can_id, extended=extended):
        raise place.error(f"id {can_id:#x}", "an id of 11 bits in 3 digits, or of 29 in 8")
    return channel.decode("ascii", "replace"), can_id, extended


def _screen(line: bytes, place: Place) -> TimedFrame | None:
    """Return the data frame of a line as candump shows it on the screen; None for another line.

    Raises:
        LogError: candump shows no such line, it has no time, or its frame is not whole.
    """
    match = _SCREEN.fullmatch(line)
    if match is None:
        if (dropped := _DROPPED.fullmatch(line)) is not None:
            place.left_out["dropped by the logger"] += int(dropped[1])
        elif _OF_ERROR.fullmatch(line):
            place.left_out["words about errors"] += 1
        else:
            raise place.error(shown(line), CANDUMP_ALLOWED)
        return None
    stamp, channel, word, length, data, _ = match.groups()
    if stamp is None:
        raise place.error(shown(line), TIMES)
    time = _STAMP.fullmatch(stamp.decode("ascii", "replace"))
    if time is None:
        raise place.error(shown(line), TIMES)
    source = _source(channel + b" " + word, line, place)
    if source is None or data.startswith(b"remote"):
        place.left_out["error" if source is None else "remote"] += 1
        return None
    # Further words that look like bytes are the text of -a.
    payload = bytes.fromhex(data.decode("ascii"))[: int(length)]
    day, seconds, fraction = time.groups()
    whole = int(datetime.fromisoformat(day).timestamp()) if day else int(seconds)
    time_ns = whole * SECOND_NS + int(fraction.ljust(9, "0"))
    return place.checked(TimedFrame(time_ns, *source, payload), int(length))


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
    """Yield the data frames of a ``.log`` file: of BUSMASTER by its first line, else of candump."""
    return (busmaster if file.peek(12)[:12] == b"***BUSMASTER" else candump)(file, place)


def kvaser(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    """Yield the data frames of Kvaser's plain text, which stand below the names of the columns."""
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
            elif direction != "TxRq":  # a Tx line follows it
                time_ns = int(whole) * SECOND_NS + int(part.ljust(9, "0"))
                fd = "F" in flags and int(count) < len(FD_LENGTHS)
                length = FD_LENGTHS[int(count)] if fd else int(count)
                words = data.split()[:-1]  # the last is the counter
                yield _frame(place, raw, bases, time_ns, channel, number, bool(wide), length, words)
        elif not _NO_FRAME.match(line):
            raise place.error(shown(raw), "a line of Kvaser's plain text")


def busmaster(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    """Yield data frames of BUSMASTER; times go on after midnight, relative ones are summed up."""
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
    """Return the frame of (time in ns, channel, text of id, extended, length, texts of bytes).

    ``raw`` is the line, for a LogError; ``bases`` has the number bases of "id" and "data".
    """
    time_ns, channel, number, extended, length, words = what
    try:
        can_id = int(number, bases["id"])
        payload = bytes([int(word, bases["data"]) for word in words[:length]])
    except ValueError:
        raise place.error(shown(raw), "an id and bytes that are numbers") from None
    return place.checked(TimedFrame(time_ns, channel, can_id, extended, payload), length)
