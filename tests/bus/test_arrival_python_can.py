"""When a frame of python-can arrived: right after the read before."""

import can
import pytest

from canshaper.bus.port import Port, open_port
from canshaper.bus.python_can import MOST_FAILURES, PythonCanPort
from canshaper.bus.raw import MOST_FRAMES
from canshaper.codec.frame import Frame
from canshaper.config.bus import Bus
from tests.bus.clocks import Clocks, arrivals_of
from tests.bus.raw_line import TICK_NS


class Adapter:
    """An interface whose frames come when the test puts them; an exception is raised."""

    def __init__(self) -> None:
        self.waiting: list[can.Message | Exception] = []

    def recv(self, _timeout: float) -> can.Message | None:
        one = self.waiting.pop(0) if self.waiting else None
        if isinstance(one, Exception):
            raise one
        return one

    def put(self, frames: int = 1) -> None:
        # Its own time is of whatever clock, and not looked at.
        self.waiting += [can.Message(arbitration_id=0x110, timestamp=9e9)] * frames


@pytest.fixture
def adapter(clocks: Clocks, monkeypatch: pytest.MonkeyPatch) -> Adapter:
    made = Adapter()
    monkeypatch.setattr(can, "Bus", lambda **_options: made)
    return made


@pytest.fixture
def port(adapter: Adapter) -> Port:
    made = open_port("crane", Bus(interface="virtual", channel="x"), lambda _fault: None)
    assert isinstance(made, PythonCanPort)
    return made


def test_a_frame_of_python_can_arrived_right_after_the_read_before(
    adapter: Adapter, port: Port, clocks: Clocks
) -> None:
    """The first after the opening of the port, then each after the last read that returned none."""
    before = 0
    for passed_ns in (3 * TICK_NS, TICK_NS, 5 * TICK_NS):
        adapter.put(2)
        clocks.now_ns += passed_ns
        assert arrivals_of(port) == [before] * 2
        before += passed_ns
    clocks.now_ns += TICK_NS
    assert arrivals_of(port) == []
    adapter.put()
    assert arrivals_of(port) == [before + TICK_NS]


def test_python_can_that_was_not_read_to_its_end_was_not_empty(
    adapter: Adapter, port: Port, clocks: Clocks
) -> None:
    adapter.put(MOST_FRAMES + 1)
    for count in (MOST_FRAMES, 1):
        clocks.now_ns += TICK_NS
        assert arrivals_of(port) == [0] * count
    adapter.waiting = [OSError("gone")] * MOST_FAILURES
    clocks.now_ns += TICK_NS
    assert arrivals_of(port) == []
    adapter.put()
    clocks.now_ns += TICK_NS
    assert arrivals_of(port) == [2 * TICK_NS]


def test_the_frame_itself_is_as_before(adapter: Adapter, port: Port) -> None:
    adapter.put()
    assert list(port.frames()) == [Frame("crane", 0x110, True, b"")]
