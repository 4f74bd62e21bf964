"""A bus of python-can: whatever its interface raises, the loop goes on."""

from collections.abc import Iterator
from typing import Any

import can
import pytest

from canshaper.bus.port import MOST_FAILURES, Port, open_port
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.config.bus import Bus

KINDS = (can.CanOperationError("lost"), OSError("gone"), ValueError("t1"), IndexError("t12"))
FRAME = Frame("crane", 0x110, False, b"\1\2")


class Adapter:
    """An interface that hands out or raises what it is given, and then fails as it is told."""

    def __init__(self) -> None:
        self.found: list[can.Message | Exception] = []
        self.always: Exception | None = None

    def recv(self, _timeout: float) -> can.Message | None:
        one = self.found.pop(0) if self.found else self.always
        if isinstance(one, Exception):
            raise one
        return one

    def send(self, _message: can.Message) -> None:
        if self.always:
            raise self.always

    def shutdown(self) -> None:
        if self.always:
            raise self.always

    def fileno(self) -> Any:
        raise NotImplementedError("fileno is not implemented")


@pytest.fixture
def adapter(monkeypatch: pytest.MonkeyPatch) -> Adapter:
    made = Adapter()
    monkeypatch.setattr(can, "Bus", lambda **_options: made)
    return made


@pytest.fixture
def faults() -> list[FrameFault]:
    return []


@pytest.fixture
def port(adapter: Adapter, faults: list[FrameFault]) -> Iterator[Port]:
    yield open_port("crane", Bus(interface="slcan", channel="/dev/ttyUSB0"), faults.append)
    adapter.always = None


def received(frame: Frame) -> can.Message:
    return can.Message(arbitration_id=frame.can_id, is_extended_id=frame.extended, data=frame.data)


@pytest.mark.parametrize("error", KINDS)
def test_a_garbled_line_costs_that_line_only(
    adapter: Adapter, port: Port, faults: list[FrameFault], error: Exception
) -> None:
    adapter.found = [received(FRAME), error, received(FRAME)]
    assert list(port.frames()) == [FRAME, FRAME]
    assert faults == [FrameFault.BUS_ERROR]
    assert port.state is BusState.UP


@pytest.mark.parametrize("error", KINDS)
def test_a_bus_that_is_gone_is_a_fault_and_no_error(
    adapter: Adapter, port: Port, faults: list[FrameFault], error: Exception
) -> None:
    adapter.always = error
    assert list(port.frames()) == []
    assert faults == [FrameFault.BUS_ERROR] * MOST_FAILURES
    assert not port.send(FRAME)
    assert port.state is BusState.FAILED
    port.close()
    adapter.always = None
    adapter.found = [received(FRAME)]
    assert list(port.frames()) == [FRAME]
    assert port.send(FRAME)


def test_without_a_file_descriptor_it_is_minus_one(port: Port) -> None:
    assert port.fileno() == -1
