"""The port on raw sockets when its interface goes down or away."""

import errno
import socket
from collections.abc import Callable

import pytest

from canshaper.bus.interface import PROBE_NS, REOPEN_NS
from canshaper.codec.frame import BusState, FrameFault
from canshaper.errors import WrongDeviceError
from canshaper.machine.routing import BusRoutes
from tests.bus.raw_line import (
    IDS,
    RECEIVED,
    SENT_BACK,
    TICK_NS,
    UNKNOWN,
    VALVE,
    Line,
    message,
    port_on,
)


def down(line: Line) -> None:
    """Both directions of every socket fail; a real one would be readable for its error."""
    for near in line.near:
        near.fail = OSError(errno.ENETDOWN, "down")
    line.put(message(0x110))
    assert line.received() == []


def up(line: Line) -> None:
    for near in line.near:
        near.fail = None


def test_an_interface_that_is_down_is_reported_once_and_used_again(line: Line) -> None:
    line.unconfirmed(most=2)
    down(line)
    for _ in range(10):
        assert not line.port.send(VALVE)
    assert line.port.state is BusState.DOWN
    assert line.faults == [FrameFault.BUS_DOWN]
    up(line)
    assert line.port.send(VALVE)
    line.confirm(VALVE)
    line.received()
    assert line.port.state is BusState.UP
    assert line.unconfirmed() == 3  # what was in the queue is gone and will not be confirmed


def test_an_interface_on_which_nothing_is_sent_is_up_with_the_first_frame(line: Line) -> None:
    """Joysticks on one bus, valves on another."""
    down(line)
    assert line.port.state is BusState.DOWN
    up(line)
    line.put(message(0x111))
    assert {f.can_id for f in line.received()} == {0x110, 0x111}
    assert line.port.state is BusState.UP


@pytest.mark.parametrize("code", [errno.ENODEV, errno.ENXIO, errno.EBADF])
@pytest.mark.parametrize("seen", [RECEIVED, SENT_BACK, UNKNOWN, "sending"])
def test_an_interface_that_is_gone_is_opened_again_as_soon_as_it_is_back(
    line: Line, seen: int | str, code: int
) -> None:
    line.unconfirmed()
    ends = line.near
    number = seen if isinstance(seen, int) else SENT_BACK
    line.put(message(0x110), number)
    ends[number].fail = OSError(code, "gone")
    line.now_ns += PROBE_NS
    if seen == "sending":
        assert not line.port.send(VALVE)
    else:
        assert line.received() == []
    assert (line.port.state, line.port.why) == (BusState.GONE, "")
    assert line.faults[1:] == [FrameFault.BUS_GONE]
    assert [end.fileno() for end in ends] == [-1] * 3
    assert line.port.fileno() == -1
    line.refuse = OSError(errno.ENODEV, "no such device")
    for _ in range(100):
        line.now_ns += TICK_NS
        assert line.received() == []
        assert not line.port.send(VALVE)
    assert len(line.opened_with) == 1 + 100 * TICK_NS // REOPEN_NS
    assert line.faults[2:] == []
    line.refuse = None
    line.now_ns += REOPEN_NS
    assert line.received() == []
    assert line.port.state is BusState.UP
    assert line.opened_with == [IDS] * len(line.opened_with)
    line.put(message(0x110))
    assert len(line.received()) == 1
    assert line.unconfirmed() == 3


@pytest.mark.parametrize("number", [RECEIVED, SENT_BACK, UNKNOWN])
def test_a_socket_that_was_closed_under_the_port_is_replaced(line: Line, number: int) -> None:
    """The real thing: the kernel answers EBADF."""
    line.near[number].close()
    assert line.received() == []
    assert line.port.state is BusState.GONE
    line.now_ns += REOPEN_NS
    line.received()
    assert line.port.send(VALVE)
    assert len(line.sent()) == 1


def test_a_bus_that_cannot_be_opened_is_no_port() -> None:
    def refuse(_ids: BusRoutes | None) -> list[socket.socket]:
        raise OSError(errno.ENODEV, "no such device")

    with pytest.raises(OSError, match="no such device"):
        port_on(refuse, None, lambda _fault: None)


# -- a deployment that names the device ------------------------------------------------------------

WRONG = WrongDeviceError("expected serial number 1, but can0 has serial number 2")


@pytest.fixture
def matched(make_line: Callable[..., Line]) -> Line:
    return make_line(matched=True)


def later(line: Line) -> None:
    """One try to open it again."""
    line.now_ns += REOPEN_NS
    assert line.received() == []


