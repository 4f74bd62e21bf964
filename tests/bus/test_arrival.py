"""A frame is as old as its arrival, never younger: stamps of the kernel, and ports without any."""

import errno
import socket
import struct
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.bus import interface, packet, raw
from canshaper.bus.interface import REOPEN_NS
from canshaper.bus.packet import SO_TIMESTAMPNS, Arrivals, stamp_ns
from canshaper.bus.port import ListeningPort
from canshaper.gate.cycle import boottime_ns
from tests.bus.clocks import START_NS, WALL_NS, Clocks, arrivals_of
from tests.bus.raw_line import IDS, RECEIVED, TICK_NS, Line, message

MS = 1_000_000


# -- stamps ----------------------------------------------------------------------------------------


def ancillary(wall_ns: int) -> list[tuple[int, int, bytes]]:
    value = struct.pack("@ll", *divmod(wall_ns, 10**9))
    return [(socket.SOL_SOCKET, SO_TIMESTAMPNS, value)]


def test_a_stamp_is_read_among_what_else_a_message_carries() -> None:
    ((level, kind, value),) = ancillary(WALL_NS + 7)
    assert stamp_ns([]) is None
    others = [(level, kind + 1, value), (level + 1, kind, value), (level, kind, value[:-1])]
    assert stamp_ns(others) is None
    assert stamp_ns([*others, (level, kind, value)]) == WALL_NS + 7


def test_the_kernel_stamps_what_a_port_hands_out() -> None:
    """The real thing, read later: the stamp is that of the sending, not that of the reading."""
    line = Line()
    try:
        before_ns = time.time_ns()
        for number in range(3):
            line.put(message(0x100 + number))
        sent_ns = boottime_ns()
        assert [line.port.arrived_ns <= sent_ns for _ in line.port.frames()] == [True] * 3
        line.put(message(0x100))
        data = line.near[RECEIVED].recvmsg(raw.SIZE, packet.ANCILLARY_BYTES)
        stamp = stamp_ns(data[1])
        assert stamp is not None
        assert before_ns <= stamp <= time.time_ns()
    finally:
        line.end()


def test_a_steady_wall_clock_gives_the_arrival_to_the_nanosecond(clocks: Clocks) -> None:
    arrivals = Arrivals()
    clocks.now_ns += TICK_NS
    assert arrivals.begin() == START_NS
    for after_ns in (0, 1, 7 * MS, TICK_NS):
        assert arrivals.of(ancillary(WALL_NS + START_NS + after_ns)) == START_NS + after_ns
    assert arrivals.of([]) == START_NS
    ((level, kind, value),) = ancillary(WALL_NS + START_NS + 1)
    assert arrivals.of([(level, kind, value[:-1])]) == START_NS


def test_a_stamp_outside_of_the_time_between_two_reads_is_none(clocks: Clocks) -> None:
    """No clock gives it: before the port was seen empty, or after the read began."""
    arrivals = Arrivals()
    clocks.now_ns += TICK_NS
    arrivals.begin()
    assert arrivals.of(ancillary(0)) == START_NS
    assert arrivals.of(ancillary(2 * WALL_NS)) == START_NS + TICK_NS


@given(
    came_ns=st.integers(0, TICK_NS),
    set_ns=st.integers(0, TICK_NS),
    by_ns=st.integers(-(10**10), 10**10),
)
def test_a_wall_clock_that_is_set_never_makes_a_frame_younger(
    came_ns: int, set_ns: int, by_ns: int
) -> None:
    """Forward or backward, before or after the frame: it is older, by a tick at most."""
    clocks = Clocks()
    with pytest.MonkeyPatch.context() as patch:
        clocks.replace(patch)
        arrivals = Arrivals()
        stamp = WALL_NS + START_NS + came_ns + (by_ns if set_ns <= came_ns else 0)
        clocks.now_ns, clocks.ahead_ns = START_NS + TICK_NS, WALL_NS + by_ns
        arrivals.begin()
        assert START_NS <= arrivals.of(ancillary(stamp)) <= START_NS + came_ns
        arrivals.emptied()
        # One read later the clock is what it is, and the arrival is right again.
        clocks.now_ns += TICK_NS
        arrivals.begin()
        stamp = clocks.time_ns() - 3 * MS
        assert arrivals.of(ancillary(stamp)) == clocks.now_ns - 3 * MS


