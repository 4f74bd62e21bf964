"""Which messages of a bus matter to a deployment, and how."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Ids:
    """Messages of one bus, as (id, extended).

    Attributes:
        taken: those that we take.
        sent: those that we send, and nobody else may.
        valves: those of them that move something.
        known: all that the DBC files know; one that they do not know is a fault.
        taken_groups: groups of J1939 that are taken, from whatever address.
        sent_groups: groups that we send, and nobody else may.
        claims: what we send of the groups that are taken: it comes back among them.
        j1939: the bus is one of J1939, where ids of 29 bits that nobody knows are daily life.
        canopen: the bus is one of CANopen, where that is so for SDO, SYNC and the like.
        in_line: the bus is one of a gateway, where that is so for all.
    """

    taken: frozenset[tuple[int, bool]]
    sent: frozenset[tuple[int, bool]]
    valves: frozenset[tuple[int, bool]]
    known: frozenset[tuple[int, bool]]
    taken_groups: frozenset[int] = frozenset()
    sent_groups: frozenset[int] = frozenset()
    claims: frozenset[tuple[int, bool]] = frozenset()
    j1939: bool = False
    canopen: bool = False
    in_line: bool = False
