"""Messages of rtnetlink, byte by byte: attributes, what is asked, and answers of several parts."""

import errno
import socket
import struct
from collections.abc import Sequence

import pytest

from canshaper.bus import netlink
from canshaper.bus.netlink import ACKNOWLEDGE, DONE, DUMP, ERROR, attribute, attributes, request


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
