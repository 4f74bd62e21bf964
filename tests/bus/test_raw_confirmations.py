"""Our own frames under way on raw sockets: confirmed, late, or never."""

import errno

import pytest

from canshaper.bus import raw
from canshaper.bus.interface import PROBE_NS
from canshaper.bus.packet import SIZE
from canshaper.codec.frame import BusState, FrameFault
from tests.bus.raw_line import (
    IDS,
    MARK_AT,
    OTHER,
    RECEIVED,
    SENT_BACK,
    STATUS,
    TICK_NS,
    VALVE,
    Line,
    message,
)

BUS_OFF, RESTARTED = 0x40, 0x100


def test_own_frames_are_not_handed_on_but_those_of_another_sender_are(line: Line) -> None:
    line.port.send(VALVE)
    line.confirm(VALVE)
    assert line.received() == []
    line.put(message(VALVE.can_id, VALVE.data), SENT_BACK)
    assert line.received() == [VALVE]


@pytest.mark.parametrize("size", [MARK_AT + 1, SIZE - 1])
def test_a_confirmation_that_is_not_whole_is_counted_and_confirms_nothing(
    line: Line, size: int
) -> None:
    for _ in range(3):
        line.now_ns += TICK_NS
        line.port.send(VALVE)
        line.confirm(VALVE, size)
    assert line.received() == []
    assert line.faults == [FrameFault.WRONG_LENGTH] * 3
    assert line.unconfirmed() == 0


def test_frames_of_another_sender_confirm_nothing(line: Line) -> None:
    for _ in range(3):
        line.now_ns += TICK_NS
        line.port.send(VALVE)
        line.put(message(VALVE.can_id, VALVE.data), SENT_BACK)
        line.received()
    assert line.unconfirmed() == 0
    assert line.port.state is BusState.NOT_CONFIRMED


def test_confirmed_frames_can_be_sent_for_ever(line: Line) -> None:
    for _ in range(500):
        line.now_ns += TICK_NS
        for frame in (VALVE, OTHER):
            assert line.port.send(frame)
            line.confirm(frame)
        assert line.received() == []
        assert len(line.sent()) == 2
    assert line.port.state is BusState.UP
    assert line.faults == []


@pytest.mark.parametrize(("late", "waited"), [(1, 0), (2, 498)])
def test_a_valves_frame_that_waits_for_longer_than_its_cycle_is_counted(
    line: Line, late: int, waited: int
) -> None:
    """The port learns behind the tick what the kernel has sent; a status message may wait."""
    for tick in range(500):
        line.now_ns += TICK_NS
        for frame in (VALVE, STATUS):
            assert line.port.send(frame)
        line.sent()
        if tick >= late:
            for frame in (VALVE, STATUS):
                line.confirm(frame)
        assert line.received() == []
    assert line.port.waited == waited
    assert line.faults == []


def test_a_fast_loop_on_a_slow_bus_is_no_fault(line: Line) -> None:
    """A tick of 1 ms, and confirmations that take 15."""
    for tick in range(500):
        line.now_ns += 1_000_000
        assert line.port.send(VALVE)
        line.sent()
        if tick >= 15:
            line.confirm(VALVE)
        assert line.received() == []
    assert line.faults == []


def test_of_several_frames_under_way_a_confirmation_confirms_one(line: Line) -> None:
    """Two on their way, one confirmed: only two more may follow the one that is left."""
    assert line.unconfirmed(most=2) == 2
    line.confirm(VALVE)
    line.received()
    assert line.unconfirmed() == 2


def test_a_bus_that_takes_no_frames_gets_no_more(line: Line) -> None:
    assert line.unconfirmed() == 3
    assert line.port.state is BusState.NOT_CONFIRMED
    assert line.faults == [FrameFault.NOT_CONFIRMED]
    until_ns = line.now_ns + PROBE_NS - 2 * TICK_NS
    while line.now_ns < until_ns:
        assert line.unconfirmed() == line.unconfirmed(OTHER) == line.unconfirmed(STATUS) == 0
    assert line.sent() == []
    assert line.faults == [FrameFault.NOT_CONFIRMED]


