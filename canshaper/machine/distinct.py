"""Names and ids that have to be distinct, each with who has it already."""

from canshaper.codec.identifier import (
    ACKNOWLEDGE,
    CLAIMED,
    DM1,
    NULL,
    REQUEST,
    TRANSPORT,
    TRANSPORT_DATA,
    WITHOUT_PRIORITY,
    claims_of,
    group_of,
    identifier,
    pgn_of,
    sent_by,
)
from canshaper.codec.layout import is_j1939
from canshaper.config.schema import DeploymentConfig
from canshaper.machine.diagnostics import Diagnostics
from canshaper.machine.lookup import Lookup
from canshaper.machine.used_message import UsedMessage, key_path

# Groups with which nodes of J1939 speak of addresses, and in which they send long messages.
PROTOCOL = {
    REQUEST: "request",
    CLAIMED: "address claim",
    ACKNOWLEDGE: "acknowledgement",
    TRANSPORT: "transport",
    TRANSPORT_DATA: "transport data",
}


def check_names(diagnostics: Diagnostics, config: DeploymentConfig) -> None:
    """Check that no two parts have one name but for case and spaces, as a person reads them."""
    for key, what in (
        ("buses", "bus"),
        ("joysticks", "joystick"),
        ("switches", "switch"),
        ("axes", "axis"),
    ):
        names: dict[str, str] = {}
        for name in getattr(config, key):
            if (first := names.setdefault(name.strip().casefold(), name)) != name:
                text = f"expected a name that no one takes for {what} {first}, got {name!r}"
                diagnostics.add((key, name), f"{text}: a key that means the other one moves it")


def check_ids(lookup: Lookup) -> None:
    """Check that no message has an id of another one, or of our own node on J1939.

    Of messages of one kind with the same id ``Lookup.message`` says it.
    """
    seen: dict[tuple[str, int], UsedMessage] = {}
    for (bus, _, extended), used in lookup.used.items():
        if not extended:
            continue
        if fault := _fault_of_node(lookup, bus, used):
            used.add("message", fault)
        key = (bus, used.can_id & WITHOUT_PRIORITY)
        other = seen.setdefault(key, used)
        if is_j1939(other.message) != is_j1939(used.message):
            text = f"{used.message.name} has the id {used.can_id:#x} of"
            text += f" {other.message.name}, which {key_path(other.place)} uses: one would be taken"
            used.add("message", f"{text} for the other; expected another id, or VFrameFormat alike")
    _check_sources(lookup)


def _fault_of_node(lookup: Lookup, bus: str, used: UsedMessage) -> str | None:
    """Why a message is one that our own node sends or waits for, or None."""
    own = lookup.own_address(bus)
    if own is None:
        return None
    sent = (*claims_of(own), *sent_by(own), identifier(REQUEST, NULL))
    ours = {one & WITHOUT_PRIORITY for one in sent}
    pgn = pgn_of(used.can_id)
    name = PROTOCOL.get(pgn, "DM1" if pgn == DM1 else None)
    meant = used.can_id & WITHOUT_PRIORITY in ours
    if not meant and not (is_j1939(used.message) and pgn in PROTOCOL):
        return None
    text = f"{used.message.name} has the id {used.can_id:#x}, {name} of J1939, which our node on"
    return f"{text} bus {bus} uses itself: expected a message with another id"


def _check_sources(lookup: Lookup) -> None:
    """Check that a message from any source address is not also one from a certain address."""
    read = [
        (bus, used)
        for (bus, _, _), used in lookup.used.items()
        if is_j1939(used.message) and used.can_id & 0xFF != lookup.own_address(bus)
    ]
    any_source = {(bus, group_of(used.can_id)): used for bus, used in read if used.any_source}
    for bus, used in read:
        other = any_source.get((bus, group_of(used.can_id)))
        if other is not None and not used.any_source:
            text = f"expected the source address of {other.message.name}, got any source:"
            text += f" frames of {used.message.name}, from {used.can_id & 0xFF:#04x}, are of its"
            other.add("source", f"{text} group and would be taken for it")
