"""Sockets and ports of SocketCAN that cannot be opened: what is closed, and what is reported."""

import errno
import socket
import sys
from functools import partial
from pathlib import Path

import pytest

from canshaper.bus import port as bus_module
from canshaper.bus import python_can, socketcan
from canshaper.bus.port import open_port
from canshaper.bus.socketcan import check_present, open_sockets
from canshaper.codec.frame import FrameFault
from canshaper.config.bus import Bus
from canshaper.errors import BusError
from canshaper.machine.routing import BusRoutes
from tests.bus.fake_sockets import BUS, IDS, Made


def test_what_was_opened_is_closed_when_the_interface_is_not_there(made: list[Made]) -> None:
    with pytest.raises(OSError, match="No such device"):
        open_sockets(Bus(interface="socketcan", channel="none"), IDS)
    assert [one.closed for one in made] == [True] * 3


def test_a_kernel_without_can_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: int) -> None:
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr(socket, "socket", none)
    with pytest.raises(BusError) as error:
        open_port("crane", BUS, lambda _: None, IDS)
    assert str(error.value) == (
        "bus crane: cannot open socketcan channel can0: this kernel has no CAN, or its module"
        " can_raw is not loaded"
    )


def test_a_system_without_socketcan_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(socket, "AF_CAN")
    monkeypatch.setattr(sys, "platform", "darwin")
    with pytest.raises(BusError) as error:
        open_port("crane", BUS, lambda _: None, IDS)
    assert str(error.value) == (
        "bus crane: cannot open socketcan channel can0: it needs Linux, got darwin; python-can has"
        " other interfaces"
    )
    other = Bus(interface="slcan", channel="/dev/none")
    with pytest.raises(BusError) as error:  # in its own words
        open_port("crane", other, lambda _: None, IDS)
    assert "Linux" not in str(error.value)


@pytest.mark.parametrize("ids", [IDS, None])
def test_a_port_of_socketcan_has_the_name_the_messages_and_the_faults_of_its_bus(
    monkeypatch: pytest.MonkeyPatch, ids: BusRoutes | None
) -> None:
    opened: list[tuple[Bus, BusRoutes | None]] = []
    pair = socket.socketpair()
    faults: list[FrameFault] = []

    def opens(bus: Bus, ids: BusRoutes | None) -> list[socket.socket]:
        opened.append((bus, ids))
        return [pair[0]]

    monkeypatch.setattr(bus_module, "open_sockets", opens)
    port = open_port("crane", BUS, faults.append, ids)
    assert opened == [(BUS, ids)]
    assert port.name == "crane"
    pair[1].send(b"too short")
    assert list(port.frames()) == []
    assert faults == [FrameFault.WRONG_LENGTH]
    for one in pair:
        one.close()


def test_an_error_without_words_is_reported_by_its_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> None:
        raise ValueError

    monkeypatch.setattr(python_can, "open_python_can", none)
    with pytest.raises(BusError, match="cannot open slcan channel ttyS0: ValueError"):
        open_port("crane", Bus(interface="slcan", channel="ttyS0"), lambda _: None)


@pytest.mark.parametrize("channel", ["can7", ""])
def test_no_socket_is_bound_to_a_name_without_an_interface(channel: str, tmp_path: Path) -> None:
    """Binding would make the kernel look for a module; to "" it would bind to every interface."""
    (tmp_path / "sys/class/net/can0").mkdir(parents=True)
    check_present(Bus(interface="socketcan", channel="can0"), tmp_path)
    with pytest.raises(OSError, match="No such device"):
        check_present(Bus(interface="socketcan", channel=channel), tmp_path)


def test_where_the_system_shows_no_interfaces_the_kernel_is_asked(tmp_path: Path) -> None:
    check_present(Bus(interface="socketcan", channel="can7"), tmp_path)


def test_a_name_is_looked_at_before_it_is_bound(
    made: list[Made], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(socketcan, "check_present", partial(check_present, root=Path("/nowhere")))
    with pytest.raises(OSError, match="No such device"):
        open_sockets(BUS.model_copy(update={"channel": ""}), None)
    assert made[0].closed
    assert not made[0].bound
