"""Rules of the kernel's CAN gateway (module can-gw): list, add and remove them over netlink.

A rule hands the frames of one interface that fit a pattern to another interface, perhaps changed:
bytes AND, then OR, then a checksum anew. Formats and their order: linux/can/gw.h, and
net/can/gw.c of the kernel, which compares all of a rule when one is removed. To list takes no
right, to change CAP_NET_ADMIN.
"""

import errno
import os
import socket
import struct
import subprocess
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from canshaper.can.passing import Pattern

# linux/can/gw.h, linux/rtnetlink.h, linux/netlink.h; Python has no names for most of these.
NEW, DELETE, GET = 24, 25, 26  # RTM_NEWROUTE, RTM_DELROUTE, RTM_GETROUTE
AND, OR, XOR, SET, CS_XOR, CS_CRC8 = range(1, 7)
SOURCE, DESTINATION, FILTER, LIMIT_HOPS, UID = 9, 10, 11, 13, 14
FD_MODIFICATIONS = range(15, 19)
CAN_TO_CAN, ECHO, ON_DATA = 1, 1, 4
REQUEST, ACKNOWLEDGE, DUMP, ERROR, DONE = 0x1, 0x4, 0x300, 2, 3
_HEADER = struct.Struct("=IHHII")  # nlmsghdr
_RULE = struct.Struct("=BBH")  # rtcanmsg
_ATTRIBUTE = struct.Struct("=HH")  # rtattr
_MODIFICATION = struct.Struct("=IB3x8sB")  # cgw_frame_mod
_WORDS = struct.Struct("=II")
ROOM = 1 << 16
MODIFYING = frozenset((AND, OR, XOR, SET, CS_XOR, CS_CRC8, UID, *FD_MODIFICATIONS))


class GatewayError(Exception):
    """The kernel's gateway cannot do what it is asked; the message says why."""


@dataclass(frozen=True, order=True)
class Rule:
    """A rule.

    Attributes:
        source: interface that the frames come from.
        destination: interface that they go to.
        pattern: which they are.
        changes: attributes that change them, by number, as the kernel has them.
        flags: those of the rule.
        hops: how many rules may pass one frame on.
    """

    source: str
    destination: str
    pattern: Pattern
    changes: tuple[tuple[int, bytes], ...] = ()
    # Programs on this machine see what is passed on as they see everything else.
    flags: int = ECHO
    # A frame passes once: never back, nor round through other rules.
    hops: int = 1

    def __str__(self) -> str:
        """For people."""
        word, mask = self.pattern.value, self.pattern.mask
        changed = ", changed" if self.changes else ""
        return f"{self.source} -> {self.destination} {word:x}:{mask:x}{changed}"


def changed_bytes(keep: int, put: int, length: int) -> tuple[tuple[int, bytes], ...]:
    """Changes of the bytes of a frame.

    Args:
        keep: bits that stay, byte 0 the lowest.
        put: bits that are set after that.
        length: bytes of the frame; those behind it stay.
    """
    behind = (1 << 64) - (1 << 8 * length)
    found = []
    for kind, bits in ((AND, keep | behind), (OR, put)):
        data = (bits & (1 << 64) - 1).to_bytes(8, "little")
        found.append((kind, _MODIFICATION.pack(0, 0, data, ON_DATA)))
    return tuple(found)


def load_module() -> None:
    """Load the module, where it is none of the kernel's own parts and not there yet."""
    if not Path("/sys/module/can_gw").exists():
        subprocess.run(["modprobe", "can-gw"], capture_output=True, check=False)  # add() tells why


def rules() -> list[Rule]:
    """All rules of the kernel.

    Raises:
        GatewayError: it cannot be asked.
    """
    names: dict[int, str] = {}
    try:
        bodies = list(_talk(GET, DUMP, _RULE.pack(socket.AF_CAN, CAN_TO_CAN, 0)))
        found = [_read(body, names) for body in bodies]
    except OSError as error:
        raise GatewayError(f"rules of can-gw cannot be listed: {error.strerror}") from error
    return found


def add(rule: Rule) -> None:
    """Add a rule.

    Raises:
        GatewayError: the kernel refuses.
    """
    _change(NEW, rule)


def remove(rule: Rule) -> None:
    """Remove a rule.

    Raises:
        GatewayError: the kernel refuses, or there is none.
    """
    _change(DELETE, rule)


