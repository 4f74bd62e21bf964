"""Identifiers and codes of CANopen (CiA 301), and of its valves (CiA 408)."""

from enum import IntEnum

NMT = 0x000
EMERGENCY = 0x080  # and the node id
HEARTBEAT = 0x700  # and the node id
START = 1  # NMT command: go to operational
NO_EMERGENCY = 0x0000


class NodeState(IntEnum):
    """State of a node in its heartbeat."""

    BOOT_UP = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class ValveState(IntEnum):
    """Low four bits of the control word that asks for a state, and of the status word in it."""

    INIT = 0x8
    DISABLED = 0x9
    HOLD = 0xB
    ACTIVE = 0xF


READY_BIT = 0x8
"""Of the status word; a valve that has a fault clears it."""
RESET_FAULT = 0x3
"""Control word that resets a fault."""
