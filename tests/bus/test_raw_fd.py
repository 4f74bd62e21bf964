"""Frames of CAN FD through the port on raw sockets; python-can makes and reads them."""

import socket
import struct
from collections.abc import Callable
from dataclasses import replace

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame

from canshaper.bus.packet import FDF, pack, unpack
from canshaper.codec.frame import BusState, Frame, FrameFault
from tests.bus.raw_line import IDS, RECEIVED, SENT_BACK, UNKNOWN, Line, message

LONG = Frame("crane", 0x200, False, bytes(range(1, 65)))
SHORT = Frame("crane", 0x300, False, b"\5\6")
WIDE = Frame("crane", 0x300, True, bytes(range(12)))
FD = frozenset(((0x200, False), (0x300, True)))
FD_IDS = replace(IDS, sent=IDS.sent | FD, fd=FD)
BRS, FD_FLAG = 0x01, 0x04  # linux/can.h, CANFD_BRS and CANFD_FDF


def fd_message(can_id: int, data: bytes, *, extended: bool = False) -> can.Message:
    return can.Message(
        arbitration_id=can_id, is_extended_id=extended, data=data, is_fd=True, bitrate_switch=True
    )


@pytest.fixture
def line(make_line: Callable[..., Line]) -> Line:
    return make_line(FD_IDS, fd=True)


@pytest.mark.parametrize("number", [RECEIVED, SENT_BACK, UNKNOWN])
@pytest.mark.parametrize("extended", [False, True])
def test_frames_of_both_kinds_are_received(line: Line, number: int, extended: bool) -> None:
    can_id = 0x1ABCDEF0 if extended else 0x7F0
    for length in (0, 1, 8, 12, 16, 20, 24, 32, 48, 64):
        line.put(fd_message(can_id, bytes(range(length)), extended=extended), number)
        line.put(message(0x111, bytes(range(min(length, 8))), extended=extended), number)
    expected = []
    for length in (0, 1, 8, 12, 16, 20, 24, 32, 48, 64):
        expected.append(Frame("crane", can_id, extended, bytes(range(length))))
        expected.append(Frame("crane", 0x111, extended, bytes(range(min(length, 8)))))
    assert line.received() == expected
    assert line.faults == []


@pytest.mark.parametrize(("brs", "flags"), [(False, FD_FLAG), (True, FD_FLAG | BRS)])
def test_each_message_is_sent_in_its_kind_of_frame(
    make_line: Callable[..., Line], brs: bool, flags: int
) -> None:
    """The id says which; 29 bits are another message than 11."""
    line = make_line(FD_IDS, fd=True, brs=brs)
    assert line.port.send(LONG)
    assert line.port.send(SHORT)
    assert line.port.send(WIDE)
    long, short, wide = line.sent()
    assert (len(long), len(short), len(wide)) == (72, 16, 72)
    assert dissect_can_frame(long) == (0x200, 64, flags, LONG.data)
    assert dissect_can_frame(short) == (0x300, 2, 0, b"\5\6")
    assert dissect_can_frame(wide) == (0x300 | socket.CAN_EFF_FLAG, 12, flags, WIDE.data)


def test_a_frame_of_eight_bytes_may_be_one_of_can_fd(line: Line) -> None:
    assert line.port.send(LONG._replace(data=bytes(8)))
    (sent,) = line.sent()
    assert (len(sent), sent[4]) == (72, 8)


def test_another_deployment_has_other_messages_of_can_fd(line: Line) -> None:
    line.port.watch("crane", replace(FD_IDS, fd=frozenset(((0x300, False),))))
    assert line.port.send(SHORT)
    (sent,) = line.sent()
    assert len(sent) == 72


def test_without_ids_the_messages_of_can_fd_are_named(make_line: Callable[..., Line]) -> None:
    line = make_line(None, fd=True)
    assert line.port.send(LONG)
    (sent,) = line.sent()
    assert len(sent) == 72


def test_a_classical_bus_receives_none(make_line: Callable[..., Line]) -> None:
    """Its sockets are never given one; what is too long is no frame of it."""
    line = make_line(IDS)
    line.put(fd_message(0x110, bytes(12)))
    line.put(message(0x111))
    assert [f.can_id for f in line.port.frames()] == [0x111]
    assert line.faults in ([], [FrameFault.WRONG_LENGTH])


@pytest.mark.parametrize(
    "packet",
    [
        struct.pack("=IBB2x64s", 0x110, 65, FDF, b""),
        struct.pack("=IBB2x64s", 0x110 | socket.CAN_RTR_FLAG, 12, FDF, b""),
        struct.pack("=IBB2x64s", 0x110 | socket.CAN_ERR_FLAG, 12, FDF, b""),
        struct.pack("=IBB2x63s", 0x110, 12, FDF, b""),
    ],
)
def test_what_is_no_frame_of_can_fd(line: Line, packet: bytes) -> None:
    line.far[RECEIVED].send(packet)
    line.put(fd_message(0x112, bytes(64)))
    assert [f.can_id for f in line.received()] == [0x112]
    assert line.faults == [FrameFault.WRONG_LENGTH]


def test_frames_that_come_back_are_confirmed(line: Line) -> None:
    """A bus that confirms nothing is blocked after some frames, one that does is not."""
    for _ in range(20):
        line.now_ns += 20_000_000
        assert line.port.send(LONG)
        line.confirm(fd_message(0x200, LONG.data))
        assert line.received() == []
    assert line.port.state is BusState.UP
    assert line.unconfirmed(LONG) == 3
    assert line.faults == [FrameFault.NOT_CONFIRMED]


@pytest.mark.parametrize("frame", [message(0x110, b"\1\2"), fd_message(0x7FF, bytes(64))])
def test_a_packet_is_the_structure_of_the_kernel(frame: can.Message) -> None:
    packed = build_can_frame(frame)
    packet = unpack(packed)
    flags = packed[5] if frame.is_fd else None
    assert packet == (frame.arbitration_id, bytes(frame.data), flags)
    again = pack(*packet)
    assert (again[:6], again[8:]) == (packed[:6], packed[8:])  # between them the DLC once more
