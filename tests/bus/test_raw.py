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

from canshaper.bus import raw
from canshaper.bus.raw import MOST_FRAMES, MOST_UNKNOWN, PROBE_NS, RawPort
from canshaper.bus.socketcan import CAN_INV_FILTER, MOST_FILTERS, set_filters
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.machine.routing import BusRoutes
from tests.bus.raw_line import IDS, SENT_BACK, TAKEN, UNKNOWN, VALVE, Line, message


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

# A port that is told its ids has three sockets, one that is not has one.
EITHER = pytest.mark.parametrize("ids", [IDS, None])


@EITHER
def test_frames_come_in_order_and_a_call_ends_when_there_is_none(
    make_line: Callable[..., Line], ids: BusRoutes | None
) -> None:
    line = make_line(ids)
    assert line.heard() == []
    for length in range(9):
        line.put(message(0x100 + length, bytes(range(1, length + 1))))
    assert list(line.port.frames()) == [
        Frame("crane", 0x100 + n, False, bytes(range(1, n + 1))) for n in range(9)
    ]
    assert line.heard() == []
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
    assert line.heard() == [frame]
    assert line.port.send(frame)
    (data,) = line.sent()
    flag = socket.CAN_EFF_FLAG if extended else 0
    assert dissect_can_frame(data) == (can_id | flag, 3, 0, b"\1\2\3")
    assert len(data) == 16


@pytest.mark.parametrize("number", [TAKEN, SENT_BACK, UNKNOWN])
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
    assert [f.can_id for f in line.heard()] == [0x111]
    assert line.faults == [FrameFault.WRONG_LENGTH] * 6


@EITHER
@pytest.mark.parametrize("kind", [0x20, 0x110, 0x200, 0x300])  # linux/can/error.h
def test_an_error_frame_is_none_whatever_its_class_looks_like(
    make_line: Callable[..., Line], ids: BusRoutes | None, kind: int
) -> None:
    """The classes of errors stand where the id stands: 0x110 would be a joystick."""
    line = make_line(ids)
    line.error(kind)
    assert line.heard() == []
    assert line.faults == [FrameFault.ERROR_FRAME]


def test_a_flood_cannot_hold_up_the_tick_for_ever(line: Line) -> None:
    """Each frame that is taken is followed by another one."""
    for number in (TAKEN, SENT_BACK, UNKNOWN):
        line.put(message(number), number)
    seen: list[int] = []
    for source in (line.port.frames, line.port.background):
        for frame in source():
            seen.append(frame.can_id)
            line.put(message(frame.can_id), frame.can_id)
    most = [TAKEN] * MOST_FRAMES + [SENT_BACK] * MOST_FRAMES + [UNKNOWN] * MOST_UNKNOWN
    assert seen == most


def test_what_can_wait_does_not_come_with_the_joysticks(line: Line) -> None:
    line.put(message(0x7F0), UNKNOWN)
    line.put(message(0x200), SENT_BACK)
    line.put(message(0x110))
    assert [f.can_id for f in line.port.frames()] == [0x110]
    assert [f.can_id for f in line.port.background()] == [0x200, 0x7F0]


@pytest.mark.parametrize("number", [TAKEN, SENT_BACK])
def test_a_queue_that_has_run_over_is_told_once_for_each_time(number: int) -> None:
    """On UDP, whose queue overflows as that of a CAN socket does."""
    faults: list[FrameFault] = []
    pairs = [udp_pair() for _ in range(3)]
    near = [near for near, _ in pairs]
    port = RawPort("crane", lambda _ids: near, IDS, faults.append, confirms=True)
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


def test_another_error_is_told_until_a_frame_gets_through(line: Line) -> None:
    line.near[SENT_BACK].fail = OSError(errno.EINVAL, "other")
    for _ in range(3):
        assert not line.port.send(VALVE)
    assert line.port.state is BusState.FAILED
    assert line.faults == [FrameFault.BUS_ERROR] * 3
    line.near[SENT_BACK].fail = None
    assert line.port.send(VALVE)
    line.confirm(VALVE)
    assert line.heard() == []
    assert line.port.state is BusState.UP


@pytest.mark.parametrize("number", [TAKEN, SENT_BACK, UNKNOWN])
def test_an_error_of_one_socket_keeps_the_others_working(line: Line, number: int) -> None:
    for other in range(3):
        line.put(message(other), other)
    line.near[number].fail = OSError(errno.EINVAL, "other")
    assert [f.can_id for f in line.heard()] == [n for n in range(3) if n != number]
    assert line.faults == [FrameFault.BUS_ERROR]
    line.near[number].fail = None
    assert [f.can_id for f in line.heard()] == [number]


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
def test_each_message_is_heard_by_the_socket_that_is_for_it(
    taken: frozenset[tuple[int, bool]],
    sent: frozenset[tuple[int, bool]],
    known: frozenset[tuple[int, bool]],
    others: frozenset[tuple[int, bool]],
) -> None:
    """And by no other one, whatever ids of the two widths are alike."""
    sent -= taken  # checked with the deployment
    with Filtered() as first, Filtered() as second, Filtered() as third:
        set_filters([first, second, third], BusRoutes(taken, sent, sent, known))
        everything = taken | sent | known | others
        for can_id, extended in everything | {(i & 0x7FF, not e) for i, e in everything}:
            word = can_id | (socket.CAN_EFF_FLAG if extended else 0)
            heard = [
                first.hears(word, join=False),
                second.hears(word, join=False),
                third.hears(word, join=True),
            ]
            message = (can_id, extended)
            assert heard == [
                message in taken,
                message in sent,
                message not in taken | sent | known,
            ]


def test_more_ids_than_filters_leave_the_known_ones_to_the_reader() -> None:
    taken = frozenset({(0x110, False)})
    for size, heard in ((MOST_FILTERS - 1, False), (MOST_FILTERS, True)):
        known = frozenset((0x1000 + i, True) for i in range(size))
        with Filtered() as first, Filtered() as second, Filtered() as third:
            ids = BusRoutes(taken, frozenset(), frozenset(), known)
            set_filters([first, second, third], ids)
            assert len(third.filters) <= MOST_FILTERS
            assert third.hears(0x1000 | socket.CAN_EFF_FLAG, join=True) is heard
            assert third.hears(0x5000 | socket.CAN_EFF_FLAG, join=True)
            assert not third.hears(0x110, join=True)


CLAIM = Frame("crane", 0x18EEFF9C, True, bytes(range(8)))
NODE = BusRoutes(
    received=frozenset(),
    sent=IDS.sent,
    valves=IDS.valves,
    known=frozenset(),
    claims=frozenset({(CLAIM.can_id, True)}),
)


def claimed(line: Line, frame: Frame = CLAIM) -> None:
    """It comes to the socket of what is taken, as every frame of its group does."""
    line.put(can.Message(arbitration_id=frame.can_id, is_extended_id=True, data=frame.data), TAKEN)


def test_a_claim_of_ours_that_comes_back_is_no_claim_of_another(
    make_line: Callable[..., Line],
) -> None:
    line = make_line(NODE)
    assert line.port.send(CLAIM)
    claimed(line)
    assert line.heard() == []
    claimed(line)  # ours came back once; this is of one that has our NAME
    assert line.heard() == [CLAIM]


def test_a_claim_of_another_that_comes_before_ours_is_one(make_line: Callable[..., Line]) -> None:
    line = make_line(NODE)
    other = CLAIM._replace(data=bytes(8))
    assert line.port.send(CLAIM)
    claimed(line, other)
    claimed(line)
    assert line.heard() == [other]
