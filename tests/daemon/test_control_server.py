"""The control socket: whatever comes in, the loop goes on and others are served."""

import json
import os
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from canshaper.commissioning import control_client as client
from canshaper.daemon.control_server import (
    LEAST_BETWEEN_NS,
    MOST_BYTES,
    MOST_CLIENTS,
    SILENT_NS,
    ControlServer,
)
from canshaper.errors import ControlError


class Rig:
    """A server with its clock, and what it was asked."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.server = ControlServer(path, 0o600)
        self.now_ns = 0
        self.requests: list[Mapping[str, Any]] = []
        self.peers: list[str] = []
        self.reply: dict[str, Any] = {"adjustable": {}}

    def answer(self, request: Mapping[str, Any], peer: str) -> Mapping[str, Any]:
        self.requests.append(request)
        self.peers.append(peer)
        if "bad" in request:
            raise ValueError("no such thing")
        return self.reply

    def serve(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.server.serve(self.answer, self.now_ns)
            self.now_ns += LEAST_BETWEEN_NS

    def connected(self) -> socket.socket:
        one = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        one.settimeout(0)
        one.connect(str(self.path))
        self.serve()
        return one


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    made = Rig(tmp_path / "control.sock")
    yield made
    made.server.close()


def test_a_request_is_answered_and_says_who_asks(rig: Rig) -> None:
    with rig.connected() as one:
        one.send(b'{"set": {"a": 1, "b": 1e400}}')
        rig.serve()
        assert json.loads(one.recv(MOST_BYTES)) == rig.reply
    assert rig.requests == [{"set": {"a": 1.0, "b": float("inf")}}]
    assert rig.peers == [f"uid={os.getuid()} pid={os.getpid()}"]


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"nonsense", "Expecting value"),
        (b"\xff\xfe\x00", "codec"),
        (b"[1]", "got no object"),
        (b'{"bad": 1}', "no such thing"),
        (b"[" * 4096, "recursion" if sys.version_info < (3, 12) else "Expecting value"),
        (b'{"a": ' + b"9" * 4000 + b', "bad": 1}', "no such thing"),
        (b'{"bad": 1' + b" " * 4086 + b"}", "no such thing"),
        (b'{"bad": 1' + b" " * 4087 + b"}", "expected a request of 4096 bytes at most, got more"),
        (b"[" * 60000, "expected a request of 4096 bytes at most, got more"),
    ],
)
def test_nonsense_is_reported_and_the_next_request_served(rig: Rig, data: bytes, why: str) -> None:
    with rig.connected() as one:
        one.send(data)
        rig.serve()
        assert why in json.loads(one.recv(MOST_BYTES))["error"]
        one.send(b"{}")
        rig.serve()
        assert json.loads(one.recv(MOST_BYTES)) == rig.reply


def test_requests_come_one_at_a_time_and_not_too_often(rig: Rig) -> None:
    with rig.connected() as one, rig.connected() as other:
        for _ in range(3):
            one.send(b"{}")
            other.send(b"{}")
        begin = rig.now_ns
        for ms in range(0, 150, 5):
            rig.server.serve(rig.answer, begin + ms * 1_000_000)
    assert len(rig.requests) == 3


def test_more_clients_than_there_is_room_for_are_sent_away(rig: Rig) -> None:
    clients = [rig.connected() for _ in range(MOST_CLIENTS)]
    with rig.connected() as late:
        assert late.recv(10) == b""
    clients.pop().close()
    rig.serve()
    with rig.connected() as next_one:
        next_one.send(b"{}")
        rig.serve()
        assert next_one.recv(MOST_BYTES)
    for one in clients:
        one.close()


def test_silent_clients_leave_room_for_others(rig: Rig) -> None:
    """Also one that has asked before; one that asks now and then stays."""
    asks, silent, *others = (rig.connected() for _ in range(MOST_CLIENTS))
    begin = rig.now_ns
    silent.send(b"{}")
    rig.serve()
    while rig.now_ns <= begin + 2 * SILENT_NS:
        asks.send(b"{}")
        rig.serve()
        assert asks.recv(MOST_BYTES)
        rig.now_ns += SILENT_NS // 3
    assert silent.recv(MOST_BYTES)
    assert [one.recv(10) for one in (silent, *others)] == [b""] * (MOST_CLIENTS - 1)
    with rig.connected() as late:
        late.send(b"{}")
        rig.serve()
        assert late.recv(MOST_BYTES)
    for one in (asks, silent, *others):
        one.close()


def test_a_client_that_waits_no_longer_than_allowed_stays(rig: Rig) -> None:
    with rig.connected() as one:
        rig.now_ns = SILENT_NS
        rig.serve()
        one.send(b"{}")
        rig.serve()
        assert one.recv(MOST_BYTES)


def test_who_asks_all_the_time_does_not_keep_others_out(rig: Rig) -> None:
    with rig.connected() as greedy, rig.connected() as other:
        for _ in range(5):
            greedy.send(b'{"who": 1}')
        rig.serve()
        other.send(b'{"who": 2}')
        rig.serve(2)
    assert [request["who"] for request in rig.requests] == [1, 2, 1]


def test_a_client_that_reads_no_answers_is_dropped(rig: Rig) -> None:
    rig.reply = {"adjustable": "x" * 40000}
    with rig.connected() as one:
        for _ in range(100):
            try:
                one.send(b"{}")
            except OSError:
                break
            rig.serve(2)
        else:
            pytest.fail("never dropped")
    with rig.connected() as other:
        other.send(b"{}")
        rig.serve()
        assert other.recv(MOST_BYTES)


def test_only_its_owner_may_write(tmp_path: Path) -> None:
    for mode in (0o600, 0o660, 0o666):
        path = tmp_path / f"{mode:o}"
        mask = os.umask(0o077)
        server = ControlServer(path, mode)
        assert os.umask(mask) == 0o077
        assert stat.S_IMODE(path.stat().st_mode) == mode
        server.close()
        assert not path.exists()


@pytest.mark.processes
def test_the_socket_of_a_daemon_that_was_killed_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    code = "import sys, os; from pathlib import Path\n"
    code += "from canshaper.daemon.control_server import ControlServer\n"
    code += "server = ControlServer(Path(sys.argv[1]), 0o600); os._exit(0)"
    subprocess.run([sys.executable, "-c", code, str(path)], check=True)
    assert path.is_socket()
    ControlServer(path, 0o600).close()


def test_the_socket_of_a_daemon_that_runs_is_left_alone(rig: Rig) -> None:
    with pytest.raises(OSError, match="in use"):
        ControlServer(rig.path, 0o600)
    with rig.connected() as one:
        one.send(b"{}")
        rig.serve(4)  # the one that looked whether anything listens comes first
        assert one.recv(MOST_BYTES)


def test_a_file_that_is_no_socket_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    path.write_text("precious", encoding="utf-8")
    with pytest.raises(OSError, match="in use"):
        ControlServer(path, 0o600)
    assert path.read_text(encoding="utf-8") == "precious"


def test_a_client_without_a_daemon_says_where_it_looked(tmp_path: Path) -> None:
    with pytest.raises(ControlError, match=r"none\.sock: No such file"):
        client.table(tmp_path / "none.sock")