@pytest.mark.parametrize("by_ns", [-(10**9), 10**9])
@pytest.mark.parametrize("set_first", [False, True])
def test_a_clock_set_by_a_second_is_no_second(clocks: Clocks, by_ns: int, set_first: bool) -> None:
    """Each of the four ways: exact where the older offset is the right one, else the last read."""
    arrivals = Arrivals()
    stamp = WALL_NS + START_NS + 15 * MS + (by_ns if set_first else 0)
    clocks.now_ns, clocks.ahead_ns = START_NS + TICK_NS, WALL_NS + by_ns
    arrivals.begin()
    exact = set_first is (by_ns > 0)
    assert arrivals.of(ancillary(stamp)) == START_NS + (15 * MS if exact else 0)


# -- ports on raw sockets --------------------------------------------------------------------------


@pytest.fixture
def line(clocks: Clocks, monkeypatch: pytest.MonkeyPatch) -> Iterator[Line]:
    made = Line()
    monkeypatch.setattr(interface, "time", SimpleNamespace(monotonic_ns=clocks.boottime_ns))
    yield made
    made.end()


def stamped(line: Line, *stamps: int | None) -> None:
    """Let the kernel stamp the next frames so."""
    waiting = list(stamps)
    near, receive = line.near[RECEIVED], line.port._receive
    assert receive == near.recvmsg

    def recvmsg(*sizes: int) -> Any:
        assert sizes == (raw.SIZE, packet.ANCILLARY_BYTES)  # room for a frame and its stamp
        data, _, flags, sender = receive(*sizes)
        stamp = waiting.pop(0)
        return data, [] if stamp is None else ancillary(stamp), flags, sender

    line.port._receive = recvmsg


def test_each_frame_has_its_own_arrival(line: Line, clocks: Clocks) -> None:
    stamped(line, *(WALL_NS + START_NS + after * MS for after in (3, 5, 9)))
    for number in range(3):
        line.put(message(0x100 + number))
    clocks.now_ns += TICK_NS
    assert arrivals_of(line.port) == [3 * MS, 5 * MS, 9 * MS]


def test_without_a_stamp_it_is_the_last_time_that_the_port_was_empty(
    line: Line, clocks: Clocks
) -> None:
    stamped(line, None, None)
    line.put(message(0x100))
    clocks.now_ns += 2 * TICK_NS
    assert arrivals_of(line.port) == [0]
    line.put(message(0x100))
    clocks.now_ns += TICK_NS
    assert arrivals_of(line.port) == [2 * TICK_NS]


def test_a_port_that_was_not_read_to_its_end_was_not_empty(
    line: Line, clocks: Clocks, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(raw, "_EACH_FRAME", range(2))
    stamped(line, *[None] * 5)
    for _ in range(5):
        line.put(message(0x100))
    for after, most in ((0, 2), (0, 2), (0, 1)):
        clocks.now_ns += TICK_NS
        assert arrivals_of(line.port) == [after] * most


def test_a_port_that_failed_was_not_empty(line: Line, clocks: Clocks) -> None:
    stamped(line, None)
    line.put(message(0x100))
    line.near[RECEIVED].fail = OSError(errno.ENETDOWN, "down")
    clocks.now_ns += TICK_NS
    assert arrivals_of(line.port) == []
    line.near[RECEIVED].fail = None
    clocks.now_ns += TICK_NS
    assert arrivals_of(line.port) == [0]


def test_an_interface_that_comes_back_was_empty_before(line: Line, clocks: Clocks) -> None:
    line.put(message(0x100))
    line.near[RECEIVED].fail = OSError(errno.ENODEV, "gone")
    assert arrivals_of(line.port) == []
    clocks.now_ns += REOPEN_NS
    assert arrivals_of(line.port) == []
    stamped(line, None)
    line.put(message(0x100))
    clocks.now_ns += TICK_NS
    assert arrivals_of(line.port) == [REOPEN_NS]


def test_a_port_that_listens_hands_the_arrival_through(line: Line, clocks: Clocks) -> None:
    stamped(line, WALL_NS + START_NS + 4 * MS)
    line.put(message(0x100))
    clocks.now_ns += TICK_NS
    assert arrivals_of(ListeningPort(line.port, IDS)) == [4 * MS]
