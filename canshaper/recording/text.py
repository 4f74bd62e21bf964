"""Logs that are text: candump, ASC and CSV.

With parsers of our own: python-can's read times as floats, which at today's date hold a quarter of
a microsecond, take five to ten times as long, and let cut-off ASC lines through as shorter frames.
"""

import re
from base64 import b64decode
from binascii import unhexlify
from collections.abc import Iterator
from decimal import Decimal
from functools import partial
from typing import BinaryIO

from canshaper.codec.can_id import ERR_FLAG
from canshaper.recording.frames import LATEST_S, Place, TimedFrame, fits

SECOND_NS = 1_000_000_000
# Far longer than any line of a log; a file without line ends must not fill the memory.
LONGEST_LINE = 65_536
SHOWN = 60
EDL = 0x1000  # a frame of CAN FD, in the flags of an ASC line

_new = tuple.__new__  # TimedFrame(...) in half the time


def lines(file: BinaryIO, place: Place) -> Iterator[bytes]:
    """Lines with their end; a last one without is cut off, however good it looks."""
    for line in iter(partial(file.readline, LONGEST_LINE), b""):
        place.number += 1
        if line[-1] != 10:
            if len(line) == LONGEST_LINE:
                raise place.error(f"{LONGEST_LINE} bytes without a line end", "a log that is text")
            raise place.cut_off(f"no line end after {_shown(line)}")
        yield line


# -- candump -L --------------------------------------------------------------------------------

# What nearly every line is: microseconds, and a data frame. Whether its digits are pairs is left to
# who reads them: that is three times as quick as an expression of pairs.
_QUICK = re.compile(rb"\((\d+)\.(\d{6})\) (\S+ [0-9A-Fa-f]+)#([0-9A-Fa-f]{0,16})(?: [RT])?\n")
_CANDUMP = re.compile(
    rb"\((\d+)\.(\d{1,9})\) (\S+ [0-9A-Fa-f]+)#"
    rb"(?:((?:[0-9A-Fa-f]{2}){0,8})(?:_[0-9A-Fa-f])?|(R[0-9]?(?:_[0-9A-Fa-f])?)"
    rb"|#[0-9A-Fa-f](?:[0-9A-Fa-f]{2}){0,64})(?: [RTrt])?\s*"
)
CANDUMP_ALLOWED = "a line of candump -L, such as (1436509052.249713) can0 110#0102"


