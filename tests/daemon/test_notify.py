"""Messages to the service manager, on a real datagram socket as systemd binds one."""

import itertools
import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from canshaper.daemon.notify import ServiceManager

TICK_NS = 20_000_000

# The socket to the manager lives as long as the process.
pytestmark = [
    pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning"),
    pytest.mark.usefixtures("never_wait"),
]


class Manager:
    """The end that reads."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind("\0" + address[1:] if address.startswith("@") else address)

    def received(self) -> list[str]:
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


def fill(manager: Manager) -> None:
    """Another service fills the manager's queue."""
    address = manager.address
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other:
        other.setblocking(False)
        with suppress(BlockingIOError):
            while True:
                other.sendto(b"STATUS=other", "\0" + address[1:] if address[0] == "@" else address)


def test_the_life_of_a_service(manager: Manager) -> None:
    service = ServiceManager({"NOTIFY_SOCKET": manager.address})
    service.ready("started, axes slew")
    service.status("slew READY, crane up")
    service.stopping()
    assert manager.received() == [
        "READY=1\nSTATUS=started, axes slew",
        "STATUS=slew READY, crane up",
        "STOPPING=1",
    ]


def test_a_service_that_waits_is_watched_with_more_patience(manager: Manager) -> None:
    service = ServiceManager({"NOTIFY_SOCKET": manager.address, "WATCHDOG_USEC": "1000000"})
    assert service.present and not ServiceManager({}).present
    service.waiting("waiting: can0")
    ServiceManager({"NOTIFY_SOCKET": manager.address}).waiting("waiting: can0")
    said = "READY=1\nSTATUS=waiting: can0"
    assert manager.received() == [f"{said}\nWATCHDOG=1\nWATCHDOG_USEC=30000000", said]


def test_a_reload_begins_with_its_time(manager: Manager) -> None:
    """systemd takes a READY=1 for the end of the reload only with a time after its signal."""
    service = ServiceManager({"NOTIFY_SOCKET": manager.address})
    before = time.monotonic_ns() // 1000
    service.reloading()
    after = time.monotonic_ns() // 1000
    (message,) = manager.received()
    first, second = message.split("\n")
    assert first == "RELOADING=1"
    key, _, value = second.partition("=")
    assert key == "MONOTONIC_USEC"
    assert before <= int(value) <= after


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": ""}])
def test_without_a_manager_nothing_is_sent_and_no_socket_made(environment: dict[str, str]) -> None:
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
    assert manager.received() == ["STOPPING=1"]


def test_a_manager_that_hangs_holds_up_nothing(manager: Manager) -> None:
    """Its queue is full: what does not fit is lost, and what comes later arrives again."""
    service = ServiceManager({"NOTIFY_SOCKET": manager.address})
    for number in range(5000):
        service.status(str(number))
    messages = manager.received()
    assert 0 < len(messages) < 5000
    assert messages == [f"STATUS={n}" for n in range(len(messages))]
    service.status("later")
    assert manager.received() == ["STATUS=later"]


def test_a_manager_that_is_gone_and_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "notify"
    service = ServiceManager({"NOTIFY_SOCKET": str(path)})
    service.ready("unreceived")
    with manager_at(str(path)) as first:
        service.ready("one")
        assert first.received() == ["READY=1\nSTATUS=one"]
    service.ready("refused")  # the address is there, no one has it
    path.unlink()
    service.status("none")
    with manager_at(str(path)) as second:
        service.status("two")
        assert second.received() == ["STATUS=two"]
        service.ping(0)  # what it has missed is not said again
        assert second.received() == []


@pytest.mark.parametrize("reload", [False, True])
def test_what_the_manager_waits_for_is_sent_again_until_it_is_accepted(
    manager: Manager, reload: bool
) -> None:
    """Without READY=1 systemd would kill the service after its start or reload."""
    service = ServiceManager({"NOTIFY_SOCKET": manager.address})
    fill(manager)
    if reload:
        service.reloading()
    else:
        service.ready("started")
    service.ping(0)
    assert all(message.startswith("STATUS=") for message in manager.received())
    service.ping(0)
    first = "RELOADING=1" if reload else "READY=1"
    assert [message.split("\n")[0] for message in manager.received()] == [first]
    service.ping(0)
    assert manager.received() == []


def test_the_end_of_a_reload_replaces_its_beginning(manager: Manager) -> None:
    service = ServiceManager({"NOTIFY_SOCKET": manager.address})
    fill(manager)
    service.reloading()
    service.ready("reload applied")
    manager.received()
    service.ping(0)
    assert manager.received() == ["READY=1\nSTATUS=reload applied"]


# -- watchdog --------------------------------------------------------------------------------------


def pings(manager: Manager, ticks: int, **environment: str) -> list[int]:
    """Ticks in which a ping came."""
    service = ServiceManager({"NOTIFY_SOCKET": manager.address, **environment})
    start = time.monotonic_ns()
    sent_at = []
    for tick in range(ticks):
        service.ping(start + tick * TICK_NS)
        sent_at += [tick] * len(manager.received())
    return sent_at


@pytest.mark.parametrize("limit_ms", [100, 1000, 3000])
def test_pings_come_often_enough_that_two_may_be_lost(manager: Manager, limit_ms: int) -> None:
    ticks = pings(manager, 1000, WATCHDOG_USEC=str(limit_ms * 1000))
    assert ticks[0] == 0
    gaps = {(b - a) * 20 for a, b in itertools.pairwise(ticks)}
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
        ({"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": "ours"}, True),
        ({"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": "its parent's"}, False),
        ({"WATCHDOG_PID": "ours"}, False),
    ],
)
def test_only_the_process_that_is_watched_pings(
    manager: Manager, environment: dict[str, str], ours: bool
) -> None:
    numbers = {"ours": str(os.getpid()), "its parent's": str(os.getppid())}
    environment = {key: numbers.get(value, value) for key, value in environment.items()}
    assert bool(pings(manager, 100, **environment)) is ours


def test_a_reload_has_more_time_than_a_tick(manager: Manager) -> None:
    """The loop stands still while files are read, and cannot ping."""
    service = ServiceManager({"NOTIFY_SOCKET": manager.address, "WATCHDOG_USEC": "1000000"})
    service.reloading()
    service.ready("reload applied")
    limits = [
        int(value)
        for message in manager.received()
        for key, _, value in (line.partition("=") for line in message.split("\n"))
        if key == "WATCHDOG_USEC"
    ]
    assert limits[0] >= 10_000_000
    assert limits[1:] == [1_000_000]


def test_pings_are_a_quarter_of_the_limit_apart_to_the_nanosecond(manager: Manager) -> None:
    service = ServiceManager({"NOTIFY_SOCKET": manager.address, "WATCHDOG_USEC": "1000000"})
    came = []
    for now_ns in (0, 249_999_999, 250_000_000, 499_999_999, 500_000_000):
        service.ping(now_ns)
        came += [now_ns] * len(manager.received())
    assert came == [0, 250_000_000, 500_000_000]


def test_a_ping_is_that_and_nothing_else(manager: Manager) -> None:
    service = ServiceManager({"NOTIFY_SOCKET": manager.address, "WATCHDOG_USEC": "1000000"})
    service.ping(time.monotonic_ns())
    assert manager.received() == ["WATCHDOG=1"]
