"""The recording of a black box: a line that names its format, a header in JSON, the segments."""

import json
import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from canshaper.blackbox.ring import BLOCK, MOST_BLOCKS, SIZE, Segment
from canshaper.errors import BoxError

SUFFIX = ".blackbox"
MAGIC = b"canshaper black box 1\n"
# begin in ns, whether it follows the previous segment without a gap, bytes of the state, bytes of
# the records, CRC-32 of both
HEAD = struct.Struct("<q?III")
MOST_HEADER = 100_000
MOST_STATE = 10_000_000
MOST_RECORDS = MOST_BLOCKS * BLOCK
MOST_SEGMENTS = 1000


class BoxSegment(NamedTuple):
    """A part of a black box without gaps.

    Attributes:
        begin_ns: its begin by ``boottime_ns`` of the daemon's PC.
        follows: whether no record is missing between the previous segment and this one.
        state: saved state of the controller at the begin.
        records: packed records from then on, see ``canshaper.blackbox.ring``.
    """

    begin_ns: int
    follows: bool
    state: bytes
    records: bytes


@dataclass
class Box:
    """Content of a recording.

    Attributes:
        path: path of the file.
        header: see ``canshaper.blackbox.write.header_of``.
        segments: at least one, the oldest first.
        cut_off: where and why the file ends too early; empty for a whole file.
    """

    path: Path
    header: dict[str, Any]
    segments: list[BoxSegment]
    cut_off: str = ""


def chunks(header: dict[str, Any], segments: Iterable[Segment]) -> Iterator[bytes]:
    """Yield the bytes of a recording, piece by piece."""
    yield MAGIC + json.dumps(header).encode() + b"\n"
    for one in segments:
        data = one.data()
        crc = zlib.crc32(data, zlib.crc32(one.state))
        yield HEAD.pack(one.begin_ns, one.follows, len(one.state), len(data), crc)
        yield one.state
        yield data


def read_box(path: Path) -> Box:
    """Read a recording, which is unpacked from its bundle; see ``Box.cut_off`` for a damaged one.

    Raises:
        BoxError: the file is no recording, its header is wrong, or it has no whole segment.
        OSError: the file cannot be read.
    """
    with path.open("rb") as file:
        if file.readline(len(MAGIC)) != MAGIC:
            raise BoxError(f"{path}: expected a black box of canshaper, got another file")
        try:
            header = json.loads(file.readline(MOST_HEADER))
            box = Box(path, _checked(header), [])
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
            text = f"expected what canshaper writes, got {type(error).__name__} {error}"
            raise BoxError(f"{path}: header: {text}") from None
        while head := file.read(HEAD.size):
            number = len(box.segments) + 1
            try:
                box.segments.append(_segment(file.read, head))
            except ValueError as error:
                box.cut_off = f"{path}: segment {number}: {error}"
                break
            if number == MOST_SEGMENTS:
                break
    if not box.segments:
        raise BoxError(box.cut_off or f"{path}: expected one segment or more, got none")
    return box


def _checked(header: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of a header that a reader needs, converted to their types.

    Raises:
        ValueError, KeyError, TypeError, OverflowError: an entry is missing or of another kind.
    """
    header = {"carried": [], **header}  # older programs wrote none
    names = {key: [str(one) for one in header[key]] for key in ("buses", "identity", "carried")}
    numbers = {key: int(header[key]) for key in ("time_ns", "clock_ns")}
    listens = bool(header["listen_only"])
    return {**names, **numbers, "listen_only": listens, "why": str(header["why"])}


def _segment(read: Any, head: bytes) -> BoxSegment:
    """Read the rest of a segment after its head.

    Raises:
        ValueError: the segment is cut off, or its lengths or its checksum are wrong.
    """
    if len(head) < HEAD.size:
        raise ValueError("the file is cut off")
    begin_ns, follows, state_size, size, crc = HEAD.unpack(head)
    if state_size > MOST_STATE or size > MOST_RECORDS or size % SIZE:
        raise ValueError(f"expected the lengths of a segment, got {state_size} and {size} bytes")
    state, data = read(state_size), read(size)
    if len(state) < state_size or len(data) < size:
        raise ValueError("the file is cut off")
    if zlib.crc32(data, zlib.crc32(state)) != crc:
        raise ValueError("expected the checksum of its content, got another")
    return BoxSegment(begin_ns, follows, state, data)
