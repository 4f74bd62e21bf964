"""Parameters that a node needs to work with canshaper; written by SDO where asked."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import can
import canopen
from canopen.sdo.exceptions import SdoError

from canshaper.bus.port import not_opened
from canshaper.bus.python_can import open_python_can, receive
from canshaper.codec.frame import EMERGENCY
from canshaper.commissioning.nodes.messages import ANALOGUE_INPUTS
from canshaper.commissioning.nodes.node import (
    COB_ID,
    EVENT_TIMER,
    EXTENDED_BIT,
    TRANSMISSION,
    Node,
    Pdo,
)
from canshaper.config.bus import Bus
from canshaper.errors import NodeError

HEARTBEAT_MS = 200
"""Heartbeat period of a node that is set to send heartbeats."""
HEARTBEATS = 2.5
"""A node counts as lost after the time of so many of its heartbeats."""
_EMCY, _GUARD_TIME, _HEARTBEAT, _STORE = (0x1014, 0), (0x100C, 0), (0x1017, 0), (0x1010, 1)
_ANALOGUE_ON = (0x6423, 0)
_SAVE = int.from_bytes(b"save", "little")
_BY_EVENT = (254, 255)  # transmission types: on no SYNC
_PROFILE = 255


@dataclass(frozen=True)
class MessageTiming:
    """How a deployment uses a message: sent every so many ms, lost after so many."""

    cycle_ms: int | None
    timeout_ms: int


@dataclass(frozen=True)
class Parameter:
    """An object of a node, and the value that it needs.

    Attributes:
        node: name of the node.
        why: what it is for.
    """

    node: str
    index: int
    subindex: int
    value: int
    why: str

    @property
    def where(self) -> str:
        """Place such as 1800h:5."""
        return f"{self.index:04X}h:{self.subindex}"

    def __str__(self) -> str:
        value = "0x65766173" if self.value == _SAVE else str(self.value)
        return f"{self.node}: {self.where} = {value}: {self.why}"


def heartbeat_ms(node: Node) -> int | None:
    """Return the silence after which a node is lost, ms; None where it has no heartbeat."""
    if node.variable(*_HEARTBEAT) is None:
        return None
    return round(HEARTBEATS * (node.value(*_HEARTBEAT) or HEARTBEAT_MS))


def parameters(name: str, node: Node, used: Sequence[tuple[Pdo, MessageTiming]]) -> list[Parameter]:
    """Return the parameters to change in a node, in this order; last one that stores them.

    Args:
        name, node: its name, and the node as its EDS has it.
        used: its PDOs that the deployment uses.
    """
    needed = [*_services(node), *(one for pdo, use in used for one in _of_pdo(node, pdo, use))]
    different = {
        key: (value, why)
        for key, value, why in needed
        if node.variable(*key) and node.value(*key) != value
    }
    parameters = [Parameter(name, *key, *one) for key, one in different.items()]
    if parameters and node.variable(*_STORE):
        parameters.append(Parameter(name, *_STORE, _SAVE, "it keeps this without power"))
    return parameters


def missing(node: Node, used: Sequence[tuple[Pdo, MessageTiming]]) -> Iterator[str]:
    """Yield what a node does not have, and the consequence of that."""
    if node.variable(*_HEARTBEAT) is None:
        yield "has no heartbeat (1017h); it is not supervised"
    if node.variable(*_EMCY) is None:
        yield "reports no errors of its own (no 1014h)"
    for pdo, use in used:
        if pdo.event_timer_ms is not None:
            continue
        timer = f"{pdo.name} has no event timer ({pdo.index:04X}h:{EVENT_TIMER})"
        if not pdo.transmitted:
            yield f"{timer}: it keeps its last command when we are silent"
        elif use.cycle_ms:
            yield f"{timer}: expected every {use.cycle_ms} ms by other means"


_Setting = tuple[tuple[int, int], int, str]


def _services(node: Node) -> Iterator[_Setting]:
    if not node.value(*_HEARTBEAT):
        yield _HEARTBEAT, HEARTBEAT_MS, "ms between two heartbeats"
    if node.value(*_GUARD_TIME):
        yield _GUARD_TIME, 0, "no node guarding, as no one asks for it"
    yield _EMCY, EMERGENCY + node.id, "identifier of its emergency messages"


def _of_pdo(node: Node, pdo: Pdo, use: MessageTiming) -> Iterator[_Setting]:
    if pdo.transmission not in _BY_EVENT:
        yield (pdo.index, TRANSMISSION), _PROFILE, f"{pdo.name} on no SYNC"
    if pdo.transmitted and use.cycle_ms:
        yield (pdo.index, EVENT_TIMER), use.cycle_ms, f"ms between two {pdo.name}"
    if not pdo.transmitted:
        why = f"ms without {pdo.name} after which it stops by itself"
        yield (pdo.index, EVENT_TIMER), use.timeout_ms, why
    if not pdo.on:
        flags = EXTENDED_BIT if pdo.extended else 0
        yield (pdo.index, COB_ID), pdo.can_id | flags, f"{pdo.name} is on"
    if any(one.index == ANALOGUE_INPUTS for one in pdo.objects):
        yield _ANALOGUE_ON, 1, "analogue inputs are sent"


def write(bus: Bus, nodes: Mapping[str, Node], parameters: Sequence[Parameter]) -> Iterator[str]:
    """Set parameters that differ, one after the other, and read them again; yield what was done.

    Raises:
        BusError: the bus cannot be opened.
        NodeError: a node does not answer, refuses, or has another value afterwards.
    """
    with _connected(bus) as network:
        remote = {
            name: network.add_node(canopen.RemoteNode(node.id, node.objects))
            for name, node in nodes.items()
        }
        for parameter in parameters:
            yield _set(remote[parameter.node], parameter)


def _set(node: canopen.RemoteNode, parameter: Parameter) -> str:
    what = f"{parameter.node}: {parameter.where}"
    variable = node.sdo[parameter.index]
    if not hasattr(variable, "raw"):  # an array or a record
        variable = variable[parameter.subindex]
    try:
        before = int(variable.raw)
        if before == parameter.value:
            return f"{what} is {before} already"
        variable.raw = parameter.value
        if (parameter.index, parameter.subindex) == _STORE:
            return f"{what}: stored"
        after = int(variable.raw)
    except (SdoError, can.CanError, OSError) as error:
        raise NodeError(f"{what}: expected it to take {parameter.value}, got {error}") from None
    if after != parameter.value:
        raise NodeError(f"{what}: expected {parameter.value} afterwards, got {after}")
    return f"{what} was {before}, is {after}"


@contextmanager
def _connected(bus: Bus) -> Iterator[canopen.Network]:
    network = canopen.Network()
    try:
        opened: Any = _GoesOn(open_python_can(bus))
    except (can.CanError, OSError, ValueError) as error:
        raise not_opened("crane", bus, error) from error
    network.bus = opened
    try:
        yield network.connect()
    finally:
        network.disconnect()


class _GoesOn:
    """A bus on which an error loses one answer and does not end the receiving thread."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus

    def recv(self, timeout_s: float | None = None) -> can.Message | None:
        with suppress(Exception):  # each interface raises its own kinds
            return receive(self._bus, timeout_s)
        return None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)
