"""Frames through the port on raw sockets. The same port on real interfaces: tests/hil."""

import errno
import socket
import struct
from collections.abc import Callable
from typing import Any

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame

from canshaper.bus import raw
from canshaper.bus.interface import PROBE_NS
from canshaper.bus.raw import MOST_FRAMES, MOST_UNKNOWN, RawPort
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.machine.routing import BusRoutes
from tests.bus.raw_line import IDS, RECEIVED, SENT_BACK, UNKNOWN, VALVE, Line, message, port_on

# -- frames ----------------------------------------------------------------------------------------

# A port that has its ids has three sockets, one that is not has one.
EITHER = pytest.mark.parametrize("ids", [IDS, None])


@EITHER
def test_frames_come_in_order_and_a_call_ends_when_there_is_none(
    make_line: Callable[..., Line], ids: BusRoutes | None
) -> None:
    line = make_line(ids)
    assert line.received() == []
    for length in range(9):
        line.put(message(0x100 + length, bytes(range(1, length + 1))))
    assert list(line.port.frames()) == [
        Frame("crane", 0x100 + n, False, bytes(range(1, n + 1))) for n in range(9)
    ]
    assert line.received() == []
    assert line.faults == []


@EITHER
@pytest.mark.parametrize(
    ("can_id", "extended"),
    [(0, False), (0x7FF, False), (0, True), (0x110, True), (2**29 - 1, True)],
)
def test_ids_of_both_widths_both_ways(
    make_line: Callable[..., Line], ids: BusRoutes | None, can_id: int, extended: bool
) -> None:
    line = make_line(ids)
    line.put(message(can_id, b"\1\2\3", extended=extended))
    frame = Frame("crane", can_id, extended, b"\1\2\3")
    assert line.received() == [frame]
    assert line.port.send(frame)
    (data,) = line.sent()
    flag = socket.CAN_EFF_FLAG if extended else 0
    assert dissect_can_frame(data) == (can_id | flag, 3, 0, b"\1\2\3")
    assert len(data) == 16


@pytest.mark.parametrize(
    ("word", "can_id"), [(0x1000_0110, 0x110), (0x800, 0), (0x1FFF_FFFF, 0x7FF)]
)
def test_bits_beyond_a_standard_id_are_not_part_of_it(line: Line, word: int, can_id: int) -> None:
    line.far[UNKNOWN].send(struct.pack("=IB3x8s", word, 2, b"\1\2" + bytes(6)))
    assert line.received() == [Frame("crane", can_id, False, b"\1\2")]


@pytest.mark.parametrize("number", [RECEIVED, SENT_BACK, UNKNOWN])
def test_what_is_no_data_frame_is_counted_and_not_handed_on(line: Line, number: int) -> None:
    for can_id, extended in ((0x110, False), (0x110, True)):
        line.put(
            can.Message(
                arbitration_id=can_id, is_remote_frame=True, dlc=8, is_extended_id=extended
            ),
            number,
        )
        word = can_id | (socket.CAN_EFF_FLAG if extended else 0)
        line.far[number].send(struct.pack("=IB3x8s", word, 9, bytes(8)))
    line.far[number].send(build_can_frame(message(0x110, bytes(8)))[:15])
    line.far[number].send(b"")
    line.put(message(0x111), number)
    assert [f.can_id for f in line.received()] == [0x111]
    assert line.faults == [FrameFault.WRONG_LENGTH] * 6


@EITHER
@pytest.mark.parametrize("kind", [0x20, 0x110, 0x200, 0x300])  # linux/can/error.h
def test_an_error_frame_is_none_whatever_its_class_looks_like(
    make_line: Callable[..., Line], ids: BusRoutes | None, kind: int
) -> None:
    """The classes of errors stand where the id stands: 0x110 would be a joystick."""
    line = make_line(ids)
    line.error(kind)
    assert line.received() == []
    assert line.faults == [FrameFault.ERROR_FRAME]


def test_a_flood_cannot_hold_up_the_tick_for_ever(line: Line) -> None:
    """Each frame that is received is followed by another one."""
    for number in (RECEIVED, SENT_BACK, UNKNOWN):
        line.put(message(number), number)
    seen: list[int] = []
    for source in (line.port.frames, line.port.background):
        for frame in source():
            seen.append(frame.can_id)
            line.put(message(frame.can_id), frame.can_id)
    most = [RECEIVED] * MOST_FRAMES + [SENT_BACK] * MOST_FRAMES + [UNKNOWN] * MOST_UNKNOWN
    assert seen == most


def test_what_can_wait_does_not_come_with_the_joysticks(line: Line) -> None:
    line.put(message(0x7F0), UNKNOWN)
    line.put(message(0x200), SENT_BACK)
    line.put(message(0x110))
    assert [f.can_id for f in line.port.frames()] == [0x110]
    assert [f.can_id for f in line.port.background()] == [0x200, 0x7F0]


