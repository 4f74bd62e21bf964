"""Groups of J1939 that a node sends about itself, and its NAME."""

from canshaper.codec.identifier import LOWEST_PRIORITY, NULL, identifier
from canshaper.config.bus import J1939Name

REQUEST = 0xEA00  # PGN 59904
CLAIMED = 0xEE00  # PGN 60928, address claimed or cannot claim
ACKNOWLEDGE = 0xE800  # PGN 59392
TRANSPORT = 0xEC00  # PGN 60416, connection management
TRANSPORT_DATA = 0xEB00  # PGN 60160
DM1 = 0xFECA  # PGN 65226, active diagnostic trouble codes


def claims_of(address: int) -> list[int]:
    """Identifiers of what a node says about its address: that it claims it, or cannot."""
    return [identifier(CLAIMED, source) for source in (address, NULL)]


def sent_by(address: int) -> list[int]:
    """Identifiers of what a node sends besides its claims, commands and status."""
    low = LOWEST_PRIORITY
    return [
        identifier(ACKNOWLEDGE, address),
        identifier(DM1, address),
        identifier(TRANSPORT, address, priority=low),
        identifier(TRANSPORT_DATA, address, priority=low),
    ]


def name_bytes(name: J1939Name) -> bytes:
    """The NAME as it is sent: 64 bits, lowest byte first; the lower number wins (SAE J1939-81).

    The bit for a node that may choose another address stays 0: our address is the one that
    valves are set to listen to.
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
