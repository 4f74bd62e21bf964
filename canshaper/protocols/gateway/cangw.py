"""Rules of the kernel's CAN gateway (module can-gw): list, add and remove them over netlink.

A rule passes the frames of one interface that fit a pattern to another interface, unchanged or
changed: bytes AND, then OR, then a new checksum. linux/can/gw.h and net/can/gw.c of the kernel
define the formats and their order; to remove a rule every part of it has to match. Listing rules
takes no privilege, changing them CAP_NET_ADMIN.
"""

import errno
import socket
import struct
import subprocess
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from canshaper.bus.netlink import ACKNOWLEDGE, DUMP, attribute, attributes, request
from canshaper.codec.rewrite import CS_CRC8, CS_XOR
from canshaper.errors import GatewayError
from canshaper.protocols.gateway.forwarding import Pattern

# linux/can/gw.h, linux/rtnetlink.h; Python has no names for most of these.
NEW, DELETE, GET = 24, 25, 26  # RTM_NEWROUTE, RTM_DELROUTE, RTM_GETROUTE
AND, OR, XOR, SET = range(1, 5)
SOURCE, DESTINATION, FILTER, LIMIT_HOPS, UID = 9, 10, 11, 13, 14
FD_MODIFICATIONS = range(15, 19)
CAN_TO_CAN, ECHO, ON_DATA = 1, 1, 4
_RULE = struct.Struct("=BBH")  # rtcanmsg
_MODIFICATION = struct.Struct("=IB3x8sB")  # cgw_frame_mod
_WORDS = struct.Struct("=II")
MODIFYING = frozenset((AND, OR, XOR, SET, CS_XOR, CS_CRC8, UID, *FD_MODIFICATIONS))


@dataclass(frozen=True, order=True)
class Rule:
    """A rule of can-gw.

    Attributes:
        source: interface that the frames come from.
        destination: interface that the frames go to.
        pattern: ids of the frames that the rule passes.
        changes: (number, content) of each netlink attribute that changes the frames.
        flags: flags of ``struct rtcanmsg``, linux/can/gw.h.
        hops: how many rules may pass one frame on; 0: the rule sets no limit.
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
        """Return interfaces, value:mask of the ids (hex), and whether frames change, for people."""
        word, mask = self.pattern.value, self.pattern.mask
        changed = ", changed" if self.changes else ""
        return f"{self.source} -> {self.destination} {word:x}:{mask:x}{changed}"


def changed_bytes(keep: int, put: int, length: int) -> tuple[tuple[int, bytes], ...]:
    """Return the attributes of a rule that change the bytes of a frame.

    Args:
        keep: mask of the bits that stay, byte 0 the lowest; all others are cleared.
        put: bits that are set afterwards.
        length: bytes of the frame; bytes beyond stay unchanged.
    """
    behind = (1 << 64) - (1 << 8 * length)
    modifications = []
    for kind, bits in ((AND, keep | behind), (OR, put)):
        data = (bits & (1 << 64) - 1).to_bytes(8, "little")
        modifications.append((kind, _MODIFICATION.pack(0, 0, data, ON_DATA)))
    return tuple(modifications)


def load_module() -> None:
    """Load the module can-gw, unless the kernel has it; say nothing if that fails."""
    if not Path("/sys/module/can_gw").exists():
        subprocess.run(["modprobe", "can-gw"], capture_output=True, check=False)  # _change says why


def rules() -> list[Rule]:
    """Return all rules of can-gw in the kernel.

    Raises:
        GatewayError: the kernel does not list them.
    """
    names: dict[int, str] = {}
    try:
        bodies = list(request(GET, DUMP, _RULE.pack(socket.AF_CAN, CAN_TO_CAN, 0)))
        rules = [_read(body, names) for body in bodies if body[0] == socket.AF_CAN]
    except OSError as error:
        raise GatewayError(f"rules of can-gw cannot be listed: {error.strerror}") from error
    return rules


def _change(kind: int, rule: Rule) -> None:
    """Add (NEW) or remove (DELETE) a rule.

    Raises:
        GatewayError: the kernel refuses, or has no such rule to remove.
    """
    try:
        ends = [socket.if_nametoindex(n) for n in (rule.source, rule.destination)]
        for _ in request(kind, ACKNOWLEDGE, _message(rule, *ends)):
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
    fields = [*rule.changes]
    if rule.hops:
        fields.append((LIMIT_HOPS, bytes((rule.hops,))))
    fields += [
        (FILTER, _WORDS.pack(rule.pattern.value, rule.pattern.mask)),
        (SOURCE, struct.pack("=I", source)),
        (DESTINATION, struct.pack("=I", destination)),
    ]
    parts += [attribute(kind, payload) for kind, payload in fields]
    return b"".join(parts)


def _read(body: bytes, names: dict[int, str]) -> Rule:
    flags = _RULE.unpack_from(body)[2]
    fields = dict(attributes(body[_RULE.size :]))
    ends = []
    for kind in (SOURCE, DESTINATION):
        (index,) = struct.unpack("=I", fields[kind])
        if index not in names:
            names[index] = socket.if_indextoname(index)
        ends.append(names[index])
    value, mask = _WORDS.unpack(fields.get(FILTER, bytes(8)))
    changes = tuple((kind, fields[kind]) for kind in sorted(MODIFYING & fields.keys()))
    hops = fields.get(LIMIT_HOPS, b"\0")[0]
    return Rule(ends[0], ends[1], Pattern(value, mask), changes, flags, hops)


def make(interfaces: Iterable[str], expected: Iterable[Rule]) -> tuple[list[Rule], list[Rule]]:
    """Replace all rules between these interfaces by the expected ones; other rules stay.

    Rules are removed first, so that for a moment fewer frames pass, and never more.

    Returns:
        (removed rules, added rules).

    Raises:
        GatewayError: the kernel refuses; the rules before that one are changed.
    """
    more, missing = difference(between(interfaces, rules()), expected)
    for rule in more:
        _change(DELETE, rule)
    for rule in missing:
        _change(NEW, rule)
    return more, missing


def difference(present: Iterable[Rule], expected: Iterable[Rule]) -> tuple[list[Rule], list[Rule]]:
    """Return (present rules that are not expected, expected rules that are missing)."""
    more, missing = list(present), []
    for rule in expected:
        if rule in more:
            more.remove(rule)  # one of them: the same rule twice would pass each frame twice
        else:
            missing.append(rule)
    return more, missing


def between(names: Iterable[str], rules: Iterable[Rule]) -> list[Rule]:
    """Return the rules whose source and destination are both among these interfaces."""
    ends = {*names}
    return [rule for rule in rules if {rule.source, rule.destination} <= ends]