def _change(kind: int, rule: Rule) -> None:
    try:
        ends = [socket.if_nametoindex(n) for n in (rule.source, rule.destination)]
        for _ in _talk(kind, ACKNOWLEDGE, _message(rule, *ends)):
            pass
    except OSError as error:
        why = error.strerror or str(error)
        if error.errno == errno.EPERM:
            why = "not permitted; it takes root"
        elif error.errno == errno.EOPNOTSUPP:
            why = "this kernel has no can-gw, or its module is not loaded: modprobe can-gw"
        verb = "set up" if kind == NEW else "removed"
        raise GatewayError(f"rule {rule} cannot be {verb}: {why}") from error


def _message(rule: Rule, source: int, destination: int) -> bytes:
    parts = [_RULE.pack(socket.AF_CAN, CAN_TO_CAN, rule.flags)]
    attributes = [*rule.changes]
    if rule.hops:
        attributes.append((LIMIT_HOPS, bytes((rule.hops,))))
    attributes += [
        (FILTER, _WORDS.pack(rule.pattern.value, rule.pattern.mask)),
        (SOURCE, struct.pack("=I", source)),
        (DESTINATION, struct.pack("=I", destination)),
    ]
    for kind, payload in attributes:
        part = _ATTRIBUTE.pack(_ATTRIBUTE.size + len(payload), kind) + payload
        parts.append(part + bytes(-len(part) % 4))
    return b"".join(parts)


def _read(body: bytes, names: dict[int, str]) -> Rule:
    flags = _RULE.unpack_from(body)[2]
    attributes = dict(_attributes(body[_RULE.size :]))
    ends = []
    for kind in (SOURCE, DESTINATION):
        (index,) = struct.unpack("=I", attributes[kind])
        if index not in names:
            names[index] = socket.if_indextoname(index)
        ends.append(names[index])
    value, mask = _WORDS.unpack(attributes.get(FILTER, bytes(8)))
    changes = tuple((kind, attributes[kind]) for kind in sorted(MODIFYING & attributes.keys()))
    hops = attributes.get(LIMIT_HOPS, b"\0")[0]
    return Rule(ends[0], ends[1], Pattern(value, mask), changes, flags, hops)


def _attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + _ATTRIBUTE.size <= len(data):
        length, kind = _ATTRIBUTE.unpack_from(data, at)
        if length < _ATTRIBUTE.size:
            return
        yield kind, data[at + _ATTRIBUTE.size : at + length]
        at += -(-length // 4) * 4


def _talk(kind: int, flags: int, body: bytes) -> Iterator[bytes]:
    """Ask the kernel; the bodies of its answers."""
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as asked:
        header = _HEADER.pack(_HEADER.size + len(body), kind, REQUEST | flags, 1, 0)
        asked.send(header + body)
        while True:
            data = asked.recv(ROOM)
            at = 0
            while at < len(data):
                length, answer, _flags, _number, _port = _HEADER.unpack_from(data, at)
                content = data[at + _HEADER.size : at + length]
                if answer in (ERROR, DONE):
                    code = -struct.unpack_from("=i", content)[0] if len(content) >= 4 else 0
                    if code:
                        raise OSError(code, os.strerror(code))
                    return
                if content[0] == socket.AF_CAN:
                    yield content
                at += -(-length // 4) * 4


def make(interfaces: Iterable[str], wanted: Iterable[Rule]) -> tuple[list[Rule], list[Rule]]:
    """Make the rules between these interfaces exactly these; others stay as they are.

    Returns:
        (removed, added). Removed first: for a moment less passes, and never more.

    Raises:
        GatewayError: the kernel refuses.
    """
    more, missing = difference(between(interfaces, rules()), wanted)
    for rule in more:
        remove(rule)
    for rule in missing:
        add(rule)
    return more, missing


def difference(found: Iterable[Rule], wanted: Iterable[Rule]) -> tuple[list[Rule], list[Rule]]:
    """(rules that are too many, rules that are missing)."""
    more, missing = list(found), []
    for rule in wanted:
        if rule in more:
            more.remove(rule)  # one of them: the same rule twice would pass each frame twice
        else:
            missing.append(rule)
    return more, missing


def between(names: Iterable[str], found: Iterable[Rule]) -> list[Rule]:
    """Those of the rules that lead from one of these interfaces to another of them."""
    ends = {*names}
    return [rule for rule in found if {rule.source, rule.destination} <= ends]
