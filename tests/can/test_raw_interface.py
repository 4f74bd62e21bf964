"""The port on raw sockets when its interface goes down or away."""

import errno
import socket
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from canshaper.can import raw
from canshaper.can.frame import BusState, FrameFault
from canshaper.can.raw import PROBE_NS, REOPEN_NS, RawPort
from canshaper.can.socketcan import Ids
from tests.can.raw_line import (
    IDS,
    SENT_BACK,
    TAKEN,
    TICK_NS,
    UNKNOWN,
    VALVE,
    Line,
    message,
)


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


def down(line: Line) -> None:
    """Both directions of every socket fail; a real one would be readable for its error."""
    for near in line.near:
        near.fail = OSError(errno.ENETDOWN, "down")
    line.put(message(0x110))
    assert line.heard() == []


def up(line: Line) -> None:
    for near in line.near:
        near.fail = None


def test_an_interface_that_is_down_is_told_once_and_used_again(line: Line) -> None:
    line.unconfirmed(most=2)
    down(line)
    for _ in range(10):
        assert not line.port.send(VALVE)
    assert line.port.state is BusState.DOWN
    assert line.faults == [FrameFault.BUS_DOWN]
    up(line)
    assert line.port.send(VALVE)
    line.confirm(VALVE)
    line.heard()
    assert line.port.state is BusState.UP
    assert line.unconfirmed() == 3  # what was in the queue is gone and will not be confirmed


def test_an_interface_on_which_nothing_is_sent_is_up_with_the_first_frame(line: Line) -> None:
    """Levers on one bus, valves on another."""
    down(line)
    assert line.port.state is BusState.DOWN
    up(line)
    line.put(message(0x111))
    assert {f.can_id for f in line.heard()} == {0x110, 0x111}
    assert line.port.state is BusState.UP


@pytest.mark.parametrize("code", [errno.ENODEV, errno.ENXIO, errno.EBADF])
@pytest.mark.parametrize("seen", [TAKEN, SENT_BACK, UNKNOWN, "sending"])
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
        assert line.heard() == []
    assert line.port.state is BusState.GONE
    assert line.faults[1:] == [FrameFault.BUS_GONE]
    assert [end.fileno() for end in ends] == [-1] * 3
    assert line.port.fileno() == -1
    line.refuse = OSError(errno.ENODEV, "no such device")
    for _ in range(100):
        line.now_ns += TICK_NS
        assert line.heard() == []
        assert not line.port.send(VALVE)
    assert len(line.asked) == 1 + 100 * TICK_NS // REOPEN_NS
    assert line.faults[2:] == []
    line.refuse = None
    line.now_ns += REOPEN_NS
    assert line.heard() == []
    assert line.port.state is BusState.UP
    assert line.asked == [IDS] * len(line.asked)
    line.put(message(0x110))
    assert len(line.heard()) == 1
    assert line.unconfirmed() == 3


@pytest.mark.parametrize("number", [TAKEN, SENT_BACK, UNKNOWN])
def test_a_socket_that_was_closed_under_the_port_is_replaced(line: Line, number: int) -> None:
    """The real thing: the kernel answers EBADF."""
    line.near[number].close()
    assert line.heard() == []
    assert line.port.state is BusState.GONE
    line.now_ns += REOPEN_NS
    line.heard()
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
    assert line.heard() == []
    assert not line.port.send(VALVE)
    assert line.port.fileno() == -1
    assert len(line.asked) == 1
