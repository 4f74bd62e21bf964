"""The port on raw sockets when frames do not get onto the bus, and when the interface goes."""

import errno
import socket
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from canshaper.can import raw
from canshaper.can.frame import BusState, FrameFault
from canshaper.can.raw import PROBE_NS, REOPEN_NS, RawPort
from canshaper.can.socketcan import Ids
from tests.can.raw_line import NOTHING, OTHER, VALVE, Line, message

# linux/can/error.h
BUS_OFF, RESTARTED, CONTROLLER = 0x40, 0x100, 0x4
RX_PASSIVE, TX_PASSIVE, ACTIVE, TX_WARNING = 0x10, 0x20, 0x40, 0x08


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


# -- confirmations ---------------------------------------------------------------------------------


def test_without_confirmations_nothing_is_said_about_the_bus(
    make_line: Callable[..., Line],
) -> None:
    line = make_line(confirms=False)
    assert line.unconfirmed(most=500) == 500
    assert line.port.state is BusState.UP


def test_own_frames_are_not_handed_on_but_those_of_another_sender_are(line: Line) -> None:
    line.port.send(VALVE)
    line.confirm(VALVE)
    assert list(line.port.frames()) == []
    line.put(message(VALVE.can_id, VALVE.data))
    assert list(line.port.frames()) == [VALVE]


def test_confirmed_frames_can_be_sent_for_ever(line: Line) -> None:
    for _ in range(500):
        assert line.port.send(VALVE)
        assert line.port.send(OTHER)
        for frame in (VALVE, OTHER):
            line.confirm(frame)
        assert list(line.port.frames()) == []
        assert len(line.sent()) == 2
    assert line.port.state is BusState.UP
    assert line.faults == []


def test_a_confirmation_may_come_two_ticks_late(line: Line) -> None:
    for tick in range(500):
        assert line.port.send(VALVE)
        line.sent()
        if tick >= 2:
            line.confirm(VALVE)
        assert list(line.port.frames()) == []
    assert line.faults == []


def test_frames_that_do_not_get_onto_the_bus_are_queued_three_times_at_most(line: Line) -> None:
    assert line.unconfirmed() == 3
    assert line.port.state is BusState.NOT_CONFIRMED
    assert line.faults == [FrameFault.NOT_CONFIRMED]
    for _ in range(24):
        line.now_ns += 20_000_000
        assert line.unconfirmed() == line.unconfirmed(OTHER) == 0
    assert line.faults == [FrameFault.NOT_CONFIRMED]


def test_a_confirmation_of_another_id_confirms_nothing(line: Line) -> None:
    extended = VALVE._replace(extended=True)
    for _ in range(2):
        assert line.port.send(VALVE)
        line.confirm(OTHER)
        line.confirm(extended)
        list(line.port.frames())
    assert line.unconfirmed() == 1
    assert line.port.state is BusState.NOT_CONFIRMED


def test_confirmations_without_a_frame_are_no_credit(line: Line) -> None:
    for _ in range(5):
        line.confirm(VALVE)
    list(line.port.frames())
    assert line.unconfirmed() == 3


def test_a_blocked_bus_is_tried_with_one_frame_of_an_id_at_a_time(line: Line) -> None:
    line.unconfirmed()
    for _ in range(5):
        line.now_ns += PROBE_NS
        assert line.unconfirmed() == 1
        assert line.port.state is BusState.NOT_CONFIRMED
    assert set(line.faults) == {FrameFault.NOT_CONFIRMED}


def test_a_probe_that_comes_back_opens_the_bus(line: Line) -> None:
    line.unconfirmed()
    line.now_ns += PROBE_NS
    assert line.port.send(VALVE)
    line.confirm(VALVE)
    list(line.port.frames())
    assert line.port.state is BusState.UP
    assert line.unconfirmed() == 3


def test_a_late_confirmation_opens_the_bus_before_the_next_probe(line: Line) -> None:
    line.unconfirmed()
    for _ in range(3):
        line.confirm(VALVE)
    list(line.port.frames())
    assert line.port.state is BusState.UP
    assert line.unconfirmed() == 3


# -- the controller --------------------------------------------------------------------------------


def test_bus_off_sends_nothing_more(line: Line) -> None:
    line.error(BUS_OFF)
    assert list(line.port.frames()) == []
    assert line.port.state is BusState.BUS_OFF
    assert line.faults == [FrameFault.BUS_OFF]
    for _ in range(24):
        line.now_ns += 20_000_000
        assert line.unconfirmed() == 0
    assert line.sent() == []


@pytest.mark.parametrize(("kind", "data"), [(RESTARTED, 0), (CONTROLLER, ACTIVE)])
def test_a_restarted_controller_sends_at_once(line: Line, kind: int, data: int) -> None:
    line.error(BUS_OFF)
    line.error(kind, data)
    assert list(line.port.frames()) == []
    assert line.port.state is BusState.UP
    assert line.unconfirmed() == 3