def test_no_read_waits_for_a_frame(line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tick has other things to do."""
    timeouts: list[int] = []
    for number, waiting in enumerate(line.port._waiting):

        def waits(timeout_ms: int, poll: Any = waiting) -> Any:
            timeouts.append(timeout_ms)
            return poll(timeout_ms)

        line.port._waiting[number] = waits
        line.put(message(0x110), number)
    assert len(line.received()) == 3
    assert timeouts == [0] * 6


def test_a_gateway_waits_on_the_socket_of_what_is_received(line: Line) -> None:
    assert line.port.fileno() == line.near[RECEIVED].fileno()


def test_another_deployment_gets_its_own_filters(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    filtered: list[tuple[Any, BusRoutes]] = []
    monkeypatch.setattr(raw, "set_filters", lambda *to: filtered.append(to))
    others = BusRoutes(frozenset(), frozenset(), frozenset(), frozenset())
    line.port.watch("crane", others)
    assert filtered == [(line.near, others)]


def test_what_overflows_of_ids_that_no_one_knows_is_no_fault() -> None:
    """Frames of others at their own pace: nothing of ours is lost."""
    faults, _ = overflowing(UNKNOWN)
    assert faults == []


def test_confirmations_may_be_among_the_frames_that_were_lost() -> None:
    """Frames under way are not waited for any more, or a valve would be cut off."""
    faults, port = overflowing(SENT_BACK)
    assert faults == [FrameFault.FRAMES_LOST]
    assert port._unconfirmed == {}


def overflowing(number: int) -> tuple[list[FrameFault], RawPort]:
    """Faults of a port one of whose queues has run over, with a valve's frame under way."""
    faults: list[FrameFault] = []
    pairs = [udp_pair() for _ in range(3)]
    near, far = [near for near, _ in pairs], [far for _, far in pairs]
    near[SENT_BACK].connect(far[SENT_BACK].getsockname())
    port = port_on(lambda _ids: near, IDS, faults.append)
    assert port.send(VALVE)
    for _ in range(100):
        far[number].send(build_can_frame(message(0x110)))
    assert len([*port.frames(), *port.background()]) < 100
    for one in (*near, *far):
        one.close()
    return faults, port


@pytest.mark.parametrize("number", [RECEIVED, SENT_BACK])
def test_a_queue_that_has_run_over_is_reported_once_for_each_time(number: int) -> None:
    """On UDP, whose queue overflows as that of a CAN socket does."""
    faults: list[FrameFault] = []
    pairs = [udp_pair() for _ in range(3)]
    near = [near for near, _ in pairs]
    port = port_on(lambda _ids: near, IDS, faults.append)
    frame = build_can_frame(message(0x110))
    far = pairs[number][1]
    for overflows in (1, 2):
        for _ in range(100):
            far.send(frame)
        assert 0 < len([*port.frames(), *port.background()]) < 100
        for _ in range(3):
            far.send(frame)
            assert len([*port.frames(), *port.background()]) == 1
        assert faults == [FrameFault.FRAMES_LOST] * overflows
    for one in (*near, *(far for _, far in pairs)):
        one.close()


def udp_pair() -> tuple[socket.socket, socket.socket]:
    """A socket with a short queue, and one that sends to it."""
    near, far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    near.setblocking(False)
    near.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    near.bind(("127.0.0.1", 0))
    far.connect(near.getsockname())
    return near, far


# -- sending ---------------------------------------------------------------------------------------


def test_a_full_queue_is_no_reason_to_wait(line: Line) -> None:
    sent = 0
    while line.port.send(Frame("crane", 0x200 + sent, False, b"")):  # one of each id under way
        sent += 1
        assert sent < 100_000
    assert sent > 0
    assert not line.port.send(VALVE)
    assert line.faults == []  # the caller counts what was not sent
    assert line.port.state is BusState.UP
    assert len(line.sent()) == sent
    assert line.port.send(VALVE)  # what was refused is not under way
    assert len(line.sent()) == 1


@pytest.mark.parametrize("code", [errno.ENOBUFS, errno.EAGAIN])
def test_a_full_queue_of_the_interface_is_a_failed_send_and_no_more(line: Line, code: int) -> None:
    line.near[SENT_BACK].fail = OSError(code, "full")
    for _ in range(10):
        line.now_ns += PROBE_NS
        assert not line.port.send(VALVE)
    line.near[SENT_BACK].fail = None
    assert line.faults == []
    assert line.port.send(VALVE)


def test_another_error_is_reported_until_a_frame_gets_through(line: Line) -> None:
    line.near[SENT_BACK].fail = OSError(errno.EINVAL, "other")
    for _ in range(3):
        assert not line.port.send(VALVE)
    assert line.port.state is BusState.FAILED
    assert line.faults == [FrameFault.BUS_ERROR] * 3
    line.near[SENT_BACK].fail = None
    assert line.port.send(VALVE)
    line.confirm(VALVE)
    assert line.received() == []
    assert line.port.state is BusState.UP


@pytest.mark.parametrize("number", [RECEIVED, SENT_BACK, UNKNOWN])
def test_an_error_of_one_socket_keeps_the_others_working(line: Line, number: int) -> None:
    for other in range(3):
        line.put(message(other), other)
    line.near[number].fail = OSError(errno.EINVAL, "other")
    assert [f.can_id for f in line.received()] == [n for n in range(3) if n != number]
    assert line.faults == [FrameFault.BUS_ERROR]
    line.near[number].fail = None
    assert [f.can_id for f in line.received()] == [number]


def test_a_far_end_that_is_gone_is_an_error_as_any_other(make_line: Callable[..., Line]) -> None:
    """The real thing: the kernel answers ECONNREFUSED."""
    line = make_line(None)
    line.far[0].close()
    assert not line.port.send(VALVE)
    assert line.faults == [FrameFault.BUS_ERROR]


def test_without_confirmations_nothing_is_said_about_the_bus(
    make_line: Callable[..., Line],
) -> None:
    line = make_line(None)
    assert line.unconfirmed(most=500) == 500
    assert line.port.state is BusState.UP
