"""Codes of CANopen (CiA 301), and of its valves (CiA 408)."""

from enum import IntEnum

START = 1  # NMT command: go to operational
NO_EMERGENCY = 0x0000
GENERIC_ERROR = 0x1000

STATE_MASK = 0x7F
"""Of a heartbeat; the bit above is that of node guarding."""


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


STATE_BITS = 4
"""Of control and status word."""
READY_BIT = 0x8
"""Of the status word; a valve that has a fault clears it."""
RESET_FAULT = 0x3
"""Control word that resets a fault."""
