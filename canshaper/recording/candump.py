"""candump's logs, as files and as they stand on the screen."""

import re
from binascii import unhexlify
from collections.abc import Iterator
from datetime import datetime
from io import BufferedReader
from itertools import pairwise

from canshaper.codec.frame import ERR_FLAG
from canshaper.recording.asc import SECOND_NS, lines, shown
from canshaper.recording.channels import Place, TimedFrame, fits

_new = tuple.__new__  # TimedFrame(...) in half the time

# What nearly every line is: microseconds, and a data frame. Whether its digits are pairs is left to
# who reads them: that is three times as quick as an expression of pairs.
_QUICK = re.compile(rb"\((\d+)\.(\d{6})\) (\S+ [0-9A-Fa-f]+)#([0-9A-Fa-f]{0,16})(?: [RT])?\n")
_CANDUMP = re.compile(
    rb"\((\d+)\.(\d{1,9})\) (\S+ [0-9A-Fa-f]+)#"
    rb"(?:((?:[0-9A-Fa-f]{2}){0,8})(?:_[0-9A-Fa-f])?|(R[0-9]?(?:_[0-9A-Fa-f])?)"
    rb"|#[0-9A-Fa-f]((?:[0-9A-Fa-f]{2}){0,64}))(?: [RTrt])?\s*"
)
# As it stands on the screen, with -t a, A or z; the length of CAN FD has two digits.
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
# Below an error frame, with -e.
_OF_ERROR = re.compile(rb"\s+[a-z][a-z-]+(?:[{,].*)?\s*")
_DROPPED = re.compile(rb"DROPCOUNT: dropped (\d{1,10}) CAN frames? on .*\s*")


def candump(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    """``candump -L``, ``candump -l`` and python-can's logger: microseconds, or nanoseconds."""
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
    """Whether the times of a log do not grow: each is that since the frame before."""
    matches = (_PADDED.match(line) for line in head.split(b"\n", MOST_STAMPS)[:-1])
    stamps = [int(f"{one[2].decode()}{one[3].decode()}") for one in matches if one]
    if len(stamps) < LEAST_STAMPS:
        return False
    half = len(stamps) // 2
    latest = max(stamps[:half])
    # Two logs in one file go back once; those of two sockets by little.
    back = sum(after < before for before, after in pairwise(stamps))
    same = len(set(stamps[1:])) == 1
    return (same or 8 * back >= half) and 4 * sum(t <= latest for t in stamps[half:]) >= 3 * half


def _summed(rows: Iterator[bytes]) -> Iterator[bytes]:
    """Lines with the times from the first one on in place of those from line to line."""
    time_us = 0
    for row in rows:
        if (stamp := _PADDED.match(row)) is None:
            yield row
        else:
            time_us += int(stamp[2] + stamp[3])
            yield b"%s%d.%06d%s" % (stamp[1], *divmod(time_us, 10**6), row[stamp.end() :])


def _source(source: bytes, line: bytes, place: Place) -> tuple[str, int, bool] | None:
    """Channel and id of a line of candump; None for an error frame."""
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
    """A frame of a line as candump shows it; None where it is no data frame.

    Raises:
        LogError: it is no such line, or has no time.
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
    # What looks like bytes behind them is the text of -a.
    payload = bytes.fromhex(data.decode("ascii"))[: int(length)]
    day, seconds, fraction = time.groups()
    whole = int(datetime.fromisoformat(day).timestamp()) if day else int(seconds)
    time_ns = whole * SECOND_NS + int(fraction.ljust(9, "0"))
    return place.checked(TimedFrame(time_ns, *source, payload), int(length))
