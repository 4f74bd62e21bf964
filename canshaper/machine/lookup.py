"""Messages and signals that a deployment file names, or the problems with them."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from cantools.database.can import Message, Signal
from pydantic import BaseModel

from canshaper.codec.canopen import STATE_BITS, service_of
from canshaper.codec.codecs import Sender
from canshaper.codec.j1939 import NULL, WITHOUT_PRIORITY, has_destination, with_source
from canshaper.codec.layout import is_j1939
from canshaper.codec.protection import Protection
from canshaper.codec.signals import find_signal, symmetrical_range
from canshaper.config.gateway import Gateway
from canshaper.config.protection import Protected
from canshaper.config.schema import DeploymentConfig
from canshaper.config.source import Place, Problem, Source
from canshaper.machine.database import MOST_BYTES, DbcFile, Messages, load_dbc, too_many
from canshaper.machine.dbc_parse import MOST_PARSED


@dataclass
class Lookup:
    """Finds messages and signals; collects problems, so that all are told at once."""

    config: DeploymentConfig
    source: Source
    problems: list[Problem] = field(default_factory=list)
    messages: Messages = field(default_factory=lambda: Messages([]))
    on_bus: dict[str, list[Message]] = field(default_factory=dict)
    kinds: set[str] = field(default_factory=set)
    """Of its checksums."""
    _used: dict[tuple[str, int, bool], str] = field(default_factory=dict)

    def add(self, place: Place, text: str) -> None:
        """Note a problem at a place of the deployment file."""
        self.problems.append(self.source.problem(place, text))

    def load(self, directory: Path, inside: Path | None = None) -> Messages | None:
        """Load the DBC files; None when one is none, so that its messages are not missed too.

        Args:
            directory: what their names are relative to.
            inside: read none outside of this directory, whatever the deployment file says.
        """
        files = []
        for i, name in enumerate(self.config.dbc if inside else ()):
            if inside and not _is_inside(directory / name, inside):
                self.add(("dbc", i), f"found {name!r}, allowed is a file of the bundle")
                return None
        if (size := sum(_size(directory / name) for name in self.config.dbc)) > MOST_BYTES:
            self.add(("dbc",), f"found {size} bytes in all, allowed are {MOST_BYTES} at most")
            return None
        wrong = 0
        names = set(_messages(self.config))
        for i, name in enumerate(self.config.dbc):
            try:
                file, problems = load_dbc(directory / name, names)
            except OSError as error:
                self.add(("dbc", i), f"found {name!r}: {error.strerror or error}")
                continue
            self.problems += problems
            if file:
                files.append(file)
            else:
                wrong += _size(directory / name)
            if wrong > MOST_PARSED:
                break  # as much as all of them together may take; the others are not looked at
            if fault := too_many(files):
                self.add(("dbc",), fault)
                return None
        if len(files) < len(self.config.dbc):
            return None
        self.messages = Messages(files)
        return self.messages

    def address(
        self, bus: str, message: Message, *, takes: bool, source: int | None = None
    ) -> tuple[int, bool]:
        """Identifier of a message on a bus, and whether any source address may stand in it.

        A message of J1939 that we send gets our address; one that is taken the address that is
        asked for, else that of the DBC, where 254 means any.
        """
        can_id = message.frame_id
        if not is_j1939(message):
            return can_id, False
        if takes:
            source = can_id & 0xFF if source is None else source
        else:
            config = self.config.buses.get(bus)
            source = config.j1939.address if config and config.j1939 else NULL
        return with_source(can_id, source), takes and source == NULL

    def sender(self, bus: str, message: Message, protection: Protection) -> Sender:
        """A message that we send, under our address where it has one."""
        config = self.config.buses.get(bus)
        address = config.j1939.address if config and config.j1939 else None
        return Sender(bus, message, address, protection)

    def message(
        self, place: Place, bus: str, name: str, *, takes: bool, source: int | None = None
    ) -> tuple[DbcFile, Message] | None:
        """The message; noted as used on that bus, where no other part may use it."""
        if bus not in self.config.buses:
            self.add((*place, "bus"), f"found {bus!r}, buses are {', '.join(self.config.buses)}")
        found = self.messages.find(name)
        if isinstance(found, str):
            self.add((*place, "message"), found)
            return None
        message = found[1]
        self._check_j1939(place, bus, message, takes=takes, source=source)
        self._check_pdo(place, bus, message)
        can_id, _ = self.address(bus, message, takes=takes, source=source)
        whole = can_id & WITHOUT_PRIORITY if is_j1939(message) else can_id
        key = (bus, whole, message.is_extended_frame)
        if key in self._used:
            self.add(
                (*place, "message"),
                f"{name} has the id {can_id:#x} on bus {bus}, which is used already"
                f" by {self._used[key]}",
            )
        self._used[key] = ".".join(str(p) for p in place)
        self.on_bus.setdefault(bus, []).append(message)
        if message.length > 8:
            self.add((*place, "message"), f"{name} has {message.length} bytes, allowed are 8")
        if message.is_multiplexed():
            verb = "taken from" if takes else "sent in"
            self.add((*place, "message"), f"{name} is multiplexed; nothing can be {verb} it")
        return found

    def _check_pdo(self, place: Place, bus: str, message: Message) -> None:
        """On a bus of CANopen a message is a PDO: a command in an SDO would change a parameter."""
        config = self.config.buses.get(bus)
        service = None if message.is_extended_frame else service_of(message.frame_id)
        if config and config.canopen and service:
            text = f"{message.name} has the id {message.frame_id:#x}, which is one of {service}"
            self.add((*place, "message"), f"{text} in CANopen; allowed are those of PDOs")

    def _check_j1939(
        self, place: Place, bus: str, message: Message, *, takes: bool, source: int | None
    ) -> None:
        """Source addresses that cannot be."""
        config = self.config.buses.get(bus)
        own = config.j1939.address if config and config.j1939 else None
        if not is_j1939(message):
            if source is not None:
                text = f"{message.name} is no message of J1939 (VFrameFormat in the DBC)"
                self.add((*place, "source"), text)
        elif not takes and own is None:
            text = f"{message.name} is a message of J1939, and bus {bus} has no address for us"
            self.add((*place, "bus"), f"{text}: allowed is one with a section j1939")
        elif takes:
            can_id, any_source = self.address(bus, message, takes=takes, source=source)
            if can_id & 0xFF == own:
                text = f"{message.name} comes from address {own}, which is ours on bus {bus}"
                self.add((*place, "source" if source is not None else "message"), text)
            elif any_source and has_destination(can_id):
                text = f"missing: {message.name} is sent from one node to another"
                self.add((*place, "source"), f"{text}; allowed is the address of its sender")

    def signal(self, place: Place, message: Message, name: str | None) -> Signal | None:
        """The signal; None when there is none of that name, or none was asked for."""
        if name is None:
            return None
        signal = find_signal(message, name)
        if signal is None:
            names = ", ".join(s.name for s in message.signals)
            self.add(place, f"found {name!r}, signals of {message.name} are {names}")
        return signal

    def integer(self, place: Place, signal: Signal, *, signed: bool = True) -> None:
        """A switch or counter is told by its raw value, which must be a whole number."""
        if signal.is_float or (signal.is_signed and not signed):
            found = "is a float" if signal.is_float else "has a sign"
            allowed = "an integer" if signed else "an unsigned integer"
            self.add(place, f"{signal.name} {found}, allowed is {allowed} signal")

    def state_bits(self, place: Place, signal: Signal) -> None:
        """Control and status word of CiA 408 tell the state in their low bits."""
        if signal.length < STATE_BITS:
            text = f"{signal.name} has {signal.length} bits, allowed is {STATE_BITS} or more"
            self.add(place, text)

    def alone(self, place: Place, signal: Signal, use: dict[str, str]) -> None:
        """A switch that is a stick too, or a counter that is a command, would move the axis."""
        if signal.name in use:
            self.add(place, f"found {signal.name!r}, which is {use[signal.name]} already")

    def full_scale(self, file: DbcFile, message: Message, signal: Signal) -> bool:
        """Whether the DBC range of a velocity can serve as full scale."""
        why = symmetrical_range(signal)
        if why:
            self.problems.append(file.problem(message, why))
        return not why

    def timeout(self, place: Place, timeout_ms: int, message: Message) -> None:
        """A message counts as lost only after it, or a tick that looks at it, has missed once."""
        cycle, tick = message.cycle_time or 0, self.config.tick_ms
        least = 2 * max(cycle, tick)
        if timeout_ms < least:
            twice = f"the cycle of {message.name}" if cycle >= tick else "tick_ms"
            self.add(
                (*place, "timeout_ms"),
                f"found {timeout_ms}, allowed is {least} ms or more: twice {twice}",
            )

    def period(self, file: DbcFile, message: Message) -> int:
        """Ticks between two sendings of a message, from its GenMsgCycleTime; 0 when impossible."""
        cycle, tick = message.cycle_time, self.config.tick_ms
        if not cycle or cycle % tick:
            found = f"GenMsgCycleTime {cycle} ms" if cycle else "no GenMsgCycleTime"
            text = f"has {found}, allowed is a multiple of tick_ms, {tick} ms"
            self.problems.append(file.problem(message, text))
            return 0
        return cycle // tick


def _messages(section: BaseModel) -> Iterator[str]:
    """Messages that a section of the deployment file and the sections in it name."""
    if isinstance(section, Protected):
        yield section.message
    if isinstance(section, Gateway):
        yield from section.blocked
    for _, value in section:
        parts = value.values() if isinstance(value, dict) else [value]
        for part in parts:
            if isinstance(part, BaseModel):
                yield from _messages(part)


def _size(path: Path) -> int:
    """Bytes of a file; 0 for one that cannot be read, which is a problem of its own."""
    try:
        return path.stat().st_size
    except (OSError, ValueError):
        return 0


def _is_inside(path: Path, directory: Path) -> bool:
    try:
        return path.resolve().is_relative_to(directory.resolve())
    except (OSError, RuntimeError, ValueError):  # a loop of links, no name of a file
        return False