def test_a_confirmation_of_another_id_confirms_nothing(line: Line) -> None:
    extended = VALVE._replace(extended=True)
    for _ in range(2):
        line.now_ns += TICK_NS
        assert line.port.send(VALVE)
        line.confirm(OTHER)
        line.confirm(extended)
        line.received()
    assert line.unconfirmed() == 1
    assert line.port.state is BusState.NOT_CONFIRMED


def test_confirmations_without_a_frame_are_no_credit(line: Line) -> None:
    """They come for what was sent before it was given up."""
    for _ in range(5):
        line.confirm(VALVE)
    line.received()
    assert line.unconfirmed() == 3


def test_a_blocked_bus_is_tried_with_one_frame_at_a_time(line: Line) -> None:
    line.unconfirmed()
    for _ in range(5):
        line.now_ns += PROBE_NS
        tries = [line.port.send(f) for f in (VALVE, OTHER, STATUS, VALVE)]
        assert tries == [True, False, False, False]
        assert len(line.sent()) == 1
        assert line.port.state is BusState.NOT_CONFIRMED
    assert set(line.faults) == {FrameFault.NOT_CONFIRMED}


def test_a_probe_that_comes_back_opens_the_bus(line: Line) -> None:
    line.unconfirmed()
    line.now_ns += PROBE_NS
    assert line.port.send(VALVE)
    line.confirm(VALVE)
    line.received()
    assert line.port.state is BusState.UP
    assert line.unconfirmed() == line.unconfirmed(OTHER) + 3 == 3


def test_a_late_confirmation_opens_the_bus_before_the_next_probe(line: Line) -> None:
    line.unconfirmed()
    line.confirm(VALVE)
    line.received()
    assert line.port.state is BusState.UP
    assert line.unconfirmed() == 3


def test_a_status_message_that_starves_holds_up_no_valve(line: Line) -> None:
    """It has the lowest priority; on a bus that is full of others the valves still get through."""
    assert line.unconfirmed(STATUS) == 3
    assert line.faults == [FrameFault.NOT_CONFIRMED]
    for _ in range(10):
        line.now_ns += TICK_NS
        assert line.port.send(VALVE)
        line.confirm(VALVE)
        assert not line.port.send(STATUS)  # and no more of them wait
        line.received()
    assert line.port.state is BusState.UP
    line.confirm(STATUS)
    line.received()
    line.now_ns += TICK_NS
    assert line.port.send(STATUS)


def test_a_status_message_that_a_driver_has_dropped_is_tried_again(line: Line) -> None:
    """Without an echo it would wait for ever."""
    line.unconfirmed(STATUS)
    refused = 0
    while not line.port.send(STATUS):
        line.now_ns += TICK_NS
        refused += 1
        assert refused < 100
    assert (refused - 2) * TICK_NS <= PROBE_NS
    assert line.unconfirmed(STATUS) == 2  # and the one that was just sent


def test_another_deployment_begins_without_the_frames_of_the_last(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their confirmations may be filtered away. Filters need CAN: they are set in tests/hil."""
    monkeypatch.setattr(raw, "set_filters", lambda _sockets, _ids: None)
    for _ in range(10):
        line.now_ns += TICK_NS
        assert line.port.send(VALVE)
        line.port.watch("other", IDS)
    line.put(message(0x110))
    assert [f.bus for f in line.received()] == ["other"]


def test_nor_does_it_count_how_long_those_were_under_way(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fast loop sends three frames before the first one is confirmed."""
    monkeypatch.setattr(raw, "set_filters", lambda _sockets, _ids: None)
    assert line.unconfirmed(most=2) == 2
    line.now_ns += PROBE_NS
    line.port.watch("other", IDS)
    for _ in range(5):
        line.now_ns += 1_000_000
        assert line.port.send(VALVE)


@pytest.mark.parametrize("end", ["bus-off", "down"])
def test_a_valve_frame_that_the_bus_has_lost_is_never_confirmed(line: Line, end: str) -> None:
    line.port.send(VALVE)
    if end == "bus-off":
        line.error(BUS_OFF)
    else:
        line.near[RECEIVED].fail = OSError(errno.ENETDOWN, "down")
        line.put(message(0x110))
    line.received()
    assert line.port.confirmed is False
    line.error(RESTARTED)  # it is gone, though the bus is back
    line.received()
    assert line.port.confirmed is False
    line.port.send(VALVE)
    line.confirm(VALVE)
    line.received()
    assert line.port.confirmed
