"""One record of the black box: 24 bytes for everything that goes into the controller or out."""

import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

# kind, bus, length of the data, 29 bits?, id or number, time in ns, data
RECORD = struct.Struct("<BBB?Iq8s")
SIZE = RECORD.size
CHUNK = 8  # bytes of a text in one record


class Kind(IntEnum):
    """What a record says. The numbers stand in files."""

    TICK = 1
    """A tick begins; ``number`` deadlines were missed before it."""
    RX = 2
    """A frame was read; ``time_ns`` is its arrival."""
    TX = 3
    """The controller has computed a frame; ``FAILED`` or ``WITHHELD`` before it say it stayed."""
    FAILED = 4
    """A frame did not reach its bus."""
    WITHHELD = 5
    """A valve frame came too late to leave, if it moves one."""
    STALLED = 6
    """The loop stood still for too long."""
    NEUTRAL = 7
    """Neutral frames were computed outside of a tick."""
    OFF_BUS = 8
    """We are not on bus ``number`` now."""
    FAULT = 9
    """A bus has a fault: ``number`` is that of the fault."""
    SET = 10
    """Numbers were changed by hand: a part of their JSON; ``number`` bytes are left with it."""
    BEFORE = 11
    """8 bytes of the frame of the next record, in front of its data: CAN FD has up to 64."""


class Record(NamedTuple):
    """A record, unpacked."""

    kind: int
    bus: int
    length: int
    extended: bool
    number: int
    time_ns: int
    data: bytes

    @property
    def payload(self) -> bytes:
        """Data of its frame; of one that is too long for CAN, and so refused, the length counts."""
        return self.data[: self.length].ljust(self.length, b"\0")


def records(data: bytes | memoryview) -> Iterator[Record]:
    """Every record of a segment, in the order in which things happened, each with all its data."""
    before = b""
    for record in map(Record._make, RECORD.iter_unpack(data)):
        if record.kind == Kind.BEFORE:
            before += record.data
        elif before:
            yield record._replace(data=before + record.data)
            before = b""
        else:
            yield record
