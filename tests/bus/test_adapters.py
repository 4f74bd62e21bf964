"""Buses of python-can: their frames, CAN FD, multicast."""

from dataclasses import replace
from typing import Any

import can
import pytest

from canshaper.bus import python_can
from canshaper.bus.port import open_port
from canshaper.codec.frame import Frame, FrameFault
from canshaper.config.bus import Bus
from tests.bus.fake_sockets import IDS


class Adapter:
    """An interface of python-can that hands out these messages."""

    def __init__(self, messages: list[can.Message]) -> None:
        self.messages = messages
        self.sent: list[can.Message] = []

    def recv(self, _timeout: float) -> can.Message | None:
        return self.messages.pop(0) if self.messages else None

    def send(self, message: can.Message) -> None:
        self.sent.append(message)

    def fileno(self) -> int:
        return 9


def test_what_is_no_data_frame_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    messages = [
        can.Message(is_error_frame=True),
        can.Message(is_remote_frame=True),
        can.Message(is_fd=True, data=bytes(12)),
    ]
    monkeypatch.setattr(can, "Bus", lambda **_: Adapter(messages))
    faults: list[FrameFault] = []
    port = open_port("crane", Bus(interface="virtual", channel="ttyS0"), faults.append)
    assert list(port.frames()) == []
    wrong = FrameFault.WRONG_LENGTH
    assert faults == [FrameFault.ERROR_FRAME, wrong, wrong]
    assert list(port.background()) == []
    port.watch("second", IDS)
    assert (port.name, port.fileno()) == ("second", 9)


def test_a_bus_of_can_fd_receives_and_sends_its_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """The interface is asked for it, with its bit rate; which message is one says the id."""
    adapter = Adapter(
        [can.Message(arbitration_id=0x110, is_extended_id=False, is_fd=True, data=bytes(12))]
    )
    opened: list[dict[str, Any]] = []

    def bus(**options: Any) -> Adapter:
        opened.append(options)
        return adapter

    monkeypatch.setattr(can, "Bus", bus)
    faults: list[FrameFault] = []
    config = Bus(interface="virtual", channel="x", fd=True, data_bitrate=2_000_000)
    ids = replace(IDS, fd=frozenset({(0x200, False)}))
    port = open_port("crane", config, faults.append, ids)
    assert list(port.frames()) == [Frame("crane", 0x110, False, bytes(12))]
    assert port.send(Frame("crane", 0x200, False, bytes(8)))
    assert port.send(Frame("crane", 0x300, False, bytes(8)))
    assert [(m.is_fd, m.bitrate_switch) for m in adapter.sent] == [(True, True), (False, False)]
    port.watch("crane", IDS)
    assert port.send(Frame("crane", 0x200, False, bytes(8)))
    assert adapter.sent[-1].is_fd is False
    port = open_port("crane", config.model_copy(update={"data_bitrate": None}), faults.append, ids)
    assert port.send(Frame("crane", 0x200, False, bytes(64)))
    assert (adapter.sent[-1].is_fd, adapter.sent[-1].bitrate_switch) == (True, False)
    assert faults == []
    options = [{k: v for k, v in o.items() if "fd" in k or "data" in k} for o in opened]
    assert options == [{}, {}]  # virtual always has it


@pytest.mark.parametrize(
    ("fd", "data_bitrate", "expected"),
    [
        (False, None, {}),
        (True, None, {"fd": True}),
        (True, 2_000_000, {"fd": True, "data_bitrate": 2_000_000}),
    ],
)
def test_other_interfaces_are_opened_with_can_fd(
    monkeypatch: pytest.MonkeyPatch, fd: bool, data_bitrate: int | None, expected: dict[str, Any]
) -> None:
    opened: list[dict[str, Any]] = []
    monkeypatch.setattr(can, "Bus", lambda **options: opened.append(options))
    config = Bus(interface="kvaser", channel="0", fd=fd, data_bitrate=data_bitrate)
    python_can.open_python_can(config)
    assert [{k: v for k, v in o.items() if "fd" in k or "data" in k} for o in opened] == [expected]


def test_multicast_beyond_this_machine_receives_one_group_and_nothing_old(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What another group sent before does not count; what we send comes back and is ours."""
    old = can.Message(arbitration_id=1, is_extended_id=False)
    adapter = Adapter([old, old])
    opened: list[dict[str, Any]] = []
    groups: list[int] = []

    def bus(**options: Any) -> Adapter:
        opened.append(options)
        return adapter

    monkeypatch.setattr(can, "Bus", bus)
    monkeypatch.setattr(python_can, "receive_one_group", groups.append)
    config = Bus(interface="udp_multicast", channel="239.1.2.3", network=True)
    port = open_port("crane", config, lambda _: None)
    assert groups == [9]
    assert opened == [
        {
            "interface": "udp_multicast",
            "channel": "239.1.2.3",
            "ignore_config": True,
            "receive_own_messages": False,
        }
    ]
    ours = Frame("crane", 0x200, False, b"\1")
    assert port.send(ours)
    adapter.messages += [adapter.sent[0], can.Message(arbitration_id=5, is_extended_id=False)]
    assert [f.can_id for f in port.frames()] == [5]
