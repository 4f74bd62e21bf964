"""Messages to the service manager, on a real datagram socket as systemd binds one."""

import itertools
import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from canshaper.service.notify import ServiceManager

TICK_NS = 20_000_000

# The socket to the manager lives as long as the process.
pytestmark = pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")


class Manager:
    """The end that reads."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind("\0" + address[1:] if address.startswith("@") else address)

    def heard(self) -> list[str]:
        """Every message since the last call."""
        messages = []
        while True:
            try:
                messages.append(self._socket.recv(4096).decode())
            except BlockingIOError:
                return messages

    def close(self) -> None:
        self._socket.close()


@contextmanager
def manager_at(address: str) -> Iterator[Manager]:
    manager = Manager(address)
    try:
        yield manager
    finally:
        manager.close()


@pytest.fixture(params=["path", "abstract"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Manager]:
    abstract = f"@canshaper-test-{os.getpid()}-{time.monotonic_ns()}"
    with manager_at(str(tmp_path / "notify") if request.param == "path" else abstract) as opened:
        yield opened


def test_the_life_of_a_service(manager: Manager) -> None:
    service = ServiceManager({"NOTIFY_SOCKET": manager.address})
    service.ready("started, axes slew")
    service.status("slew READY, crane up")
    service.stopping()
    assert manager.heard() == [
        "READY=1\nSTATUS=started, axes slew",
        "STATUS=slew READY, crane up",
        "STOPPING=1",
    ]


def test_a_reload_begins_with_its_time(manager: Manager) -> None:
    """systemd takes a READY=1 for the end of the reload only with a time after its signal."""
    service = ServiceManager({"NOTIFY_SOCKET": manager.address})
    before = time.monotonic_ns() // 1000
    service.reloading()
    after = time.monotonic_ns() // 1000
    (message,) = manager.heard()
    first, second = message.split("\n")
    assert first == "RELOADING=1"
    key, _, value = second.partition("=")
    assert key == "MONOTONIC_USEC"
    assert before <= int(value) <= after


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": ""}])
def test_without_a_manager_nothing_is_sent_and_no_socket_made(
    environment: dict[str, str],
) -> None:
    before = sorted(Path("/proc/self/fd").iterdir())
    service = ServiceManager({**environment, "WATCHDOG_USEC": "1000000"})
    service.ready("started")
    service.reloading()
    service.status("here")
    service.ping(0)
    service.stopping()
    assert sorted(Path("/proc/self/fd").iterdir()) == before


def test_it_is_found_in_the_environment(manager: Manager, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", manager.address)
    ServiceManager().stopping()
    assert manager.heard() == ["STOPPING=1"]


def test_a_manager_that_hangs_holds_up_nothing(manager: Manager) -> None:
    """Its queue is full: what does not fit is lost, and what comes later arrives again."""
    service = ServiceManager({"NOTIFY_SOCKET": manager.address})
    for number in range(5000):
        service.status(str(number))
    heard = manager.heard()
    assert 0 < len(heard) < 5000
    assert heard == [f"STATUS={n}" for n in range(len(heard))]
    service.status("later")
    assert manager.heard() == ["STATUS=later"]


def test_a_manager_that_is_gone_and_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "notify"
    service = ServiceManager({"NOTIFY_SOCKET": str(path), "WATCHDOG_USEC": "1000000"})
    service.ready("nobody hears")
    with manager_at(str(path)) as first:
        service.ready("one")
        assert first.heard() == ["READY=1\nSTATUS=one"]
    service.ping(0)  # refused: the address is there, nobody has it
    path.unlink()
    service.status("none")
    with manager_at(str(path)) as second:
        service.status("two")
        assert second.heard() == ["STATUS=two"]


# -- watchdog --------------------------------------------------------------------------------------


def pings(manager: Manager, ticks: int, **environment: str) -> list[int]:
    """Ticks in which a ping came."""
    service = ServiceManager({"NOTIFY_SOCKET": manager.address, **environment})
    start = time.monotonic_ns()
    found = []
    for tick in range(ticks):
        service.ping(start + tick * TICK_NS)
        found += [tick] * len(manager.heard())
    return found


@pytest.mark.parametrize("limit_ms", [100, 1000, 3000])
def test_pings_come_often_enough_that_two_may_be_lost(manager: Manager, limit_ms: int) -> None:
    found = pings(manager, 1000, WATCHDOG_USEC=str(limit_ms * 1000))
    assert found[0] == 0
    gaps = {(b - a) * 20 for a, b in itertools.pairwise(found)}
    assert max(gaps) <= limit_ms / 4 + 20
    assert min(gaps) >= limit_ms / 4  # and no more often than needed


@pytest.mark.parametrize(
    ("environment", "ours"),
    [
        ({}, False),
        ({"WATCHDOG_USEC": ""}, False),
        ({"WATCHDOG_USEC": "0"}, False),
        ({"WATCHDOG_USEC": "1000000"}, True),
        ({"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": ""}, True),
        ({"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": str(os.getpid())}, True),
        ({"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": str(os.getppid())}, False),
        ({"WATCHDOG_PID": str(os.getpid())}, False),
    ],
)
def test_only_the_process_that_is_watched_pings(
    manager: Manager, environment: dict[str, str], ours: bool
) -> None:
    assert bool(pings(manager, 100, **environment)) is ours


def test_a_ping_is_that_and_nothing_else(manager: Manager) -> None:
    service = ServiceManager({"NOTIFY_SOCKET": manager.address, "WATCHDOG_USEC": "1000000"})
    service.ping(time.monotonic_ns())
    assert manager.heard() == ["WATCHDOG=1"]
