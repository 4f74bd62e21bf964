"""The id of a frame as SocketCAN carries it: linux/can.h.

Python's ``socket`` has these names on Linux only; logs are read and machines simulated anywhere.
"""

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
