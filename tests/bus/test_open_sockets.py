"""The sockets of an interface as they are opened: without CAN."""

import errno
import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from canshaper.bus import port as bus_module
from canshaper.bus import socketcan
from canshaper.bus.device import check_mtu
from canshaper.bus.port import open_port
from canshaper.bus.socketcan import open_sockets, set_filters
from canshaper.errors import BusError
from canshaper.machine.routing import BusRoutes
from tests.bus.fake_sockets import BUS, IDS, Made

RAW, SOL = socket.SOL_CAN_RAW, socket.SOL_SOCKET


def options(one: Made, level: int) -> dict[int, Any]:
    return {name: value for where, name, value in one.options if where == level}


def test_one_socket_receives_everything(made: list[Made]) -> None:
    open_sockets(BUS, None)
    (one,) = made
    assert one.arguments == (socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    assert one.blocking is False
    assert one.bound == ("can0",)
    assert options(one, SOL) == {socket.SO_RCVBUF: 1 << 20}
    assert options(one, RAW) == {socketcan.CAN_RAW_ERR_FILTER: 0x1FFFFFFD}


def test_three_sockets_each_for_its_frames(made: list[Made]) -> None:
    """Those that are received; our own back, other senders and errors; those that no one knows."""
    open_sockets(BUS, IDS)
    received, sent, unknown = made
    assert [one.bound for one in made] == [("can0",)] * 3
    assert [(one.blocking, one.closed) for one in made] == [(False, False)] * 3
    assert options(received, SOL) == {socket.SO_RCVBUF: 1 << 20}
    assert options(sent, SOL) == options(unknown, SOL) == {}
    assert options(received, RAW).keys() == {socket.CAN_RAW_FILTER}
    sent_back = options(sent, RAW)
    assert sent_back.pop(socketcan.CAN_RAW_ERR_FILTER) == 0x1FFFFFFD
    assert sent_back.pop(socket.CAN_RAW_RECV_OWN_MSGS) == 1
    assert sent_back.keys() == {socket.CAN_RAW_FILTER}
    others = options(unknown, RAW)
    assert others.pop(socket.CAN_RAW_JOIN_FILTERS) == 1
    assert others.keys() == {socket.CAN_RAW_FILTER}


def test_on_a_bus_of_can_fd_every_socket_has_its_frames(made: list[Made]) -> None:
    fd = BUS.model_copy(update={"fd": True})
    open_sockets(fd, IDS)
    open_sockets(fd, None)
    assert [options(one, RAW).get(socket.CAN_RAW_FD_FRAMES) for one in made] == [1] * 4
    made.clear()
    open_sockets(BUS, IDS)
    assert [options(one, RAW).get(socket.CAN_RAW_FD_FRAMES) for one in made] == [None] * 3


def test_an_interface_that_is_not_set_up_for_can_fd_is_reported(
    made: list[Made], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = tmp_path / "sys/class/net/can0"
    there.mkdir(parents=True)
    monkeypatch.setattr(socketcan, "check_mtu", lambda bus: check_mtu(bus, tmp_path))
    fd = BUS.model_copy(update={"fd": True})
    (there / "mtu").write_text("16\n")
    with pytest.raises(BusError) as caught:
        open_port("crane", fd, lambda _: None, IDS)
    assert str(caught.value) == (
        "bus crane: cannot open socketcan channel can0: expected an interface with CAN FD, which"
        " has the MTU 72, got 16"
    )
    assert all(one.closed for one in made)
    with pytest.raises(OSError, match="got 16") as refused:
        check_mtu(fd, tmp_path)
    assert refused.value.errno == errno.EINVAL
    open_sockets(BUS, IDS)  # classical frames it has
    (there / "mtu").write_text("72\n")
    open_sockets(fd, IDS)


@pytest.mark.parametrize(("ids", "fd"), [(IDS, {(0x200, False)}), (None, {(0x300, False)})])
def test_a_port_knows_the_messages_of_can_fd(
    monkeypatch: pytest.MonkeyPatch, ids: BusRoutes | None, fd: Any
) -> None:
    """Those of the deployment, else those that are named."""
    given: list[Any] = []
    monkeypatch.setattr(bus_module, "RawPort", lambda *values, **_: given.extend(values))
    routes = replace(ids, fd=frozenset({(0x200, False)})) if ids else None
    open_port("crane", BUS, lambda _: None, routes, fd={(0x300, False)})
    assert given[3:] == [routes, fd]


def filters(one: Made) -> set[tuple[int, int]]:
    data = options(one, RAW)[socket.CAN_RAW_FILTER]
    words = [int.from_bytes(data[i : i + 4], "little") for i in range(0, len(data), 4)]
    return set(zip(words[::2], words[1::2], strict=True))


MASK = 0x7FF | 0x80000000
NOT = 0x20000000


def filtered(ids: BusRoutes) -> list[set[tuple[int, int]]]:
    made = [Made(), Made(), Made()]
    set_filters(made, ids)  # type: ignore[arg-type]
    return [filters(one) for one in made]


def test_filters_name_ids_in_their_own_width() -> None:
    assert filtered(IDS) == [
        {(0x110, MASK)},
        {(0x200, MASK), (0x300, MASK)},
        {(i | NOT, MASK) for i in (0x110, 0x200, 0x300, 0x400)},
    ]


def test_groups_of_j1939_are_received_from_any_address_and_no_other_is_unknown() -> None:
    ids = BusRoutes(
        received=frozenset({(0x0CFDD633, True)}),
        sent=frozenset(),
        valves=frozenset(),
        known=frozenset({(0x0CFDD633, True), (0x110, False)}),
        received_groups=frozenset({0xEE00 << 8}),
        sent_groups=frozenset({0xFE30 << 8}),
        j1939=True,
    )
    eff = 0x80000000
    received, sent, unknown = filtered(ids)
    assert (0x0CFDD633 | eff, 0x1FFFFFFF | eff) in received
    assert received == {
        (0x0CFDD633 | eff, 0x1FFFFFFF | eff),
        (0xEE00 << 8 | eff, 0x03FF0000 | eff),  # to a destination, which is no part of the group
    }
    assert sent == {(0xFE30 << 8 | eff, 0x03FFFF00 | eff)}
    assert unknown == {(0x110 | NOT, MASK), (eff | NOT, eff)}


def test_services_of_canopen_are_not_unknown() -> None:
    services = {(base | NOT, mask | 0x80000000) for base, mask, _ in socketcan.SERVICES}
    assert filtered(replace(IDS, canopen=True))[2] == filtered(IDS)[2] | services


def test_in_the_line_nothing_is_unknown() -> None:
    ids = BusRoutes(IDS.received, IDS.sent, IDS.valves, IDS.known, in_line=True)
    assert filtered(ids)[2] == set()


def many(count: int) -> BusRoutes:
    known = frozenset((i, False) for i in range(count))
    return BusRoutes(frozenset({(0, False)}), frozenset({(1, False)}), frozenset(), known)


@pytest.mark.parametrize(
    ("kinds", "more"),
    [({}, 0), ({"j1939": True}, 1), ({"canopen": True}, 8), ({"j1939": True, "canopen": True}, 9)],
)
def test_more_filters_than_the_kernel_takes_are_left_to_the_reader(
    kinds: dict[str, bool], more: int
) -> None:
    """Of J1939 all extended frames are known, of CANopen eight services: a filter each."""
    assert len(socketcan.SERVICES) == 8
    for known, used in ((512 - more, 512), (513 - more, 2 + more)):
        made = [Made(), Made(), Made()]
        set_filters(made, replace(many(known), **kinds))  # type: ignore[arg-type]
        assert len(options(made[2], RAW)[socket.CAN_RAW_FILTER]) == 8 * used
