"""Kind and bit rate of an interface, as the kernel answers over netlink."""

import errno
import socket
import struct
from typing import Any

import pytest

from canshaper.bus import netlink
from canshaper.bus.device import Device, read_device
from canshaper.bus.netlink import kind_and_bitrates


def field(kind: int, payload: bytes) -> bytes:
    return netlink.attribute(kind, payload)


def link_message(kind: bytes | None, data: bytes | None) -> bytes:
    """RTM_NEWLINK, as linux/if_link.h has it: nested attributes with their flag."""
    info = field(1, kind + b"\0") if kind else b""
    info += field(2 | 0x8000, data) if data is not None else b""
    name = field(3, b"can0\0")
    return bytes(16) + name + (field(18 | 0x8000, info) if info else b"") + field(4, bytes(4))


def timing(bitrate: int, kind: int = 1) -> bytes:
    """can_bittiming behind the clock, as the driver orders them."""
    return field(5, bytes(4)) + field(kind, struct.pack("=8I", bitrate, 875, 250, 6, 7, 2, 1, 2))


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (link_message(b"can", timing(250_000)), ("can", 250_000, None)),
        (
            link_message(b"can", timing(500_000) + timing(2_000_000, kind=9)),
            ("can", 500_000, 2_000_000),
        ),
        (link_message(b"can", field(5, bytes(4))), ("can", None, None)),  # none set
        (link_message(b"can", None), ("can", None, None)),
        (link_message(b"vcan", None), ("vcan", None, None)),
        (link_message(b"vcanX", None), ("vcanX", None, None)),
        (link_message(b"vlan", field(1, b"\x01\0\0\0")), ("vlan", None, None)),
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