def test_a_controller_that_restarts_unseen_is_found_by_a_probe(line: Line) -> None:
    line.error(BUS_OFF)
    list(line.port.frames())
    line.now_ns += PROBE_NS
    assert line.port.send(VALVE)
    line.confirm(VALVE)
    list(line.port.frames())
    assert line.port.state is BusState.UP


@pytest.mark.parametrize("passive", [RX_PASSIVE, TX_PASSIVE, RX_PASSIVE | TX_PASSIVE])
@pytest.mark.parametrize("better", [ACTIVE, TX_WARNING])
def test_a_passive_controller_still_sends(line: Line, passive: int, better: int) -> None:
    line.error(CONTROLLER, passive)
    list(line.port.frames())
    assert line.port.state is BusState.PASSIVE
    assert line.faults == [FrameFault.BUS_PASSIVE]
    assert line.port.send(VALVE)
    line.error(CONTROLLER, better)
    list(line.port.frames())
    assert line.port.state is BusState.UP


def test_passive_is_less_than_bus_off_and_than_not_confirmed(line: Line) -> None:
    """A node that is alone on its bus is passive because nobody acknowledges its frames."""
    line.unconfirmed()
    line.error(CONTROLLER, TX_PASSIVE)
    list(line.port.frames())
    assert line.port.state is BusState.NOT_CONFIRMED
    line.error(BUS_OFF)
    line.error(CONTROLLER, TX_PASSIVE)
    list(line.port.frames())
    assert line.port.state is BusState.BUS_OFF
    assert line.unconfirmed() == 0


# -- the interface ---------------------------------------------------------------------------------


def test_an_interface_that_is_down_is_told_once_and_used_again(line: Line) -> None:
    line.unconfirmed(most=2)
    line.near[0].fail = OSError(errno.ENETDOWN, "down")
    assert list(line.port.frames()) == []
    for _ in range(10):
        assert not line.port.send(VALVE)
    assert line.port.state is BusState.DOWN
    assert line.faults == [FrameFault.BUS_DOWN]
    line.near[0].fail = None
    assert line.port.send(VALVE)
    line.confirm(VALVE)
    list(line.port.frames())
    assert line.port.state is BusState.UP
    assert line.unconfirmed() == 3  # what was in the queue is gone and will not be confirmed


def test_an_interface_that_is_up_again_is_seen_by_any_frame(line: Line) -> None:
    line.near[0].fail = OSError(errno.ENETDOWN, "down")
    list(line.port.frames())
    line.near[0].fail = None
    line.put(message(0x110))
    assert len(list(line.port.frames())) == 1
    assert line.port.state is BusState.UP


@pytest.mark.parametrize("code", [errno.ENODEV, errno.ENXIO, errno.EBADF])
@pytest.mark.parametrize("seen", ["receiving", "receiving unknown ids", "sending"])
def test_an_interface_that_is_gone_is_opened_again_as_soon_as_it_is_back(
    make_line: Callable[..., Line], seen: str, code: int
) -> None:
    line = make_line(2)
    line.unconfirmed()
    ends = line.near
    ends[seen == "receiving unknown ids"].fail = OSError(code, "gone")
    line.now_ns += PROBE_NS
    if seen == "sending":
        assert not line.port.send(VALVE)
    else:
        assert list(line.port.frames()) == []
    assert line.port.state is BusState.GONE
    assert line.faults[1:] == [FrameFault.BUS_GONE]
    assert [end.fileno() for end in ends] == [-1, -1]
    assert line.port.fileno() == -1
    line.refuse = OSError(errno.ENODEV, "no such device")
    for _ in range(100):
        line.now_ns += 20_000_000
        assert list(line.port.frames()) == []
        assert not line.port.send(VALVE)
    assert len(line.asked) == 1 + 100 * 20_000_000 // REOPEN_NS
    assert line.faults[2:] == []
    line.refuse = None
    line.now_ns += REOPEN_NS
    assert list(line.port.frames()) == []
    assert line.port.state is BusState.UP
    assert line.asked == [NOTHING] * len(line.asked)
    line.put(message(0x110))
    assert len(list(line.port.frames())) == 1
    assert line.unconfirmed() == 3


def test_a_socket_that_was_closed_under_the_port_is_replaced(line: Line) -> None:
    """The real thing: the kernel answers EBADF."""
    line.near[0].close()
    assert list(line.port.frames()) == []
    assert line.port.state is BusState.GONE
    line.now_ns += REOPEN_NS
    list(line.port.frames())
    assert line.port.send(VALVE)
    assert len(line.sent()) == 1


def test_a_bus_that_cannot_be_opened_is_no_port() -> None:
    def refuse(_ids: Ids | None) -> list[socket.socket]:
        raise OSError(errno.ENODEV, "no such device")

    with pytest.raises(OSError, match="no such device"):
        RawPort("crane", refuse, None, lambda _fault: None, confirms=False)


def test_a_closed_port_does_nothing_more(line: Line) -> None:
    line.port.close()
    line.port.close()
    line.now_ns += 10 * REOPEN_NS
    assert list(line.port.frames()) == []
    assert not line.port.send(VALVE)
    assert line.port.fileno() == -1
    assert len(line.asked) == 1
