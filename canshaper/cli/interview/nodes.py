"""Questions of ``canshaper init`` about CANopen nodes, which it knows from their EDS files."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cantools.database.can import Message

from canshaper.cli.common import echo
from canshaper.cli.interview.answers import NONE, ask, confirmed, several, whole
from canshaper.cli.interview.first import FirstCanopen, FirstCia408, FirstMachine
from canshaper.config.load import limits
from canshaper.config.schema import StatusWord

if TYPE_CHECKING:
    from canshaper.commissioning.nodes.eds import Eds
    from canshaper.commissioning.nodes.node import Node, Pdo
    from canshaper.commissioning.nodes.parameters import MessageTiming, Parameter

_OURS, _FIRST, _LAST = 0x7E, 0x10, 127
_NAME_LETTERS = 20  # most letters of a node's name; the names of its messages may have 32
_STATUS_CYCLES = 3  # cycles of a status word in its proposed timeout

Timing = tuple[int | None, int]
"""Cycle of a message, ms or None, and the age at which it counts as lost, ms."""


class Nodes:
    """CANopen nodes from their EDS files; asks for name, id and switches of each.

    It also asks for the event timer of PDOs that have none. Without a file the class does not need
    the canopen library, which is an extra.

    Args:
        files: EDS or DCF files, one for each node; a device that exists twice is listed twice.

    Attributes:
        named: the nodes by name.
        messages: the messages of their PDOs.

    Raises:
        ConfigError: a file is no EDS file, or has no PDO that can be used.
    """

    def __init__(self, files: Sequence[Path]) -> None:
        self.named: dict[str, Node] = {}
        self.messages: list[Message] = []
        self._pdos: dict[str, tuple[str, Pdo]] = {}
        if not files:
            return
        from canshaper.commissioning.nodes import eds, node

        read = [eds.Eds(path) for path in files]
        for one in read:
            node.Node(
                one, one.node or _FIRST
            )  # a file without a PDO is refused before any question
        for one in read:
            self._add(one)

    def _add(self, eds: "Eds") -> None:
        from canshaper.commissioning.nodes import messages
        from canshaper.commissioning.nodes.node import Node

        likely = _likely_name(eds.path.stem, self.named)
        name = ask(f"{eds.path.name}: name of the node", _name(self.named), likely)
        ids = [node.id for node in self.named.values()]
        free = next(number for number in range(_FIRST, _LAST + 1) if number not in ids)
        node_id = ask(f"{name}: node id", _node_id(ids), str(eds.node or free))
        node = Node(eds, node_id)
        for pdo in node.pdos:
            off = "" if pdo.on else ", off"
            timer = "" if pdo.event_timer_ms is None else f", event timer {pdo.event_timer_ms} ms"
            objects = ", ".join(messages.labels(pdo.objects))
            echo(f"  {pdo.name} {pdo.can_id:#x}{off}{timer}: {objects}")
        for text in (*map(str, node.faults), *(f"  {text}" for text in node.left_out)):
            echo(text, err=True)
        possible = messages.bytes_of(node)
        switches: list[str] = []
        if possible:
            likely = " ".join(n for n, digital in possible.items() if digital) or NONE
            text = f"  {name}: objects of which each bit is a switch, of {', '.join(possible)}"
            switches = ask(f"{text}, - for none", several([*possible, NONE]), likely)
        silent = [p.name for p in node.pdos if p.transmitted and p.event_timer_ms == 0]
        cycle_ms = None
        if silent:
            text = f"  {name}: event timer to be set for {', '.join(silent)}, ms"
            cycle_ms = ask(text, whole(5, 1000), "20")
        self.named[name] = node
        self.messages += messages.messages(node, name, switches, cycle_ms)
        self._pdos |= {messages.message_name(name, pdo): (name, pdo) for pdo in node.pdos}

    def name_of(self, message: str) -> str | None:
        """Return the name of the node of a message; None if no node has it."""
        return self._pdos[message][0] if message in self._pdos else None

    def supervised(self, message: str) -> str | None:
        """Return the name of the node of a message if that node has a heartbeat; else None."""
        if (name := self.name_of(message)) is None:
            return None
        from canshaper.commissioning.nodes.parameters import heartbeat_ms

        return name if heartbeat_ms(self.named[name]) else None

    def timer_ms(self, message: str) -> int:
        """Return the event timer of a message's PDO, ms; 0 if it has none, or no node has it."""
        return self._pdos[message][1].event_timer_ms or 0 if message in self._pdos else 0

    def cia408(self, valve: str) -> FirstCia408 | None:
        """Return control and status word if the message commands a CiA 408 valve; else None.

        Where a node of that profile lacks one of them, it prints that.
        """
        if (name := self.name_of(valve)) is None:
            return None
        from canshaper.commissioning.nodes import messages

        if self.named[name].profile != messages.VALVE:
            return None
        control = _label(self._pdos[valve][1], messages.CONTROL_WORD)
        sent = [pdo for owner, pdo in self._pdos.values() if owner == name and pdo.transmitted]
        for pdo in sent:
            status, message = _label(pdo, messages.STATUS_WORD), messages.message_name(name, pdo)
            cycle = next(m.cycle_time for m in self.messages if m.name == message)
            if control and status and cycle:
                least, most = limits(StatusWord, "timeout_ms")
                timeout = int(min(max(_STATUS_CYCLES * cycle, least), most))
                return FirstCia408(control, message, status, timeout, self.supervised(valve))
        echo(
            f"  {name}: expected 6040h in {valve} and 6041h in a TPDO, got no such; not as CiA 408"
        )
        return None

    def canopen(self, used: Collection[str]) -> FirstCanopen:
        """Ask about our own node; return it and the nodes with a heartbeat and a used message."""
        from canshaper.commissioning.nodes.parameters import heartbeat_ms

        ids = [node.id for node in self.named.values()]
        ours = ask("Node id of canshaper", _node_id(ids), str(_OURS))
        text = "canshaper starts the nodes (NMT), as no other master does"
        master = confirmed(text, default=True)
        names = [name for name in self.named if any(self.name_of(m) == name for m in used)]
        nodes = {n: (self.named[n].id, ms) for n in names if (ms := heartbeat_ms(self.named[n]))}
        return FirstCanopen(ours, master, nodes)

    def parameters(self, uses: Mapping[str, Timing]) -> "list[Parameter]":
        """Return what has to be set in nodes for the messages of ``uses`` and their timings."""
        if not self.named:
            return []
        from canshaper.commissioning.nodes.parameters import parameters

        return [
            p
            for name, node in self._used(uses)
            for p in parameters(name, node, self._of(name, uses))
        ]

    def missing(self, uses: Mapping[str, Timing]) -> Iterator[str]:
        """Yield what the nodes lack for the messages of ``uses`` and their timings."""
        if not self.named:
            return
        from canshaper.commissioning.nodes.parameters import missing

        for name, node in self._used(uses):
            yield from (f"{name} {text}" for text in missing(node, self._of(name, uses)))

    def _used(self, uses: Mapping[str, Timing]) -> "list[tuple[str, Node]]":
        return [(name, node) for name, node in self.named.items() if self._of(name, uses)]

    def _of(self, name: str, uses: Mapping[str, Timing]) -> "list[tuple[Pdo, MessageTiming]]":
        from canshaper.commissioning.nodes.parameters import MessageTiming

        return [
            (pdo, MessageTiming(*uses[message]))
            for message, (owner, pdo) in self._pdos.items()
            if owner == name and message in uses
        ]


