"""Identifiers and codes of CANopen (CiA 301), and of its valves (CiA 408)."""

from enum import IntEnum

NMT = 0x000
EMERGENCY = 0x080  # and the node id
HEARTBEAT = 0x700  # and the node id
START = 1  # NMT command: go to operational
NO_EMERGENCY = 0x0000
GENERIC_ERROR = 0x1000

# Identifiers of 11 bits of its other services, as (id, mask, name): no PDO may have one.
SERVICES = (
    (0x000, 0x7FF, "NMT"),
    (0x080, 0x7FF, "SYNC"),
    (0x080, 0x780, "EMCY"),
    (0x100, 0x7FF, "TIME"),
    (0x580, 0x780, "SDO"),
    (0x600, 0x780, "SDO"),
    (0x700, 0x780, "heartbeat"),
    (0x7E4, 0x7FE, "LSS"),
)


def service_of(can_id: int) -> str | None:
    """Service that an identifier of 11 bits belongs to; None where that is no such one."""
    return next((name for base, mask, name in SERVICES if can_id & mask == base), None)


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


FULL_SET_POINT = 0x4000
"""Of a valve; +-0x7FFF would be float, in which it drops its load."""
STATE_BITS = 4
"""Of control and status word."""
READY_BIT = 0x8
"""Of the status word; a valve that has a fault clears it."""
RESET_FAULT = 0x3
"""Control word that resets a fault."""
