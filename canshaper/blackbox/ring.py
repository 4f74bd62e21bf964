"""A bounded ring in memory: segments of records, each with the controller's state at its begin.

A steady tick allocates no memory: records are packed into blocks that are used again.
"""

import struct
from collections import deque
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

# kind, bus, length of the data, 29 bits?, id or number, time in ns, data
RECORD = struct.Struct("<BBB?Iq8s")
SIZE = RECORD.size
CHUNK = 8  # bytes of a text in one record


class Kind(IntEnum):
    """Kind of a record. Files contain these numbers, so none may change."""

    TICK = 1
    """A tick begins; ``number`` deadlines were missed before it."""
    RX = 2
    """A frame was read; ``time_ns`` is its arrival."""
    TX = 3
    """The controller computed a frame. If it did not leave, ``FAILED`` or ``WITHHELD`` precedes a
    frame of a tick, and follows a joystick's forwarded frame."""
    FAILED = 4
    """A frame did not reach its bus."""
    WITHHELD = 5
    """A valve frame was late; it did not leave if it moves a valve."""
    STALLED = 6
    """The loop stood still for too long."""
    NEUTRAL = 7
    """Neutral frames were computed outside of a tick."""
    OFF_BUS = 8
    """Our CAN controller is off the bus of index ``number``."""
    FAULT = 9
    """A bus has the ``FrameFault`` of this ``number``."""
    SET = 10
    """An operator changed numbers: a part of their JSON; ``number`` bytes are left, with these."""
    BEFORE = 11
    """8 bytes that precede the data of the next record: a CAN FD frame has up to 64."""


class Record(NamedTuple):
    """A record, unpacked: a frame with id ``number`` on the bus of index ``bus``, or a ``Kind``."""

    kind: int
    bus: int
    length: int
    extended: bool
    number: int
    time_ns: int
    data: bytes

    @property
    def payload(self) -> bytes:
        """The ``length`` bytes of its data; 0 for those that the records lack."""
        return self.data[: self.length].ljust(self.length, b"\0")


def records(data: bytes | memoryview) -> Iterator[Record]:
    """Yield the records of a segment as written; those of ``BEFORE`` join the data of the next."""
    before = b""
    for record in map(Record._make, RECORD.iter_unpack(data)):
        if record.kind == Kind.BEFORE:
            before += record.data
        elif before:
            yield record._replace(data=before + record.data)
            before = b""
        else:
            yield record


BLOCK = 2048 * SIZE
# 8 MB: a minute of 5000 records a second, which is two full buses at 500 kbit/s. With more records
# the ring reaches less far back. A block is allocated when it is first needed.
MOST_BLOCKS = 170
KEPT_NS = 60_000_000_000


class Segment:
    """Records from one saved state of the controller on.

    Attributes:
        state: saved state of the controller at the begin, see ``canshaper.blackbox.state``.
        begin_ns: time of the begin, by ``boottime_ns``.
        follows: whether no record is missing between the previous segment and this one.
        blocks: packed records.
        used: bytes used in the last block.
        held: whether a file still needs its blocks, so that they must not be used again.
        cut_off: whether its last records are missing because the ring was full.
    """

    __slots__ = ("begin_ns", "blocks", "cut_off", "follows", "held", "state", "used")

    def __init__(self, state: bytes, begin_ns: int, *, follows: bool) -> None:
        self.state = state
        self.begin_ns = begin_ns
        self.follows = follows
        self.blocks: list[bytearray] = []
        self.used = 0
        self.held = self.cut_off = False

    def data(self) -> bytes:
        """Return its packed records."""
        return b"".join([*self.blocks[:-1], *(block[: self.used] for block in self.blocks[-1:])])


class Ring:
    """The last minute, in segments.

    Args:
        most_blocks: most blocks that it may allocate.
    """

    def __init__(self, most_blocks: int = MOST_BLOCKS) -> None:
        self._free: list[bytearray] = []
        self._left = most_blocks
        self._segments: deque[Segment] = deque()
        self._open: Segment | None = None
        self._block = self._nowhere = bytearray(BLOCK)  # never read
        self._at = 0

    @property
    def segments(self) -> tuple[Segment, ...]:
        """Segments, the oldest first; the last one may still grow."""
        if self._open is not None and self._open.blocks:
            self._open.used = self._at
        return tuple(self._segments)

    @property
    def cut_off(self) -> bool:
        """Whether the newest segment lacks records because the ring was full."""
        return bool(self._segments) and self._segments[-1].cut_off

    def put(  # noqa: PLR0917  (names of arguments would double the time of a call)
        self,
        kind: int,
        bus: int,
        length: int,
        extended: bool,
        number: int,
        time_ns: int,
        data: bytes,
    ) -> None:
        """Write one record, its fields as in ``Record``; without an open segment it is lost."""
        at = self._at
        if at == BLOCK:
            at = self._next_block()
        RECORD.pack_into(self._block, at, kind, bus, length, extended, number, time_ns, data)
        self._at = at + SIZE

    def begin(self, state: bytes, now_ns: int, *, follows: bool) -> None:
        """Begin a segment, and drop segments that are no longer needed for the last minute.

        After a segment that was cut off, ``follows`` counts as False.
        """
        self.pause()
        segments = self._segments
        follows = follows and bool(segments) and not self.cut_off
        while len(segments) > 1 and segments[1].begin_ns <= now_ns - KEPT_NS:
            self._drop()
        self._open = Segment(state, now_ns, follows=follows)
        segments.append(self._open)
        self._at = BLOCK

    def pause(self) -> None:
        """End the segment; records are lost until the next segment begins."""
        _ = self.segments
        self._open = None
        self._block, self._at = self._nowhere, 0

    def clear(self) -> None:
        """Drop all segments."""
        self.pause()
        while self._segments:
            self._drop()

    def _drop(self) -> None:
        segment = self._segments.popleft()
        if segment.held:
            self._left += len(segment.blocks)
        else:
            self._free += segment.blocks

    def _next_block(self) -> int:
        """Take a block for the next record, if need be the oldest segment's; return the offset."""
        segment = self._open
        if segment is None:
            return 0  # between segments: the record is lost
        if not self._free and not self._left and len(self._segments) > 1:
            self._drop()
        if self._free:
            self._block = self._free.pop()
        elif self._left:
            self._left -= 1
            self._block = bytearray(BLOCK)
        else:
            self.pause()
            segment.used, segment.cut_off = BLOCK, True
            return 0
        segment.blocks.append(self._block)
        return 0
