"""Frames through the port on raw sockets. The same port on real interfaces: tests/hil."""

import errno
import socket
import struct
from collections.abc import Callable, Iterator
from typing import Any

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame
from hypothesis import given
from hypothesis import strategies as st

from canshaper.can import raw
from canshaper.can.frame import BusState, Frame, FrameFault
from canshaper.can.raw import MOST_FRAMES, MOST_UNKNOWN, RawPort
from canshaper.can.socketcan import CAN_INV_FILTER, MOST_FILTERS, SO_RXQ_OVFL, Ids, set_filters
from tests.can.raw_line import VALVE, Line, message

NO_ACKNOWLEDGE = 0x20  # linux/can/error.h


@pytest.fixture
def make_line(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Line]]:
    made: list[Line] = []

    def make(*arguments: Any, **options: Any) -> Line:
        made.append(Line(*arguments, **options))
        monkeypatch.setattr(raw, "time", made[-1])
        return made[-1]

    yield make
    for one in made:
        one.end()


@pytest.fixture
def line(make_line: Callable[..., Line]) -> Line:
    return make_line()


# -- frames ----------------------------------------------------------------------------------------


def test_frames_come_in_order_and_a_call_ends_when_there_is_none(line: Line) -> None:
    assert list(line.port.frames()) == []
    for length in range(9):
        line.put(message(0x100 + length, bytes(range(1, length + 1))))
    assert list(line.port.frames()) == [
        Frame("crane", 0x100 + n, False, bytes(range(1, n + 1))) for n in range(9)
    ]
    assert list(line.port.frames()) == []
    assert line.faults == []


@pytest.mark.parametrize(
    ("can_id", "extended"),
    [(0, False), (0x7FF, False), (0, True), (0x110, True), (2**29 - 1, True)],
)
def test_ids_of_both_widths_both_ways(line: Line, can_id: int, extended: bool) -> None:
    line.put(message(can_id, b"\1\2\3", extended=extended))
    frame = Frame("crane", can_id, extended, b"\1\2\3")
    assert list(line.port.frames()) == [frame]
    assert line.port.send(frame)
    (data,) = line.sent()
    flag = socket.CAN_EFF_FLAG if extended else 0
    assert dissect_can_frame(data) == (can_id | flag, 3, 0, b"\1\2\3")
    assert len(data) == 16


def test_what_is_no_data_frame_is_counted_and_not_handed_on(line: Line) -> None:
    line.put(can.Message(arbitration_id=0x110, is_remote_frame=True, dlc=8, is_extended_id=False))
    line.far[0].send(build_can_frame(message(0x110, bytes(8)))[:15])
    line.far[0].send(b"")
    line.far[0].send(struct.pack("=IB3x8s", 0x110, 9, bytes(8)))
    line.error(NO_ACKNOWLEDGE)
    line.put(message(0x111))
    assert [f.can_id for f in line.port.frames()] == [0x111]
    assert line.faults == [FrameFault.WRONG_LENGTH] * 4 + [FrameFault.ERROR_FRAME]


def test_an_error_frame_is_none_whatever_its_class_looks_like(line: Line) -> None:
    """The class of an error stands where the id stands: 0x110 would be a lever."""
    line.error(0x110)
    assert list(line.port.frames()) == []
    assert line.faults == [FrameFault.ERROR_FRAME]


def test_a_flood_cannot_hold_up_the_tick_for_ever(make_line: Callable[..., Line]) -> None:
    line = make_line(2)
    line.put(message(0x110))
    line.put(message(0x7F0), 1)
    seen: list[int] = []
    for frame in line.port.frames():
        seen.append(frame.can_id)
        line.put(message(frame.can_id), 0 if frame.can_id == 0x110 else 1)
    assert seen == [0x110] * MOST_FRAMES + [0x7F0] * MOST_UNKNOWN


def test_unknown_ids_come_after_those_that_matter(make_line: Callable[..., Line]) -> None:
    line = make_line(2)
    for can_id in range(5):
        line.put(message(0x7F0 + can_id), 1)
    line.put(message(0x110))
    assert [f.can_id for f in line.port.frames()] == [0x110, *range(0x7F0, 0x7F5)]


