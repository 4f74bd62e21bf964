"""Claims of our own node of J1939 that come back to the socket of what is received."""

import errno
from collections.abc import Callable

import can
import pytest

from canshaper.bus.interface import MOST_CLAIMS, PROBE_NS, REOPEN_NS
from canshaper.bus.packet import CLASS_BUS_OFF
from canshaper.codec.frame import BusState, Frame
from canshaper.machine.routing import BusRoutes
from tests.bus.raw_line import IDS, RECEIVED, Line, message

CLAIM = Frame("crane", 0x18EEFF9C, True, bytes(range(8)))
NODE = BusRoutes(
    received=frozenset(),
    sent=IDS.sent,
    valves=IDS.valves,
    known=frozenset(),
    claims=frozenset({(CLAIM.can_id, True)}),
)


def claimed(line: Line, frame: Frame = CLAIM) -> None:
    """It comes to the socket of what is received, as every frame of its group does."""
    line.put(
        can.Message(arbitration_id=frame.can_id, is_extended_id=True, data=frame.data), RECEIVED
    )


def test_a_claim_of_ours_that_comes_back_is_no_claim_of_another(
    make_line: Callable[..., Line],
) -> None:
    line = make_line(NODE)
    for _ in range(5):
        assert line.port.send(CLAIM)
        claimed(line)
        assert line.received() == []
    claimed(line)  # each of ours came back once; this is of one that has our NAME
    assert line.received() == [CLAIM]
    assert line.faults == []


def test_a_frame_behind_a_claim_of_ours_is_received_in_the_same_tick(
    make_line: Callable[..., Line],
) -> None:
    line = make_line(NODE)
    assert line.port.send(CLAIM)
    claimed(line)
    line.put(message(0x110))
    assert [frame.can_id for frame in line.port.frames()] == [0x110]


@pytest.mark.parametrize("gone", [errno.ENETDOWN, errno.ENODEV])
def test_a_claim_that_was_lost_with_its_interface_does_not_come_back(
    make_line: Callable[..., Line], gone: int
) -> None:
    """Of another node that has our NAME it is the next one."""
    line = make_line(NODE)
    assert line.port.send(CLAIM)
    line.near[RECEIVED].fail = OSError(gone, "lost")
    line.put(message(0x110))
    assert line.received() == []
    line.near[RECEIVED].fail = None
    line.now_ns += REOPEN_NS
    line.received()
    claimed(line)
    assert line.received() == [CLAIM]


def test_of_claims_that_do_not_come_back_no_more_than_a_few_are_kept(
    make_line: Callable[..., Line],
) -> None:
    line = make_line(NODE)
    first, *others = [CLAIM._replace(data=bytes([n] * 8)) for n in range(MOST_CLAIMS + 1)]
    for claim in (first, *others):
        assert line.port.send(claim)
    for claim in (first, *others):
        claimed(line, claim)
    assert line.received() == [first]


def test_a_claim_that_comes_back_shows_that_the_bus_takes_frames(
    make_line: Callable[..., Line],
) -> None:
    line = make_line(NODE)
    line.error(CLASS_BUS_OFF)
    line.received()
    assert line.port.state is BusState.BUS_OFF
    line.now_ns += PROBE_NS
    assert line.port.send(CLAIM)
    claimed(line)
    assert line.received() == []
    assert line.port.state is BusState.UP


def test_a_claim_of_another_that_comes_before_ours_is_one(make_line: Callable[..., Line]) -> None:
    line = make_line(NODE)
    other = CLAIM._replace(data=bytes(8))
    assert line.port.send(CLAIM)
    claimed(line, other)
    claimed(line)
    assert line.received() == [other]
