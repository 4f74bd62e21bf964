"""A daemon that reads its files again: what it reports to its manager, and that it goes on."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.rigs.files import machine_file

pytestmark = pytest.mark.processes

ANSWER_S = 60.0  # only to end a test that hangs
BUS = "{ interface: socketcan, channel: vcan0, bitrate: 250000 }"


class Daemon:
    """``canshaper run`` on a bus of its own, with us as its service manager."""

    def __init__(self, folder: Path) -> None:
        self.file = machine_file(folder, "forwarder", (BUS, "{ interface: virtual, channel: x }"))
        self.text = self.file.read_text(encoding="utf-8")
        self._log = folder / "log"
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(folder / "notify"))
        self._socket.settimeout(ANSWER_S)
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "canshaper", "run", str(self.file)],
                stderr=log,
                env={**os.environ, "NOTIFY_SOCKET": str(folder / "notify")},
            )

    def received(self, last: str) -> list[str]:
        """Messages to the manager, until one with this line; without those of each second.

        Lines of a message are separated by ";".
        """
        messages: list[str] = []
        while not re.search(last, messages[-1] if messages else ""):
            text = self._socket.recv(4096).decode()
            if not re.match(r"STATUS=\w+ NEUTRAL_WAIT", text):
                messages.append(text.replace("\n", ";"))
        return messages

    def goes_on(self) -> bool:
        """Whether the loop runs: a status that was sent from now on."""
        self._socket.setblocking(False)
        try:
            while True:
                self._socket.recv(4096)
        except BlockingIOError:
            self._socket.settimeout(ANSWER_S)
        return self._socket.recv(4096).startswith(b"STATUS=slew NEUTRAL_WAIT")

    def reload(self) -> None:
        self.process.send_signal(signal.SIGHUP)

    def log(self) -> str:
        return self._log.read_text()

    def readers(self) -> list[str]:
        pid = self.process.pid
        return Path(f"/proc/{pid}/task/{pid}/children").read_text().split()

    def reader_after_reload(self, but: str = "") -> str:
        """The process that reads the files after a reload, another one than before."""
        self.reload()
        until = time.monotonic() + ANSWER_S
        while self.readers() in ([], [but]):
            assert time.monotonic() < until
        (reader,) = self.readers()
        os.kill(int(reader), signal.SIGSTOP)  # as if its files came from a disk that hangs
        return reader

    def end(self) -> int:
        self.process.terminate()
        try:
            return self.process.wait(ANSWER_S)
        finally:
            self.process.kill()

    def close(self) -> None:
        self.end()
        self._socket.close()


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    started = Daemon(tmp_path)
    assert "READY=1" in started.received("READY=1")[-1]
    yield started
    started.close()


@pytest.mark.slow
def test_a_good_file_is_a_short_reload(daemon: Daemon) -> None:
    daemon.file.write_text(daemon.text.replace("tick_ms: 20", "tick_ms: 10"), encoding="utf-8")
    daemon.reload()
    begun, over = daemon.received("READY=1")
    assert re.fullmatch(r"RELOADING=1;MONOTONIC_USEC=\d+", begun)
    assert over == "READY=1;STATUS=reload applied"
    assert f"reload=applied file={daemon.file}" in daemon.log()
    assert daemon.goes_on()
    assert daemon.end() == 0


@pytest.mark.slow
def test_a_wrong_file_is_refused_and_no_reload(daemon: Daemon) -> None:
    daemon.file.write_text(daemon.text + "nonsense: 1\nmore: 1\n", encoding="utf-8")
    line = daemon.text.count("\n") + 1
    daemon.reload()
    (refusal,) = daemon.received("refused")
    assert refusal.startswith(f"STATUS=reload refused: {daemon.file}:{line}: nonsense: ")
    refused = re.findall(r"ERROR reload=refused \S+:(\d+): (\w+)", daemon.log())
    assert refused == [(str(line), "nonsense"), (str(line + 1), "more")]
    assert daemon.goes_on()
    daemon.file.write_text(daemon.text, encoding="utf-8")
    daemon.reload()
    assert len(daemon.received("reload applied")) == 2


@pytest.mark.slow
def test_a_bus_that_cannot_be_opened_ends_the_reload_as_before(daemon: Daemon) -> None:
    changed = daemon.text.replace("virtual, channel: x", "socketcan, channel: nowhere0")
    daemon.file.write_text(changed, encoding="utf-8")
    daemon.reload()
    begun, over, why = daemon.received("refused")
    assert (begun[:11], over[:7]) == ("RELOADING=1", "READY=1")
    assert why.startswith(
        "STATUS=reload refused: bus crane: cannot open socketcan channel nowhere0"
    )
    assert daemon.goes_on()


@pytest.mark.slow
def test_the_loop_never_waits_for_files(daemon: Daemon) -> None:
    """A reader that hangs is given up for the next reload, and at the end."""
    slow = daemon.text + "".join(f"key{i}: 1\n" for i in range(9000))  # so that it is caught
    daemon.file.write_text(slow, encoding="utf-8")
    first = daemon.reader_after_reload()
    assert daemon.goes_on()
    second = daemon.reader_after_reload(but=first)
    assert daemon.goes_on()
    daemon.file.write_text(daemon.text, encoding="utf-8")
    daemon.reload()
    assert len(daemon.received("reload applied")) == 2
    assert daemon.readers() == []
    daemon.file.write_text(slow, encoding="utf-8")
    third = daemon.reader_after_reload()
    assert daemon.end() == 0
    assert [pid for pid in (first, second, third) if Path("/proc", pid).exists()] == []
    assert "stopped valves=sent" in daemon.log()
