"""A CAN frame as the pure part of canshaper sees it."""

from enum import Enum, IntEnum
from typing import NamedTuple


class Frame(NamedTuple):
    """A classical CAN data frame on a named bus of the deployment."""

    bus: str
    can_id: int
    extended: bool
    data: bytes


new_frame = tuple.__new__
"""``new_frame(Frame, (bus, can_id, extended, data))`` is ``Frame(...)`` in half the time."""


class FrameFault(IntEnum):
    """Fault of a frame or of the bus; the numbers are those of the status message."""

    NONE = 0
    WRONG_LENGTH = 1
    UNKNOWN_ID = 2
    ERROR_FRAME = 3
    INVALID_SIGNAL = 4
    SEND_FAILED = 5
    MISSED_DEADLINE = 6
    BUS_ERROR = 7
    CHECKSUM = 8
    COUNTER_REPEATED = 9
    COUNTER_JUMP = 10
    SECOND_SENDER = 11
    BUS_OFF = 12
    BUS_PASSIVE = 13
    FRAMES_LOST = 14
    NOT_CONFIRMED = 15
    BUS_GONE = 16
    BUS_DOWN = 17
    ADDRESS_LOST = 18
    NOT_FOLLOWING = 19
    FEEDBACK_LOST = 20
    HEARTBEAT_LOST = 21
    NODE_EMERGENCY = 22
    BUS_WRONG_DEVICE = 23
    OUTPUT_REFUSED = 24
    DECODERS_DISAGREE = 25


class BusState(Enum):
    """State of a bus, as far as it is seen from our sockets."""

    UP = "up"
    UNCONFIRMED = "unconfirmed"
    """Up, as far as known: its interface does not say whether a frame of ours got onto the bus."""
    PASSIVE = "passive"
    """The controller counts many errors."""
    BUS_OFF = "bus-off"
    """The controller has left the bus."""
    NOT_CONFIRMED = "not-confirmed"
    """Our frames do not get onto the bus: no one listens, or it is blocked."""
    DOWN = "down"
    """The interface is set down."""
    GONE = "gone"
    """The interface is removed."""
    WRONG_DEVICE = "wrong-device"
    """The interface of that name is not the device of the deployment."""
    UNFIT = "unfit"
    """The interface of that name cannot carry this bus."""
    FAILED = "failed"
    """Reading or sending failed in another way."""


EFF_FLAG = 0x80000000  # an id of 29 bits
RTR_FLAG = 0x40000000  # a remote frame
ERR_FLAG = 0x20000000  # an error that the kernel reports
SFF_MASK, EFF_MASK = 0x7FF, 0x1FFFFFFF


def id_of(word: int) -> tuple[int, bool]:
    """The id in a word of SocketCAN, and whether it has 29 bits.

    Bits beyond those of the id, which another program may have set, never reach a bus.
    """
    if word & EFF_FLAG:
        return word & EFF_MASK, True
    return word & SFF_MASK, False
