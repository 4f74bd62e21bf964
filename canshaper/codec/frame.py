"""A CAN frame without its I/O; identifiers and codes of CANopen and J1939."""

from enum import Enum, IntEnum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from canshaper.config.bus import J1939Name


class Frame(NamedTuple):
    """A data frame, classical or CAN FD, on a named bus; an ``extended`` id has 29 bits."""

    bus: str
    can_id: int
    extended: bool
    data: bytes


MessageKey = tuple[str, int, bool]
"""The first three of a ``Frame``: bus, identifier, and whether that has 29 bits."""
new_frame = tuple.__new__
"""``new_frame(Frame, (bus, can_id, extended, data))`` is ``Frame(...)`` in half the time."""


class FrameFault(IntEnum):
    """Fault of a frame, bus, node or valve; its number is LastFault of the service status."""

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
    """State of a bus, as far as our sockets show it."""

    UP = "up"
    UNCONFIRMED = "unconfirmed"
    """Up as far as we know: the interface does not confirm that our frames reach the bus."""
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
    """Return the id in a SocketCAN word, and whether it has 29 bits.

    Other bits of the word, which another program may have set, are dropped: they never reach a bus.
    """
    if word & EFF_FLAG:
        return word & EFF_MASK, True
    return word & SFF_MASK, False


GLOBAL = 0xFF  # as destination: everybody
NULL = 0xFE  # as source: a node without an address; in DBC files: any
DEFAULT_PRIORITY, LOWEST_PRIORITY = 6, 7

WITHOUT_PRIORITY = 0x03FFFFFF
_PAGES_AND_FORMAT = 0x03FF0000
_GROUP_OF_PDU2 = 0x03FFFF00


def has_destination(can_id: int) -> bool:
    """Return whether an identifier of 29 bits is PDU1: it holds a destination, one node or all."""
    return (can_id >> 16) & 0xFF < 240


def group_mask(can_id: int) -> int:
    """Return the mask of the bits of an identifier of 29 bits that give its group."""
    return _PAGES_AND_FORMAT if has_destination(can_id) else _GROUP_OF_PDU2


def group_of(can_id: int) -> int:
    """Return the bits of an identifier of 29 bits that give its group (PGN << 8)."""
    return can_id & group_mask(can_id)


def identifier(
    pgn: int, source: int, destination: int = GLOBAL, priority: int = DEFAULT_PRIORITY
) -> int:
    """Return the J1939 identifier (29 bits) of a message.

    Args:
        pgn: parameter group number.
        source: source address.
        destination: destination address; unused for groups without one.
        priority: 0 (highest) to 7 (lowest).
    """
    specific = 0 if (pgn >> 8) & 0xFF >= 240 else destination << 8
    return priority << 26 | pgn << 8 | specific | source


def pgn_of(can_id: int) -> int:
    """Return the parameter group number of an identifier of 29 bits."""
    return group_of(can_id) >> 8


def with_source(can_id: int, source: int) -> int:
    """Return an identifier of 29 bits with another source address."""
    return can_id & ~0xFF | source


def at_every_priority(can_id: int) -> list[int]:
    """Return an identifier of 29 bits at each of the 8 priorities, all of one J1939 message."""
    return [priority << 26 | can_id & WITHOUT_PRIORITY for priority in range(8)]


NMT = 0x000
EMERGENCY = 0x080  # and the node id
HEARTBEAT = 0x700  # and the node id

# CANopen's other identifiers of 11 bits, as (id, mask, name of service): no PDO may use one.
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
    """Return the CANopen service of an identifier of 11 bits; None where no service uses it."""
    return next((name for base, mask, name in SERVICES if can_id & mask == base), None)


START = 1  # NMT command: go to operational
NO_EMERGENCY = 0x0000
GENERIC_ERROR = 0x1000

STATE_MASK = 0x7F
"""State bits of a heartbeat; the bit above them is the toggle bit of node guarding."""


class NodeState(IntEnum):
    """State of a node in its heartbeat."""

    BOOT_UP = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class ValveState(IntEnum):
    """State of a CiA 408 valve: low 4 bits of the control word, as demand, and of the status
    word."""

    INIT = 0x8
    DISABLED = 0x9
    HOLD = 0xB
    ACTIVE = 0xF


STATE_BITS = 4
"""Number of state bits in control and status word."""
READY_BIT = 0x8
"""Bit of the status word that a valve with a fault clears."""
RESET_FAULT = 0x3
"""Control word that resets a fault."""


REQUEST = 0xEA00  # PGN 59904
CLAIMED = 0xEE00  # PGN 60928, address claimed or cannot claim
ACKNOWLEDGE = 0xE800  # PGN 59392
TRANSPORT = 0xEC00  # PGN 60416, connection management
TRANSPORT_DATA = 0xEB00  # PGN 60160
DM1 = 0xFECA  # PGN 65226, active diagnostic trouble codes


def claims_of(address: int) -> list[int]:
    """Return the identifiers with which a node claims its address, or says that it cannot."""
    return [identifier(CLAIMED, source) for source in (address, NULL)]


def sent_by(address: int) -> list[int]:
    """Return the identifiers of a node's acknowledgements, its DM1, and the parts of a long DM1."""
    low = LOWEST_PRIORITY
    return [
        identifier(ACKNOWLEDGE, address),
        identifier(DM1, address),
        identifier(TRANSPORT, address, priority=low),
        identifier(TRANSPORT_DATA, address, priority=low),
    ]


def name_bytes(name: "J1939Name") -> bytes:
    """Return the NAME as sent: 64 bits, lowest byte first; the lower number wins (SAE J1939-81).

    The bit "arbitrary address capable" stays 0: valves are set to listen to our one address.
    """
    fields = (
        (name.identity_number, 21),
        (name.manufacturer_code, 11),
        (name.ecu_instance, 3),
        (name.function_instance, 5),
        (name.function, 8),
        (0, 1),
        (name.vehicle_system, 7),
        (name.vehicle_system_instance, 4),
        (name.industry_group, 3),
        (0, 1),
    )
    value = at = 0
    for number, bits in fields:
        value |= number << at
        at += bits
    return value.to_bytes(8, "little")
