"""PDOs of nodes as messages of a DBC file."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence

from cantools.database.can import Database, Message, Signal
from cantools.database.can import Node as Sender
from cantools.database.conversion import BaseConversion

from canshaper.codec.signals import FULL_SET_POINT
from canshaper.commissioning.nodes.node import Mapped, Node, Pdo

CYCLE_MS = 20
"""Cycle of messages that we send, ms; no EDS says how often a node wants an RPDO."""
IO, VALVE, INCLINOMETER = 401, 408, 410  # numbers of device profiles
CONTROL_WORD, STATUS_WORD = (0x6040, 0), (0x6041, 0)
DEVICE_MODE, BY_CAN = (0x6042, 0), 1
SET_POINT, SPOOL = (0x6300, 1), (0x6301, 1)
ANALOGUE_INPUTS = 0x6401
_DIGITAL_INPUTS = range(0x6000, 0x6200)
_RESOLUTION = (0x6000, 0)  # of CiA 410, in thousandths of a degree
_SLOPES = (0x6010, 0x6020, 0x6110, 0x6120)
_OURS, _LETTERS = "SHAPER", 32
_BYTE = (8, 16, 32)


def bytes_of(node: Node) -> dict[str, bool]:
    """Return labels of bytes and words that a node sends; True for switches by its profile."""
    digital_by_name = {}
    for pdo in node.pdos:
        for one, name in zip(pdo.objects, labels(pdo.objects), strict=True):
            if pdo.transmitted and one.bits in _BYTE and not one.signed and not one.is_float:
                digital_by_name[name] = node.profile == IO and one.index in _DIGITAL_INPUTS
    return digital_by_name


def messages(
    node: Node, name: str, switches: Collection[str], cycle_ms: int | None = None
) -> list[Message]:
    """Return the messages of a node's PDOs.

    Args:
        node: the node.
        name: its name, with which those of its messages begin.
        switches: objects, as ``bytes_of`` names them, of which each bit is a signal.
        cycle_ms: what the event timers that are off are to be set to.
    """
    return [_message(node, pdo, name, switches, cycle_ms) for pdo in node.pdos]


def message_name(node: str, pdo: Pdo) -> str:
    """Return the name of the message of a PDO."""
    return f"{node}_{pdo.name}"


def dbc(all_messages: Sequence[Message]) -> str:
    """Return the text of a DBC file with these messages."""
    senders = dict.fromkeys([_OURS, *(sender for m in all_messages for sender in m.senders)])
    text = Database([*all_messages], [Sender(name, None) for name in senders]).as_dbc_string()
    return "\n".join(line.rstrip() for line in text.splitlines()) + "\n"


def _message(
    node: Node, pdo: Pdo, name: str, switches: Collection[str], cycle_ms: int | None
) -> Message:
    sender, receiver = (name, _OURS) if pdo.transmitted else (_OURS, name)
    signals = [
        signal
        for one, label in zip(pdo.objects, labels(pdo.objects), strict=True)
        for signal in _signals(node, one, label, receiver, split=label in switches)
    ]
    parameters = f"{pdo.index:04X}h and {pdo.index + 0x200:04X}h of {node.eds.path.name}"
    timer = pdo.event_timer_ms
    return Message(
        pdo.can_id,
        message_name(name, pdo),
        (pdo.bits + 7) // 8,
        signals,
        senders=[sender],
        cycle_time=(cycle_ms if timer == 0 else timer) if pdo.transmitted else CYCLE_MS,
        is_extended_frame=pdo.extended,
        comment=f"{pdo.name} of node {node.id}: {parameters}.",
    )


def _signals(node: Node, one: Mapped, name: str, receiver: str, *, split: bool) -> Iterator[Signal]:
    """Yield the signal of an object, or those of its bits."""
    if split:
        for bit in range(one.bits):
            label = f"{name[: _LETTERS - 3]}_{bit + 1}"
            yield Signal(label, one.start + bit, 1, receivers=[receiver])
        return
    scale, unit, low, high = 1.0, None, one.low, one.high
    key, start = (one.index, one.subindex), None
    if node.profile == VALVE and key in (SET_POINT, SPOOL):
        low, high = -FULL_SET_POINT, FULL_SET_POINT
    if node.profile == VALVE and key == DEVICE_MODE:
        start = BY_CAN
    if node.profile == INCLINOMETER and one.index in _SLOPES:
        scale, unit = (node.value(*_RESOLUTION) or 1) / 1000.0, "deg"
    yield Signal(
        name,
        one.start,
        one.bits,
        is_signed=one.signed,
        raw_initial=start,
        conversion=BaseConversion.factory(scale, 0, is_float=one.is_float),
        minimum=None if low is None else low * scale,
        maximum=None if high is None else high * scale,
        unit=unit,
        receivers=[receiver],
    )


def labels(objects: Sequence[Mapped]) -> list[str]:
    """Return a name of each object, unique in the PDO: its own, with its parent's, or numbered."""
    own = [_word(one.name) for one in objects]
    longer = [_word(f"{one.parent} {one.name}") for one in objects]
    once, once_longer = Counter(own), Counter(longer)
    names: list[str] = []
    for number, (short, long) in enumerate(zip(own, longer, strict=True), 1):
        label = short if once[short] == 1 else long
        unique = once[short] == 1 or (once_longer[long] == 1 and once[long] != 1)
        names.append(label if unique else f"{label[: _LETTERS - 3]}_{number}")
    return names


def _word(text: str) -> str:
    """Return a text as a name for a DBC file."""
    parts = "".join(c if c.isascii() and c.isalnum() else " " for c in text).split()
    word = "".join(part[0].upper() + part[1:] for part in parts)[:_LETTERS]
    return word if word and not word[0].isdigit() else f"S{word}"[:_LETTERS]
