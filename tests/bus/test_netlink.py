"""Messages of rtnetlink, byte by byte, and kind and bit rates of an interface by them."""

import errno
import socket
import struct
from collections.abc import Sequence
from typing import Any

import pytest

from canshaper.bus import netlink
from canshaper.bus.device import Device, read_device
from canshaper.bus.netlink import (
    ACKNOWLEDGE,
    DONE,
    DUMP,
    ERROR,
    attribute,
    attributes,
    kind_and_bitrates,
    request,
)


@pytest.mark.parametrize(
    ("payload", "part"),
    [
        (b"", "0400 0700"),
        (b"a", "0500 0700 61 000000"),
        (b"abc", "0700 0700 616263 00"),
        (b"abcd", "0800 0700 61626364"),
        (b"abcde", "0900 0700 6162636465 000000"),
    ],
)
def test_an_attribute_is_filled_up_to_whole_words(payload: bytes, part: str) -> None:
    made = attribute(7, payload)
    assert made == bytes.fromhex(part)
    # one without a payload, as the last one too
    every = made + attribute(8, b"x") + attribute(9, b"")
    assert list(attributes(every)) == [(7, payload), (8, b"x"), (9, b"")]


def test_an_attribute_that_is_cut_short_ends_them() -> None:
    good = attribute(1, b"a")
    assert list(attributes(good + b"\x03\0\x02\0" + good)) == [(1, b"a")]
    assert list(attributes(good + b"\x08\0")) == [(1, b"a")]
    assert list(attributes(good + b"\x09\0\x02\0abcd")) == [(1, b"a")]  # a byte too few
    assert list(attributes(good + b"\x08\0\x02\0abcd")) == [(1, b"a"), (2, b"abcd")]


def answer(kind: int, body: bytes) -> bytes:
    """A message of the kernel, filled up as the next one needs it."""
    message = struct.pack("=IHHII", 16 + len(body), kind, 0, 1, 0) + body
    return message + bytes(-len(message) % 4)


class Kernel:
    """The other end of a socket: notes what is sent, answers with datagrams."""

    def __init__(self, datagrams: Sequence[bytes]) -> None:
        self.datagrams = list(datagrams)
        self.opened: tuple[int, ...] = ()
        self.sent: list[bytes] = []
        self.closed = False

    def __call__(self, *arguments: int) -> "Kernel":
        self.opened = arguments
        return self

    def __enter__(self) -> "Kernel":
        return self

    def __exit__(self, *_error: object) -> None:
        self.closed = True

    def send(self, data: bytes) -> None:
        self.sent.append(data)

    def recv(self, room: int) -> bytes:
        assert room >= 8192  # what the kernel sends at once
        return self.datagrams.pop(0)


def asked(monkeypatch: pytest.MonkeyPatch, *datagrams: bytes) -> tuple[Kernel, list[bytes]]:
    kernel = Kernel(datagrams)
    monkeypatch.setattr(netlink.socket, "socket", kernel)
    return kernel, list(request(18, ACKNOWLEDGE, b"body"))


def test_what_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, bodies = asked(monkeypatch, answer(16, b"one") + answer(ERROR, bytes(20)))
    assert kernel.opened == (socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE)
    assert kernel.sent == [struct.pack("=IHHII", 20, 18, 0x5, 1, 0) + b"body"]
    assert bodies == [b"one"]
    assert kernel.closed


@pytest.mark.parametrize("end", [b"", bytes(3), bytes(4), bytes(20)])
def test_answers_in_several_messages_and_datagrams(
    monkeypatch: pytest.MonkeyPatch, end: bytes
) -> None:
    bodies = [b"12345", b"123", b"1234", b"123456789"]
    first = b"".join(answer(16, body) for body in bodies[:3])
    second = answer(16, bodies[3]) + answer(DONE, end)
    assert asked(monkeypatch, first, second)[1] == bodies
    assert DUMP == 0x300


@pytest.mark.parametrize("more", [b"", bytes(16)])
def test_a_refusal_is_an_error_of_its_number(monkeypatch: pytest.MonkeyPatch, more: bytes) -> None:
    refusal = answer(ERROR, struct.pack("=i", -errno.EPERM) + more)
    with pytest.raises(PermissionError) as caught:
        asked(monkeypatch, answer(16, b"odd") + refusal)
    assert caught.value.errno == errno.EPERM


# -- kind and bit rates ----------------------------------------------------------------------------


def link_message(kind: bytes | None, data: bytes | None) -> bytes:
    """RTM_NEWLINK, as linux/if_link.h has it: nested attributes with their flag."""
    info = attribute(1, kind + b"\0") if kind else b""
    info += attribute(2 | 0x8000, data) if data is not None else b""
    name = attribute(3, b"can0\0")
    return (
        bytes(16) + name + (attribute(18 | 0x8000, info) if info else b"") + attribute(4, bytes(4))
    )


def timing(bitrate: int, kind: int = 1) -> bytes:
    """can_bittiming behind the clock, as the driver orders them."""
    return attribute(5, bytes(4)) + attribute(
        kind, struct.pack("=8I", bitrate, 875, 250, 6, 7, 2, 1, 2)
    )


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (link_message(b"can", timing(250_000)), ("can", 250_000, None)),
        (
            link_message(b"can", timing(500_000) + timing(2_000_000, kind=9)),
            ("can", 500_000, 2_000_000),
        ),
        (link_message(b"can", attribute(5, bytes(4))), ("can", None, None)),  # none set
        (link_message(b"can", None), ("can", None, None)),
        (link_message(b"vcan", None), ("vcan", None, None)),
        (link_message(b"vcanX", None), ("vcanX", None, None)),
        (link_message(b"vlan", attribute(1, b"\x01\0\0\0")), ("vlan", None, None)),
        (link_message(None, None), (None, None, None)),
    ],
)
def test_kind_and_bit_rate_of_an_interface(
    monkeypatch: pytest.MonkeyPatch,
    message: bytes,
    expected: tuple[str | None, int | None, int | None],
) -> None:
    requested: list[tuple[int, int, bytes]] = []

    def request(kind: int, flags: int, body: bytes) -> Any:
        requested.append((kind, flags, body))
        yield message

    monkeypatch.setattr(netlink, "request", request)
    assert kind_and_bitrates(7) == expected
    assert requested == [(18, 4, struct.pack("=BxHiII", 0, 0, 7, 0, 0))]


def test_the_kernel_itself_answers() -> None:
    """The loopback interface is on every machine, and has no kind."""
    assert kind_and_bitrates(socket.if_nametoindex("lo")) == (None, None, None)
    with pytest.raises(OSError, match="No such device") as caught:
        kind_and_bitrates(999_999)
    assert caught.value.errno == errno.ENODEV


def test_the_real_tree_of_devices() -> None:
    device = read_device("lo")
    assert device == Device("lo", None, None, 0, None, None)
