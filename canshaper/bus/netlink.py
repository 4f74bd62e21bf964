"""Requests to the kernel over rtnetlink; formats of linux/netlink.h and linux/rtnetlink.h."""

import os
import socket
import struct
from collections.abc import Iterator

REQUEST, ACKNOWLEDGE, DUMP, ERROR, DONE = 0x1, 0x4, 0x300, 2, 3
_HEADER = struct.Struct("=IHHII")  # nlmsghdr
_ATTRIBUTE = struct.Struct("=HH")  # rtattr
TYPE_MASK = 0x3FFF  # NLA_TYPE_MASK: a type without its flags for nesting and byte order
ROOM = 1 << 16
# linux/rtnetlink.h, linux/if_link.h, linux/can/netlink.h; Python has no names for these.
GET_LINK = 18
LINK_INFO, INFO_KIND, INFO_DATA, CAN_BIT_TIMING, CAN_DATA_BIT_TIMING = 18, 1, 2, 1, 9
_LINK = struct.Struct("=BxHiII")  # ifinfomsg
_BITRATE = struct.Struct("=I")  # the first member of can_bittiming
KindAndBitrates = tuple[str | None, int | None, int | None]


def attribute(kind: int, payload: bytes) -> bytes:
    """Return one attribute of a message, padded to a multiple of 4 bytes."""
    part = _ATTRIBUTE.pack(_ATTRIBUTE.size + len(payload), kind) + payload
    return part + bytes(-len(part) % 4)


def attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield (kind, payload) of each attribute; end at one with an impossible length."""
    at = 0
    while at + _ATTRIBUTE.size <= len(data):
        length, kind = _ATTRIBUTE.unpack_from(data, at)
        if not _ATTRIBUTE.size <= length <= len(data) - at:
            return
        yield kind & TYPE_MASK, data[at + _ATTRIBUTE.size : at + length]
        at += -(-length // 4) * 4


def request(kind: int, flags: int, body: bytes) -> Iterator[bytes]:
    """Send one request, and yield the bodies of the answers.

    Args:
        kind: type of the message.
        flags: ACKNOWLEDGE or DUMP, so that the kernel marks the end of its answers.
        body: content of the request after its header.

    Raises:
        OSError: the kernel refuses, or this process may not open such a socket.
    """
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as kernel:
        header = _HEADER.pack(_HEADER.size + len(body), kind, REQUEST | flags, 1, 0)
        kernel.send(header + body)
        while True:
            data = kernel.recv(ROOM)
            at = 0
            while at < len(data):
                length, answer, _flags, _number, _port = _HEADER.unpack_from(data, at)
                content = data[at + _HEADER.size : at + length]
                if answer in (ERROR, DONE):
                    code = -struct.unpack_from("=i", content)[0] if len(content) >= 4 else 0
                    if code:
                        raise OSError(code, os.strerror(code))
                    return
                yield content
                at += -(-length // 4) * 4


def kind_and_bitrates(index: int) -> KindAndBitrates:
    """Ask the kernel for (kind, bit/s, bit/s of the data phase) of the interface with an index.

    Each is None if the interface has none, such as the bit rates of vcan.

    Raises:
        OSError: there is no such interface, or netlink is not permitted.
    """
    (body,) = request(GET_LINK, ACKNOWLEDGE, _LINK.pack(socket.AF_UNSPEC, 0, index, 0, 0))
    info = dict(attributes(dict(attributes(body[_LINK.size :])).get(LINK_INFO, b"")))
    kind = info.get(INFO_KIND, b"").rstrip(b"\0").decode() or None
    data = dict(attributes(info.get(INFO_DATA, b""))) if kind == "can" else {}
    timings = (data.get(CAN_BIT_TIMING), data.get(CAN_DATA_BIT_TIMING))
    rates = [_BITRATE.unpack_from(timing)[0] if timing else None for timing in timings]
    return kind, rates[0], rates[1]