def uses_of(machine: FirstMachine, messages: Sequence[Message]) -> dict[str, Timing]:
    """Return the timing of messages of joysticks, switches, valves, sensors and load, by name."""
    cycles = {message.name: message.cycle_time for message in messages}
    uses: dict[str, Timing] = {}

    def add(message: str | None, timeout_ms: int, cycle_ms: int | None = None) -> None:
        if message is not None:
            uses[message] = cycle_ms or cycles.get(message), timeout_ms

    for joystick in machine.joysticks:
        add(joystick.message, joystick.timeout_ms, joystick.cycle_ms)
        add(joystick.switch, *joystick.switch_ms)
    for axis in machine.axes:
        add(axis.valve, axis.timeout_ms)
        if axis.cia408:
            add(axis.cia408.message, axis.cia408.timeout_ms)
        if axis.sensor:
            add(axis.sensor.message, axis.sensor.timeout_ms)
    if machine.load:
        add(machine.load.message, machine.load.timeout_ms, machine.load.cycle_ms)
    return uses


def _label(pdo: "Pdo", key: tuple[int, int]) -> str | None:
    """Return the signal of an object (index, subindex) in a PDO; None if it is not mapped."""
    from canshaper.commissioning.nodes.messages import labels

    named = zip(pdo.objects, labels(pdo.objects), strict=True)
    return next((label for one, label in named if (one.index, one.subindex) == key), None)


def _likely_name(stem: str, used: Collection[str]) -> str:
    word = "".join(c if c.isascii() and c.isalnum() else "_" for c in stem.lower()).strip("_")
    word = (word if word and word[0].isalpha() else f"node_{word}")[: _NAME_LETTERS - 3]
    return next(n for n in (word, *(f"{word}_{i}" for i in range(2, 129))) if n not in used)


def _name(used: Collection[str]) -> Callable[[str], str]:
    """Return a parser of an unused name of a node; the names of its messages begin with it."""

    def parse(text: str) -> str:
        if not (text.isidentifier() and text.isascii() and len(text) <= _NAME_LETTERS):
            allowed = f"a word of letters, digits and _, {_NAME_LETTERS} at most"
            raise ValueError(f"expected {allowed}, got {text!r}")
        if text in used:
            raise ValueError(f"expected another one than {', '.join(used)}, got {text!r}")
        return text

    return parse


def _node_id(used: Collection[int]) -> Callable[[str], int]:
    """Return a parser of an unused node id, decimal or as 0x10."""

    def parse(text: str) -> int:
        try:
            number = int(text, 0)
        except ValueError:
            number = 0
        if not 1 <= number <= _LAST or number in used:
            others = f" other than {', '.join(map(str, used))}" if used else ""
            raise ValueError(f"expected a node id, 1 to {_LAST}{others}, got {text!r}")
        return number

    return parse
