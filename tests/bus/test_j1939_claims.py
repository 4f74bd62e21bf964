"""Claims of a port whose groups of J1939 come to the socket of what is received."""

import errno
from collections.abc import Iterator
from typing import Any

import pytest

from canshaper.bus.socketcan import MOST_FILTERS, set_filters
from canshaper.codec.frame import CLAIMED, BusState, Frame, claims_of
from canshaper.machine.routing import BusRoutes
from tests.bus.raw_line import IDS, VALVE, Line, message

OWN = 0x9C
CLAIM = Frame("crane", 0x18EEFF9C, True, bytes(range(8)))
CLAIMING = BusRoutes(
    IDS.received,
    IDS.sent,
    IDS.valves,
    IDS.known,
    received_groups=frozenset((CLAIMED << 8,)),
    claims=frozenset((i, True) for i in claims_of(OWN)),
    j1939=True,
)


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Iterator[Line]:
    opened = Line(CLAIMING)
    monkeypatch.setattr("canshaper.bus.raw.time.monotonic_ns", opened.monotonic_ns)
    yield opened
    opened.end()
    opened.port.close()


def come(line: Line, frame: Frame) -> None:
    line.put(message(frame.can_id, frame.data, extended=True))


def test_our_own_claim_seen_back_is_accepted_and_that_of_a_twin_is_not(line: Line) -> None:
    for _ in range(5):
        assert line.port.send(CLAIM)
        come(line, CLAIM)
        assert line.received() == []
    come(line, CLAIM)  # six, and we have sent five: a node that was set up alike
    assert line.received() == [CLAIM]
    assert line.faults == []


def test_the_claim_of_another_name_is_handed_out(line: Line) -> None:
    assert line.port.send(CLAIM)
    other = CLAIM._replace(data=bytes(8))
    come(line, other)
    come(line, CLAIM)
    assert line.received() == [other]


def test_a_blocked_bus_is_up_again_when_a_claim_got_through(line: Line) -> None:
    """While the address is not ours, claims are all that is sent."""
    assert line.unconfirmed(VALVE) < 10
    assert line.port.state is BusState.NOT_CONFIRMED
    line.now_ns += 600_000_000
    assert line.port.send(CLAIM)
    assert line.received() == []
    assert line.port.state is BusState.NOT_CONFIRMED
    come(line, CLAIM)
    assert line.received() == []
    assert line.port.state is BusState.UP


def test_claims_emptied_from_the_queue_do_not_hide_a_twin(line: Line) -> None:
    assert line.port.send(CLAIM)
    line.near[1].fail = OSError(errno.ENETDOWN, "")
    assert not line.port.send(CLAIM)
    line.near[1].fail = None
    come(line, CLAIM)
    assert line.received() == [CLAIM]


def test_more_groups_and_ids_than_the_kernel_has_filters_for() -> None:
    class Options:
        def __init__(self) -> None:
            self.filters = b""

        def setsockopt(self, _level: int, _name: int, value: bytes) -> None:
            self.filters = value

    known = frozenset((i, False) for i in range(505)) | frozenset((i, True) for i in range(600))
    sockets: Any = [Options() for _ in range(3)]
    groups = frozenset(0xFE0000 + (i << 8) for i in range(20))
    ids = BusRoutes(frozenset(), frozenset(), frozenset(), known, groups, groups, j1939=True)
    set_filters(sockets, ids)
    for one in sockets:
        assert len(one.filters) // 8 <= MOST_FILTERS
