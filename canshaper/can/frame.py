"""A CAN frame as the pure part of canshaper sees it."""

from enum import IntEnum
from typing import NamedTuple


class Frame(NamedTuple):
    """A classical CAN data frame on a named bus of the deployment."""

    bus: str
    can_id: int
    extended: bool
    data: bytes


class FrameFault(IntEnum):
    """What was wrong with a frame or with the bus; the numbers are those of the status message."""

    NONE = 0
    WRONG_LENGTH = 1
    UNKNOWN_ID = 2
    ERROR_FRAME = 3
    INVALID_SIGNAL = 4
    SEND_FAILED = 5
    MISSED_DEADLINE = 6
    BUS_ERROR = 7
