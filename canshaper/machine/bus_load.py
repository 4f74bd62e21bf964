"""Load of a bus: how much of its time the messages of a deployment take at most.

Frames at their longest: as many stuff bits as the rule of ISO 11898-1 allows, and the three bits
between two frames. Error frames and repetitions are not in it.

CAN FD: up to the bit that switches the rate a frame is sent at the one of the bus, and again from
the delimiter of the CRC on; in between are ESI, DLC, data, and the CRC with its count of stuff bits
and the fixed ones among them.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from cantools.database.can import Message

from canshaper.codec.layout import is_fd

# A bus that is busier lets frames of low priority wait for several others.
BUSY = 0.5


def longest_frame_bits(extended: bool, length: int) -> int:
    """Bits of a data frame of ``length`` bytes with all stuff bits, and the space behind it."""
    if extended:
        return 67 + 8 * length + (53 + 8 * length) // 4
    return 47 + 8 * length + (33 + 8 * length) // 4


def longest_fd_bits(extended: bool, length: int) -> tuple[int, int]:
    """The same of a frame of CAN FD: bits at the rate of the bus, and at that of the data."""
    head = 36 if extended else 17
    stuffed_head = (head - 1) // 4
    content = 5 + 8 * length
    crc = 4 + 17 + 6 if length <= 16 else 4 + 21 + 7
    return head + stuffed_head + 13, content + (head + content - 1) // 4 - stuffed_head + crc


@dataclass(frozen=True)
class BusLoad:
    """Load of one bus.

    Attributes:
        share: part of its time, 1 is all of it.
        messages: how many cyclic messages that is.
    """

    share: float
    messages: int


def bus_load(messages: Iterable[Message], bitrate: int, data_bitrate: int | None = None) -> BusLoad:
    """Load by messages with their cycles; those without one do not count.

    Args:
        messages: what is sent on the bus.
        bitrate: bit/s.
        data_bitrate: of the data of CAN FD, where it is another.
    """
    cyclic = [m for m in messages if m.cycle_time]
    share = 0.0
    for one in cyclic:
        per_s = 1000.0 / (one.cycle_time or 1)
        if is_fd(one):
            slow, fast = longest_fd_bits(one.is_extended_frame, one.length)
            share += (slow / bitrate + fast / (data_bitrate or bitrate)) * per_s
        else:
            share += longest_frame_bits(one.is_extended_frame, one.length) / bitrate * per_s
    return BusLoad(share, len(cyclic))
