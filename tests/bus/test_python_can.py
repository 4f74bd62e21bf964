"""A bus of python-can: whatever its interface raises, the loop goes on."""

from collections.abc import Iterator
from typing import Any

import can
import pytest
from can.interfaces.socketcand import socketcand

from canshaper.bus import python_can as bus_module
from canshaper.bus.port import Port, open_port
from canshaper.bus.python_can import MOST_ECHOES, MOST_FAILURES
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.config.bus import Bus

KINDS = (can.CanOperationError("lost"), OSError("gone"), ValueError("t1"), IndexError("t12"))
FRAME = Frame("crane", 0x110, False, b"\1\2")


class Adapter:
    """An interface that hands out or raises what it is given, and then fails as it is set to."""

    def __init__(self) -> None:
        self.waiting: list[can.Message | Exception] = []
        self.always: Exception | None = None
        self.options: dict[str, Any] = {}
        self.closed = False

    def recv(self, timeout_s: float) -> can.Message | None:
        assert timeout_s == 0  # a tick does not wait
        one = self.waiting.pop(0) if self.waiting else self.always
        if isinstance(one, Exception):
            raise one
        return one

    def send(self, _message: can.Message) -> None:
        if self.always:
            raise self.always

    def shutdown(self) -> None:
        self.closed = True
        if self.always:
            raise self.always

    def fileno(self) -> Any:
        raise NotImplementedError("fileno is not implemented")


@pytest.fixture
def adapter(monkeypatch: pytest.MonkeyPatch) -> Adapter:
    made = Adapter()

    def opened(**options: Any) -> Adapter:
        made.options = options
        return made

    monkeypatch.setattr(can, "Bus", opened)
    return made


@pytest.fixture
def faults() -> list[FrameFault]:
    return []


@pytest.fixture
def port(adapter: Adapter, faults: list[FrameFault]) -> Iterator[Port]:
    yield open_port("crane", Bus(interface="virtual", channel="/dev/ttyUSB0"), faults.append)
    adapter.always = None


def received(frame: Frame) -> can.Message:
    return can.Message(arbitration_id=frame.can_id, is_extended_id=frame.extended, data=frame.data)


@pytest.mark.parametrize("error", KINDS)
def test_a_garbled_line_costs_that_line_only(
    adapter: Adapter, port: Port, faults: list[FrameFault], error: Exception
) -> None:
    adapter.waiting = [received(FRAME), error, received(FRAME)]
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
    assert port.state is BusState.FAILED
    assert not port.send(FRAME)
    assert port.state is BusState.FAILED
    port.close()
    assert adapter.closed
    adapter.always = None
    adapter.waiting = [received(FRAME)]
    assert list(port.frames()) == [FRAME]
    assert port.send(FRAME)


def test_an_interface_that_never_blocks_has_failed_with_its_time_out(
    adapter: Adapter, port: Port, faults: list[FrameFault]
) -> None:
    adapter.always = can.CanTimeoutError("full")
    assert not port.send(FRAME)
    assert port.state is BusState.FAILED
    assert faults == []
    adapter.always = None
    assert port.send(FRAME)
    assert port.state is BusState.FAILED, "until a frame comes"


@pytest.mark.parametrize(
    ("interface", "options", "passed"),
    [
        ("serial", {}, {"timeout": 0.01}),
        ("serial", {"timeout": 0.5}, {"timeout": 0.5}),
        ("socketcand", {}, {"tcp_tune": True}),
        ("virtual", {}, {}),
    ],
)
def test_an_interface_is_opened_as_its_kind_needs_unless_the_file_says_otherwise(
    adapter: Adapter, interface: str, options: dict[str, Any], passed: dict[str, Any]
) -> None:
    bus_module.open_python_can(Bus(interface=interface, channel="x", options=options))
    common = {"interface", "channel", "ignore_config", "receive_own_messages"}
    assert {key: adapter.options[key] for key in adapter.options.keys() - common} == passed


def test_without_a_file_descriptor_it_is_minus_one(port: Port) -> None:
    assert port.fileno() == -1


@pytest.mark.parametrize(
    ("bitrate", "passed"), [(None, {}), (250_000, {"bitrate": 250_000})], ids=["none", "one"]
)
def test_the_bit_rate_of_the_file_is_that_of_the_adapter(
    adapter: Adapter, bitrate: int | None, passed: dict[str, int]
) -> None:
    """Without one it is the adapter's own."""
    port = open_port(
        "crane", Bus(interface="virtual", channel="x", bitrate=bitrate), lambda _: None
    )
    assert port.state is BusState.UP
    options = {"interface": "virtual", "channel": "x", "ignore_config": True}
    assert adapter.options == {**options, "receive_own_messages": False, **passed}


def test_a_frame_like_one_of_ours_is_that_of_another_sender(adapter: Adapter, port: Port) -> None:
    """An adapter does not bring back what was sent through it."""
    assert port.send(FRAME)
    adapter.waiting = [received(FRAME)]
    assert list(port.frames()) == [FRAME]


@pytest.fixture
def multicast(adapter: Adapter, monkeypatch: pytest.MonkeyPatch) -> Port:
    """A group that brings back what was sent."""
    monkeypatch.setattr(Adapter, "fileno", lambda _: 9)
    monkeypatch.setattr(bus_module, "receive_one_group", lambda _fileno: None)
    config = Bus(interface="udp_multicast", channel="239.1.2.3", network=True)
    return open_port("crane", config, lambda _: None)


def test_what_comes_back_is_ours_once(adapter: Adapter, multicast: Port) -> None:
    assert multicast.send(FRAME)
    adapter.waiting = [received(FRAME), received(FRAME)]
    assert list(multicast.frames()) == [FRAME]


def test_of_what_never_comes_back_no_more_than_a_few_are_kept(
    adapter: Adapter, multicast: Port
) -> None:
    frames = [FRAME._replace(data=n.to_bytes(2, "big")) for n in range(MOST_ECHOES + 1)]
    for frame in frames:
        assert multicast.send(frame)
    adapter.waiting = [received(frame) for frame in frames]
    assert list(multicast.frames()) == frames[:1]


def test_what_socketcand_repeats_at_each_attempt_is_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    for reason in ("refused", "refused", "no route", "refused", "refused"):
        socketcand.log.warning(f"Failed to connect: {reason}")
    lines = [record.getMessage() for record in caplog.records]
    assert lines == [f"Failed to connect: {one}" for one in ("refused", "no route", "refused")]


def test_python_can_knows_nothing_of_what_has_left(port: Port) -> None:
    assert (port.look(), port.why, port.confirmed) == ("", "", None)