def gone(line: Line) -> None:
    line.put(message(0x110))
    line.near[RECEIVED].fail = OSError(errno.ENODEV, "gone")
    assert line.received() == []


@pytest.mark.parametrize("away", [gone, down])
def test_another_device_under_the_name_is_not_used(
    matched: Line, away: Callable[[Line], None]
) -> None:
    """However long it is there: nothing is sent or received until the right one is back."""
    away(matched)
    reported = [FrameFault.BUS_GONE if away is gone else FrameFault.BUS_DOWN]
    assert matched.faults == reported
    matched.refuse = WRONG
    far = matched.far
    far[RECEIVED].setblocking(False)
    for _ in range(100):
        matched.now_ns += TICK_NS
        assert matched.received() == []
        assert not matched.port.send(VALVE)
        assert matched.port.fileno() == -1
    assert matched.port.state is BusState.WRONG_DEVICE
    assert matched.faults == [*reported, FrameFault.BUS_WRONG_DEVICE]
    assert len(matched.opened_with) == 1 + 100 * TICK_NS // REOPEN_NS
    matched.refuse = None
    later(matched)
    assert matched.port.state is BusState.UP
    assert matched.port.send(VALVE)
    assert len(matched.sent()) == 1
    matched.put(message(0x110))
    assert len(matched.received()) == 1
    assert matched.faults == [*reported, FrameFault.BUS_WRONG_DEVICE]


def test_a_matched_interface_that_is_down_is_opened_again_and_reported_once(matched: Line) -> None:
    """Name and bit rate may be others when it is back; whether it is up, only its frames say."""
    down(matched)
    assert matched.port.fileno() == -1
    assert not matched.port.send(VALVE)
    for _ in range(3):  # opened, and still down
        matched.now_ns += REOPEN_NS
        assert [*matched.port.frames()] == []
        down(matched)
    assert matched.port.state is BusState.DOWN
    assert matched.faults == [FrameFault.BUS_DOWN]
    later(matched)
    assert matched.port.state is BusState.DOWN
    assert matched.port.send(VALVE)
    matched.confirm(VALVE)
    matched.received()
    assert matched.port.state is BusState.UP


def test_a_matched_interface_is_not_tried_in_every_tick(matched: Line) -> None:
    down(matched)
    matched.now_ns += REOPEN_NS - 1
    assert matched.received() == []
    assert len(matched.opened_with) == 1


def test_a_bus_that_was_blocked_is_tried_at_once_when_it_is_back(matched: Line) -> None:
    matched.unconfirmed()
    gone(matched)
    later(matched)
    assert matched.port.send(VALVE)


def test_what_comes_after_a_wrong_device_is_reported(matched: Line) -> None:
    gone(matched)
    matched.refuse = WRONG
    later(matched)
    matched.refuse = OSError(errno.EMFILE, "too many files")  # says nothing of the device
    later(matched)
    assert matched.port.state is BusState.WRONG_DEVICE
    matched.refuse = OSError(errno.ENODEV, "no such device")
    later(matched)
    assert matched.port.state is BusState.GONE
    matched.refuse = WRONG
    later(matched)
    assert matched.port.state is BusState.WRONG_DEVICE
    assert matched.faults == [
        FrameFault.BUS_GONE,
        FrameFault.BUS_WRONG_DEVICE,
        FrameFault.BUS_GONE,
        FrameFault.BUS_WRONG_DEVICE,
    ]


def test_a_try_that_fails_for_another_reason_waits_for_the_next(matched: Line) -> None:
    gone(matched)
    matched.refuse = OSError(errno.EMFILE, "too many files")
    later(matched)
    assert matched.received() == []
    assert len(matched.opened_with) == 2


def test_a_closed_port_does_nothing_more(line: Line) -> None:
    line.port.close()
    line.port.close()
    line.now_ns += 10 * REOPEN_NS
    assert line.received() == []
    assert not line.port.send(VALVE)
    assert line.port.fileno() == -1
    assert len(line.opened_with) == 1


def test_an_interface_that_goes_while_another_deployment_begins_is_a_fault(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: object) -> None:
        raise OSError(errno.ENODEV, "No such device")

    monkeypatch.setattr("canshaper.bus.raw.set_filters", gone)
    line.port.watch("second", IDS)
    assert line.port.name == "second"
    assert line.port.state is BusState.GONE
    line.port.watch("third", IDS)  # without a socket there is nothing to set
    assert line.port.name == "third"
