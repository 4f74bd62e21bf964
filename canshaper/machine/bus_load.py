"""Load of a bus: how much of its time the messages of a deployment take at most.

Frames at their longest: as many stuff bits as the rule of ISO 11898-1 allows, and the three bits
between two frames. Error frames and repetitions are not in it.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from cantools.database.can import Message

# A bus that is busier lets frames of low priority wait for several others.
BUSY = 0.5


def longest_frame_bits(extended: bool, length: int) -> int:
    """Bits of a data frame of ``length`` bytes with all stuff bits, and the space behind it."""
    if extended:
        return 67 + 8 * length + (53 + 8 * length) // 4
    return 47 + 8 * length + (33 + 8 * length) // 4


@dataclass(frozen=True)
class BusLoad:
    """Load of one bus.

    Attributes:
        share: part of its time, 1 is all of it.
        messages: how many cyclic messages that is.
    """

    share: float
    messages: int


def bus_load(messages: Iterable[Message], bitrate: int) -> BusLoad:
    """Load by messages with their cycles; those without one do not count.

    Args:
        messages: what is sent on the bus.
        bitrate: bit/s.
    """
    cyclic = [m for m in messages if m.cycle_time]
    bits_per_s = sum(
        longest_frame_bits(m.is_extended_frame, m.length) * 1000.0 / (m.cycle_time or 1)
        for m in cyclic
    )
    return BusLoad(bits_per_s / bitrate, len(cyclic))
