"""Buses on python-can's multicast: each group is a bus of its own."""

import select
from collections.abc import Iterator
from pathlib import Path

import pytest

from canshaper.can.bus import Port, open_port
from canshaper.can.frame import Frame
from canshaper.config.schema import Bus

WAIT_S = 10.0


@pytest.fixture(params=[("239.81.7.1", "239.81.7.2"), ("ff15::8171", "ff15::8172")])
def ports(request: pytest.FixtureRequest) -> Iterator[dict[str, tuple[Port, Port]]]:
    """Two ports on each of two groups."""
    faults: list[object] = []
    if ":" in request.param[0] and not Path("/proc/net/if_inet6").exists():
        pytest.skip("this machine has no IPv6")
    opened = {
        name: (
            open_port(name, Bus(interface="udp_multicast", channel=group), faults.append),
            open_port(name, Bus(interface="udp_multicast", channel=group), faults.append),
        )
        for name, group in zip(("main", "aux"), request.param, strict=True)
    }
    yield opened
    for pair in opened.values():
        for port in pair:
            port.close()
    assert faults == []


def test_a_bus_hears_its_own_group_only(ports: dict[str, tuple[Port, Port]]) -> None:
    """The kernel hands a socket the frames of every group that the machine has joined."""
    for name, (sender, _) in ports.items():
        assert sender.send(Frame(name, 0x123, False, name.encode()))
    for name, (_, receiver) in ports.items():
        assert select.select([receiver.fileno()], [], [], WAIT_S)[0]
        assert list(receiver.frames()) == [Frame(name, 0x123, False, name.encode())]
