"""Finds the messages that a deployment file names, and records which bus and section uses each."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from cantools.database.can import Message

from canshaper.codec.frame import (
    NULL,
    WITHOUT_PRIORITY,
    MessageKey,
    group_of,
    has_destination,
    service_of,
    with_source,
)
from canshaper.codec.layout import CLASSICAL_BYTES, FD_LENGTHS, is_fd, is_j1939
from canshaper.codec.message import Protection, SentMessage
from canshaper.config.inputs import Protected
from canshaper.config.schema import DeploymentConfig
from canshaper.config.section import sections
from canshaper.config.source import Diagnostics, Place
from canshaper.machine.corrections import bit_names, chosen, corrected, scalings
from canshaper.machine.database import MOST_BYTES, Messages, load_dbc, too_many
from canshaper.machine.dbc_parse import MOST_PARSED
from canshaper.machine.named_codes import Listing, check_codes, listings
from canshaper.machine.used_message import NamedCode, StartValue, UsedMessage, key_path


@dataclass(frozen=True)
class Lookup:
    """Data that all parts of a deployment share while they are bound.

    Attributes:
        diagnostics: collects every problem.
        config: the deployment file.
        messages: messages of its DBC files.
        used: messages that are bound so far, by bus, id without priority, and whether extended.
        positions: used and bound message of each measured position, by bus and message name.
    """

    diagnostics: Diagnostics
    config: DeploymentConfig
    messages: Messages
    used: dict[MessageKey, UsedMessage] = field(default_factory=dict)
    positions: dict[tuple[str, str], tuple[UsedMessage, Any]] = field(default_factory=dict)

    @cached_property
    def _listings(self) -> dict[tuple[str, str], list[Listing]]:
        return listings(self.config)

    def message(
        self, place: Place, config: Protected, *, received: bool, source: int | None = None
    ) -> UsedMessage | None:
        """Find the message of a section, and record it as used: no other section may use it.

        A J1939 message that we send gets our source address. One that we receive has the address
        that the file names, else the address of the DBC, where 254 means any.

        Args:
            place: place of the section in the deployment file.
            config: the section that names the message.
            received: whether the message is received (True) or sent.
            source: source address that the file names.

        Returns:
            The message, or None where no DBC file has it.
        """
        add, bus, name = self.diagnostics.add, config.bus, config.message
        self.diagnostics.check_name((*place, "bus"), "a bus", bus, self.config.buses)
        result = self.messages.find(name)
        if isinstance(result, str):
            add((*place, "message"), result)
            return None
        file, in_dbc = result
        listed = self._listings.get((bus, name), []) if received else []
        bits = bit_names(self.config, bus, name) if received else {}
        message = corrected(in_dbc, config, scalings(self.config, bus, name), listed, bits)
        if isinstance(message, str):
            add((*place, "multiplexor"), message)
            message = in_dbc
        can_id = message.frame_id
        if j1939 := is_j1939(message):
            own = self.own_address(bus)
            sends = can_id & 0xFF if source is None else source
            can_id = with_source(can_id, sends if received else NULL if own is None else own)
        any_source = j1939 and received and can_id & 0xFF == NULL
        used = UsedMessage(
            self.diagnostics, place, file, message, can_id, any_source, chosen(in_dbc, config)
        )
        self._check_j1939(used, bus, received=received, source=source)
        for state in (s.name for s in in_dbc.signals if j1939 and s.name in bits and s.length == 2):
            text = f"{state}: expected the signal, as its two bits are one state in J1939 (2 is an"
            used.add("message", f"{text} error, 3 not available), got {state}/0 or {state}/1")
        self._check_pdo(used, bus)
        key = (bus, can_id & WITHOUT_PRIORITY if j1939 else can_id, message.is_extended_frame)
        if key in self.used:
            text = f"{name} has the id {can_id:#x} on bus {bus}, which is used already by"
            used.add("message", f"{text} {key_path(self.used[key].place)}")
        self.used[key] = used
        self._check_length(used, in_dbc, config)
        for listing in listed:
            check_codes(used, in_dbc.signals, listing)
        if message.is_multiplexed() and config.multiplexor is None:
            verb = "taken from" if received else "sent in"
            text = f"{name} is multiplexed; without multiplexor nothing can be {verb} it"
            used.add("message", text)
        return used

    def own_address(self, bus: str) -> int | None:
        """Return our address on a bus of J1939; None where we have none."""
        config = self.config.buses.get(bus)
        return config.j1939.address if config and config.j1939 else None

    def sent(self, bus: str, message: Message, protection: Protection) -> SentMessage:
        """Return a message that we send, with our source address in J1939."""
        return SentMessage(bus, message, self.own_address(bus), protection)

    def fd(self) -> frozenset[MessageKey]:
        """Return (bus, id, extended) of the used messages of CAN FD."""
        return frozenset(key for key, used in self.used.items() if is_fd(used.message))

    def starts(self) -> tuple[StartValue, ...]:
        """Return the start values of all signals in valve messages that no axis uses."""
        return tuple(one for used in self.used.values() for one in used.starts)

    def codes(self) -> tuple[NamedCode, ...]:
        """Return the named values of all signals that are read, with their meanings."""
        return tuple(code for used in self.used.values() for code in used.codes)

    def on_bus(self) -> dict[str, list[Message]]:
        """Return the used messages, by bus."""
        messages: dict[str, list[Message]] = {}
        for (bus, _, _), used in self.used.items():
            messages.setdefault(bus, []).append(used.message)
        return messages

    def check_timeout(self, used: UsedMessage, timeout_ms: int) -> None:
        """Check that a timeout is two cycles and two ticks or more: one missed loses no message."""
        message, tick = used.message, self.config.tick_ms
        cycle = message.cycle_time or 0
        least = 2 * max(cycle, tick)
        if timeout_ms < least:
            twice = f"the cycle of {message.name}" if cycle >= tick else "tick_ms"
            text = f"expected {least} ms or more, twice {twice}, got {timeout_ms}"
            used.add("timeout_ms", text)

    def period(self, used: UsedMessage) -> int:
        """Return the ticks between two frames of a sent message; 0 with a problem if not whole."""
        cycle, tick = used.message.cycle_time, self.config.tick_ms
        if not cycle or cycle % tick:
            got = f"{cycle} ms" if cycle else "none"
            used.add_fault(f"GenMsgCycleTime: expected a multiple of tick_ms, {tick} ms, got {got}")
            return 0
        return cycle // tick

    def check_node(self, place: Place, bus: str, name: str | None) -> None:
        """Check that the bus has a CANopen node of this name, if one is named."""
        config = self.config.buses.get(bus)
        nodes = config.canopen.nodes if config and config.canopen else {}
        if name is not None:
            self.diagnostics.check_name((*place, "node"), f"a node of bus {bus}", name, nodes)

    def check_groups(self) -> None:
        """Check that no received message is in a J1939 group with which we command a valve."""
        commanded: dict[tuple[str, int], UsedMessage] = {}
        read: list[tuple[tuple[str, int], UsedMessage]] = []
        for (bus, _, _), used in self.used.items():
            if not is_j1939(used.message) or has_destination(used.can_id):
                continue
            group = (bus, group_of(used.can_id))
            if used.can_id & 0xFF != self.own_address(bus):
                read.append((group, used))
            elif used.place[-1] == "valve":
                commanded[group] = used
        for group, used in read:
            if valve := commanded.get(group):
                text = f"{used.message.name}: expected a group that commands no valve"
                used.add("message", f"{text}, got that of {key_path(valve.place)}")

    def _check_length(self, used: UsedMessage, in_dbc: Message, config: Protected) -> None:
        """Check that a message fits into one frame of its bus."""
        name, length = in_dbc.name, in_dbc.length
        bus = self.config.buses.get(config.bus)
        most = CLASSICAL_BYTES if is_j1939(in_dbc) else FD_LENGTHS[-1]
        if length > most:
            used.add("message", f"{name}: expected {most} bytes at most, got {length}")
        elif is_fd(in_dbc) and bus and not bus.fd:
            got = f"{length} bytes" if length > CLASSICAL_BYTES else "one of CAN FD"
            text = f"{name}: expected a message of classical CAN, 8 bytes at most, got {got}"
            used.add("message", f"{text}: bus {config.bus} has no fd: true")
        elif used.message.length != length and (config.checksum or config.e2e):
            text = f"{name}: expected the length of a frame with checksum or e2e"
            used.add("message", f"{text}, {used.message.length} bytes, got {length}")

    def _check_pdo(self, used: UsedMessage, bus: str) -> None:
        """Check that a message on CANopen is a PDO: an SDO would change a parameter."""
        config, message = self.config.buses.get(bus), used.message
        service = None if message.is_extended_frame else service_of(message.frame_id)
        if config and config.canopen and service:
            text = f"{message.name}: expected the id of a PDO, got {message.frame_id:#x}"
            used.add("message", f"{text}, which is one of {service} in CANopen")

    def _check_j1939(
        self, used: UsedMessage, bus: str, *, received: bool, source: int | None
    ) -> None:
        """Report a J1939 message with an impossible or missing source address."""
        name, own = used.message.name, self.own_address(bus)
        if not is_j1939(used.message):
            if source is not None:
                used.add("source", f"{name} is no message of J1939 (VFrameFormat in the DBC)")
        elif not received and own is None:
            text = f"{name}, a message of J1939: expected a bus with a section j1939"
            used.add("bus", f"{text}, got {bus} without")
        elif received:
            if used.can_id & 0xFF == own:
                text = f"{name} comes from address {own}, which is ours on bus {bus}"
                used.add("source" if source is not None else "message", text)
            elif used.any_source and has_destination(used.can_id):
                text = f"expected the address of the sender of {name}, got none"
                used.add("source", f"{text}: it is sent from one node to another")


def load_messages(
    diagnostics: Diagnostics, config: DeploymentConfig, directory: Path, inside: Path | None
) -> Messages | None:
    """Load the DBC files; return None if one cannot be used, so that its messages cause no errors.

    Args:
        diagnostics: collects every problem.
        config: the deployment file.
        directory: directory to which the names of the DBC files are relative.
        inside: directory outside of which no file is read, whatever the deployment file says.
    """
    add = diagnostics.add
    files = []
    for i, name in enumerate(config.dbc if inside else ()):
        if inside and not _is_inside(directory / name, inside):
            add(("dbc", i), f"expected a file of the bundle, got {name!r}")
            return None
    if (size := sum(_size(directory / name) for name in config.dbc)) > MOST_BYTES:
        add(("dbc",), f"expected {MOST_BYTES} bytes at most in all, got {size}")
        return None
    unusable_bytes = 0
    names = {section.message for section in protected_sections(config)}
    names |= set(config.gateway.blocked) if config.gateway else set()
    for i, name in enumerate(config.dbc):
        try:
            file, problems = load_dbc(directory / name, names)
        except OSError as error:
            add(("dbc", i), f"expected a file, got {name!r}: {error.strerror or error}")
            continue
        diagnostics.problems += problems
        if file:
            files.append(file)
        else:
            unusable_bytes += _size(directory / name)
        if unusable_bytes > MOST_PARSED:
            break  # unusable files alone exceed the limit of all files; skip the others
        if fault := too_many(files):
            add(("dbc",), fault)
            return None
    return Messages(files) if len(files) == len(config.dbc) else None


def protected_sections(config: DeploymentConfig) -> list[Protected]:
    """Return every section of a deployment file that names a message."""
    return [section for _, section in sections(config) if isinstance(section, Protected)]


def _size(path: Path) -> int:
    """Return the bytes of a file; 0 if it cannot be read, which is reported elsewhere."""
    try:
        return path.stat().st_size
    except (OSError, ValueError):
        return 0


def _is_inside(path: Path, directory: Path) -> bool:
    try:
        return path.resolve().is_relative_to(directory.resolve())
    except (OSError, RuntimeError, ValueError):  # a loop of links, no name of a file
        return False
