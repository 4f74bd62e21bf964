"""Identifiers as the protocols read them: 29 bits in J1939, 11 bits in CANopen.

One of J1939 is priority (3 bits), data page and extended data page (2), PDU format PF (8), PDU
specific PS (8), source address SA (8). Below PF 240 PS is the destination, from 240 on a part of
the group (SAE J1939-21). Here a *group* is an identifier without priority and source, and without
destination where there is one.

One of CANopen is function code (4 bits) and node id (7), in the predefined set (CiA 301).
"""

GLOBAL = 0xFF  # as destination: everybody
NULL = 0xFE  # as source: a node without an address; in DBC files: any
DEFAULT_PRIORITY, LOWEST_PRIORITY = 6, 7

WITHOUT_PRIORITY = 0x03FFFFFF
_PAGES_AND_FORMAT = 0x03FF0000
_GROUP_OF_PDU2 = 0x03FFFF00


def has_destination(can_id: int) -> bool:
    """Whether messages of its group are sent to one node, or to all where that says so."""
    return (can_id >> 16) & 0xFF < 240


def group_mask(can_id: int) -> int:
    """Bits of an identifier that give its group."""
    return _PAGES_AND_FORMAT if has_destination(can_id) else _GROUP_OF_PDU2


def group_of(can_id: int) -> int:
    """Group of an identifier of 29 bits."""
    return can_id & group_mask(can_id)


def identifier(
    pgn: int, source: int, destination: int = GLOBAL, priority: int = DEFAULT_PRIORITY
) -> int:
    """Identifier of a message.

    Args:
        pgn: parameter group number.
        source: source address.
        destination: only for groups that have one.
        priority: 0 to 7, the lower the sooner.
    """
    specific = 0 if (pgn >> 8) & 0xFF >= 240 else destination << 8
    return priority << 26 | pgn << 8 | specific | source


def pgn_of(can_id: int) -> int:
    """Parameter group number of an identifier."""
    return group_of(can_id) >> 8


def with_source(can_id: int, source: int) -> int:
    """The same message from another address."""
    return can_id & ~0xFF | source


def at_every_priority(can_id: int) -> list[int]:
    """The identifiers that a message may come with: its priority says nothing of what it is."""
    return [priority << 26 | can_id & WITHOUT_PRIORITY for priority in range(8)]


NMT = 0x000
EMERGENCY = 0x080  # and the node id
HEARTBEAT = 0x700  # and the node id

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
