"""Buses on python-can's multicast: each group is a bus of its own."""

import json
import select
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from canshaper.bus import multicast
from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import Frame
from canshaper.config.schema import Bus
from canshaper.errors import BusError
from tests.bus.neighbour import CANNOT
from tests.rigs.files import ROOT

WAIT_S = 10.0


GROUPS = ("239.81.7.1", "239.81.7.2")
LIMIT_S = 300.0  # only to end a test that hangs


@pytest.fixture
def ports() -> Iterator[dict[str, tuple[Port, Port]]]:
    """Two ports on each of two groups."""
    faults: list[object] = []
    opened = {
        name: (
            open_port(name, Bus(interface="udp_multicast", channel=group), faults.append),
            open_port(name, Bus(interface="udp_multicast", channel=group), faults.append),
        )
        for name, group in zip(("main", "aux"), GROUPS, strict=True)
    }
    yield opened
    for pair in opened.values():
        for port in pair:
            port.close()
    assert faults == []


def test_a_bus_receives_its_own_group_only(ports: dict[str, tuple[Port, Port]]) -> None:
    """The kernel hands a socket the frames of every group that the machine has joined."""
    for name, (sender, _) in ports.items():
        assert sender.send(Frame(name, 0x123, False, name.encode()))
    for name, (_, receiver) in ports.items():
        assert select.select([receiver.fileno()], [], [], WAIT_S)[0]
        assert list(receiver.frames()) == [Frame(name, 0x123, False, name.encode())]


@pytest.mark.parametrize("channel", ["ff15::8171", "192.0.2.1", "can0", ""])
def test_only_a_group_of_ipv4_can_stay_on_this_machine(channel: str) -> None:
    """IPv6 has no multicast route on the loopback interface."""
    with pytest.raises(BusError) as error:
        open_port("crane", Bus(interface="udp_multicast", channel=channel), lambda _: None)
    assert str(error.value) == (
        f"bus crane: cannot open udp_multicast channel {channel}: expected a group of IPv4 such"
        f" as 239.1.2.3 or network: true, got {channel}"
    )


def test_without_its_loopback_interface_a_bus_says_so_and_leaks_nothing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(multicast, "LOOPBACK", "none-such")
    before = len([*Path("/proc/self/fd").iterdir()])
    with pytest.raises(BusError, match="cannot open udp_multicast channel"):
        open_port("crane", Bus(interface="udp_multicast", channel=GROUPS[0]), lambda _: None)
    assert len([*Path("/proc/self/fd").iterdir()]) == before
    assert caplog.messages == []


@pytest.mark.slow
@pytest.mark.processes
@pytest.mark.parametrize("shared", [False, True])
def test_nothing_leaves_this_machine_and_nothing_comes_in(shared: bool) -> None:
    """In a network of its own, with a card that every packet could leave by, and a neighbour."""
    why = subprocess.run(["unshare", "-n", "true"], capture_output=True, text=True, check=False)
    if why.returncode:
        pytest.skip(f"no network namespace here: {why.stderr.strip()}")
    done = subprocess.run(
        ["unshare", "-n", sys.executable, "-m", "tests.bus.neighbour", *(["shared"] * shared)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=LIMIT_S,
        check=False,
    )
    if done.returncode == CANNOT:
        pytest.skip(done.stdout.strip())
    assert done.returncode == 0, done.stdout + done.stderr
    seen = json.loads(done.stdout.splitlines()[-1])
    if shared:  # so the test would see it
        assert seen["outside"] >= seen["sent"] == 50
        assert seen["from_outside"] == [0x7A1, 0x7A2]
    else:
        assert seen == {"sent": 50, "received": 50, "drive": True, "outside": 0, "from_outside": []}