def candump(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """``candump -L``, ``candump -l`` and python-can's logger: microseconds, or nanoseconds."""
    quick = _QUICK.fullmatch
    sources: dict[bytes, tuple[str, int, bool] | None] = {}
    for line in lines(file, place):
        found = quick(line)
        if found is not None:
            seconds, fraction, source, data = found.groups()
            ns, remote = int(fraction) * 1000, None
        else:
            if not line.strip():
                continue
            if (found := _CANDUMP.fullmatch(line)) is None:
                raise place.error(_shown(line), CANDUMP_ALLOWED)
            seconds, fraction, source, data, remote = found.groups()
            ns = int(fraction.ljust(9, b"0"))
        if source not in sources:
            sources[source] = _source(source, line, place)
        known = sources[source]
        if known is None:
            place.left_out["error"] += 1
        elif data is None:
            place.left_out["remote" if remote else "CAN FD"] += 1
        else:
            try:  # int() refuses thousands of digits
                time_ns, content = int(seconds) * SECOND_NS + ns, unhexlify(data)
            except ValueError:
                raise place.error(_shown(line), CANDUMP_ALLOWED) from None
            yield _new(TimedFrame, (time_ns, *known, content))


def _source(source: bytes, line: bytes, place: Place) -> tuple[str, int, bool] | None:
    """Channel and id of a line of candump; None for an error frame."""
    channel, word = source.split()
    can_id, extended = int(word, 16), len(word) == 8
    if len(word) not in (3, 8):
        raise place.error(_shown(line), CANDUMP_ALLOWED)
    if extended and can_id & ERR_FLAG:
        return None
    if not fits(can_id, extended=extended):
        raise place.error(_id(can_id), "an id of 11 bits in 3 digits, or of 29 in 8")
    return channel.decode("ascii", "replace"), can_id, extended


# -- ASC ---------------------------------------------------------------------------------------

_BASE = re.compile(r"base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.IGNORECASE)
_ASC = re.compile(
    r"\s*(\d+)\.(\d{1,9})\s+(\d+)\s+(\S+)\s+(Rx|Tx|TxRq)\s+(?:([dr])\b\s*(.*))", re.ASCII
)
_ASC_ERROR = re.compile(r"\s*\d+\.\d+\s+(?:\d+|CANFD\s+\d+\s+\S+)\s+ErrorFrame", re.IGNORECASE)
_ASC_FD = re.compile(r"\s*(\d+)\.(\d{1,9})\s+CANFD\s+(\d+)\s+(Rx|Tx|TxRq)\s+(\S+)\s+(.*)", re.ASCII)
ASC_NUMBERS = "a line of an ASC log, such as 0.015991 1 110 Rx d 2 01 02, with numbers"


def asc(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Vector's ASC. What is neither a frame nor wrong (statistics, comments, events) is no loss."""
    base = 16
    for raw in lines(file, place):
        line = raw.decode("utf-8", "replace").rstrip()
        if found := _ASC.match(line):
            seconds, fraction, channel, number, direction, kind, rest = found.groups()
            count, *data = rest.split() or [""]
        elif _ASC_ERROR.match(line):
            place.left_out["error"] += 1
            continue
        elif found := _ASC_FD.match(line):
            seconds, fraction, channel, direction, number, rest = found.groups()
            kind = "d"
            count, *data = _classical(rest.split()) or ["FD"]
        else:
            if header := _BASE.match(line):
                base = 10 if header[1].lower() == "dec" else 16
                if header[2] and header[2].lower() == "relative":
                    raise place.error("times relative to the line before", "timestamps absolute")
            continue
        if direction == "TxRq":  # asked for, not yet on the bus; its Tx follows
            continue
        if kind == "r" or count == "FD":
            place.left_out["remote" if kind == "r" else "CAN FD"] += 1
            continue
        extended = number[-1] in "xX"
        try:
            time_ns = int(seconds) * SECOND_NS + int(fraction.ljust(9, "0"))
            can_id, length, payload = _numbers(number, count, data, base)
        except ValueError:
            raise place.error(_shown(raw), ASC_NUMBERS) from None
        if len(payload) < length:
            raise place.error(f"{len(payload)} of {length} bytes", "all of them")
        if not fits(can_id, extended=extended):
            raise place.error(_id(can_id), "an id of 11 bits, or of 29 with an x behind")
        yield TimedFrame(time_ns, channel, can_id, extended, payload)


def _numbers(number: str, count: str, data: list[str], base: int) -> tuple[int, int, bytes]:
    """Id, length and data of a line.

    Raises:
        ValueError: something else stands there.
    """
    length = min(8, int(count, base))
    digits = "".join((number, count, *data[:length]))
    if not (digits.isascii() and digits.isalnum()):  # int() takes signs, _ and foreign digits too
        raise ValueError
    payload = bytes([int(byte, base) for byte in data[:length]])
    return int(number.rstrip("xX"), base), length, payload


def _classical(words: list[str]) -> list[str] | None:
    """Length and data of a line of a CAN FD channel; None where the frame is one of CAN FD.

    Where length or flags are no numbers the length is empty, for the caller to tell.

    In front are a name, where there is one, two flags and the length code; behind the data are
    its duration, its bits and the flags that tell.
    """
    if words and words[0] not in ("0", "1"):
        words = words[1:]
    if len(words) < 4 or not words[3].isdigit():
        return None
    try:
        length, data = int(words[3]), words[4:]
        behind = data[length:]
        if length > 8 or len(behind) < 3 or int(behind[2], 16) & EDL:
            return None
    except ValueError:
        return [""]
    return [words[3], *data[:length]]


# -- CSV ---------------------------------------------------------------------------------------

_CSV = re.compile(
    r"([0-9.e+-]+),(0x[0-9a-f]{1,8}),([01]),([01]),([01]),([0-9]{1,2}),([A-Za-z0-9+/]*=*)\s*"
)
CSV_HEADER = "timestamp,arbitration_id,extended,remote,error,dlc,data"


def csv(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """The table that python-can writes; it has no channels."""
    for raw in lines(file, place):
        line = raw.decode("utf-8", "replace")
        if place.number == 1:
            if line.strip() != CSV_HEADER:
                raise place.error(_shown(raw), f"the header of python-can, {CSV_HEADER}")
            continue
        found = _CSV.fullmatch(line)
        if found is None:
            raise place.error(_shown(raw), f"a row of {CSV_HEADER}")
        time, number, extended, remote, error, length, data = found.groups()
        if error == "1" or remote == "1":
            place.left_out["error" if error == "1" else "remote"] += 1
            continue
        try:
            seconds, payload = Decimal(time), b64decode(data)
            if abs(seconds) > LATEST_S:  # before it is a number of a million digits
                raise ValueError
            time_ns = int(seconds.scaleb(9).to_integral_value())
        except (ArithmeticError, ValueError):
            raise place.error(_shown(raw), f"a row of {CSV_HEADER}") from None
        if len(payload) > 8:
            place.left_out["CAN FD"] += 1
            continue
        if len(payload) != int(length):
            raise place.error(f"{len(payload)} of {length} bytes", "all of them")
        can_id = int(number, 16)
        if not fits(can_id, extended=extended == "1"):
            raise place.error(_id(can_id), "an id of 11 bits, or of 29 with extended 1")
        yield TimedFrame(time_ns, "", can_id, extended == "1", payload)


def _id(can_id: int) -> str:
    return f"id {can_id:#x}"


def _shown(line: bytes) -> str:
    """A line as a person reads it, its beginning where it is long."""
    text = line.decode("utf-8", "replace").rstrip()
    return repr(text if len(text) <= SHOWN else text[: SHOWN - 3] + "...")