def test_a_queue_that_has_run_over_is_told_once_for_each_time() -> None:
    """On UDP, whose queue overflows as that of a CAN socket does and tells it the same way."""
    faults: list[FrameFault] = []
    near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    near.setblocking(False)
    near.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    near.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
    near.bind(("127.0.0.1", 0))
    port = RawPort("crane", lambda _ids: [near], None, faults.append, confirms=False)
    frame = build_can_frame(message(0x110))
    with near, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far:
        far.connect(near.getsockname())
        for overflows in (1, 2):
            for _ in range(100):
                far.send(frame)
            assert 0 < len(list(port.frames())) < 100
            for _ in range(3):  # the count comes with every frame that was queued afterwards
                far.send(frame)
                assert len(list(port.frames())) == 1
            assert faults == [FrameFault.FRAMES_LOST] * overflows


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
    line.near[0].fail = OSError(code, "full")
    for _ in range(10):
        assert not line.port.send(VALVE)
    line.near[0].fail = None
    assert line.faults == []
    assert line.port.send(VALVE)


def test_another_error_is_told_and_sending_goes_on(line: Line) -> None:
    line.far[0].close()
    assert not line.port.send(VALVE)
    assert line.faults == [FrameFault.BUS_ERROR]
    line.near[0].fail = OSError(errno.EINVAL, "other")
    assert list(line.port.frames()) == []
    assert line.faults == [FrameFault.BUS_ERROR] * 2
    assert line.port.fileno() == line.near[0].fileno()


# -- filters ---------------------------------------------------------------------------------------


class Filtered(socket.socket):
    """Keeps the filters that it is given, and asks them as net/can/af_can.c and raw.c do."""

    def setsockopt(self, *arguments: Any) -> None:
        level, option, value = arguments
        assert (level, option) == (socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER)
        self.filters = list(struct.iter_unpack("=II", value))

    def hears(self, word: int, *, join: bool) -> bool:
        found = []
        for can_id, mask in self.filters:
            wanted = can_id & ~CAN_INV_FILTER
            found.append((word & mask == wanted & mask) is not bool(can_id & CAN_INV_FILTER))
        return all(found) if join else any(found)


MESSAGES = st.frozensets(
    st.one_of(
        st.tuples(st.integers(0, 0x7FF), st.just(False)),
        st.tuples(st.integers(0, 0x7FF), st.just(True)),
        st.tuples(st.integers(0, 2**29 - 1), st.just(True)),
    ),
    max_size=8,
)


@given(taken=MESSAGES, sent=MESSAGES, known=MESSAGES, others=MESSAGES)
def test_one_socket_hears_what_matters_the_other_what_nobody_knows(
    taken: frozenset[tuple[int, bool]],
    sent: frozenset[tuple[int, bool]],
    known: frozenset[tuple[int, bool]],
    others: frozenset[tuple[int, bool]],
) -> None:
    """Every message goes to one of them at most, whatever ids of the two widths are alike."""
    with Filtered() as main, Filtered() as rest:
        set_filters([main, rest], Ids(taken, sent, known))
        everything = taken | sent | known | others
        for can_id, extended in everything | {(i & 0x7FF, not e) for i, e in everything}:
            word = can_id | (socket.CAN_EFF_FLAG if extended else 0)
            here = (can_id, extended) in taken | sent
            assert main.hears(word, join=False) is here
            unknown = (can_id, extended) not in taken | sent | known
            assert rest.hears(word, join=True) is unknown


def test_more_ids_than_filters_leave_the_known_ones_to_the_reader() -> None:
    taken = frozenset({(0x110, False)})
    for size, heard in ((MOST_FILTERS - 1, False), (MOST_FILTERS, True)):
        known = frozenset((0x1000 + i, True) for i in range(size))
        with Filtered() as main, Filtered() as rest:
            set_filters([main, rest], Ids(taken, frozenset(), known))
            assert len(rest.filters) <= MOST_FILTERS
            assert rest.hears(0x1000 | socket.CAN_EFF_FLAG, join=True) is heard
            assert rest.hears(0x5000 | socket.CAN_EFF_FLAG, join=True)
            assert not rest.hears(0x110, join=True)
