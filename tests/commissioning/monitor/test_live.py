"""The monitor on a pseudo terminal and in a pipe, next to a real daemon on a multicast bus."""

import fcntl
import os
import pty
import re
import select
import signal
import socket
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from canshaper.bus.multicast import LocalMulticastBus
from canshaper.cli.app import app
from tests.rigs.files import text_of

GROUP = f"239.75.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
BUS = ("--interface", "udp_multicast", "--channel", GROUP)
COMMAND = (sys.executable, "-m", "canshaper")
ANSWER_S = 120.0
MARKS = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


@contextmanager
def running(verb: str, *options: str, log: Path) -> Iterator[subprocess.Popen[bytes]]:
    with log.open("wb") as file:
        process = subprocess.Popen(
            [*COMMAND, verb, "forwarder.yaml", *BUS, *options], stdout=file, stderr=file
        )
    try:
        yield process
    finally:
        process.terminate()
        process.wait(ANSWER_S)


class Terminal:
    """A monitor on a terminal of 80 columns and 24 lines."""

    def __init__(self) -> None:
        environment = {**os.environ, "TERM": "xterm", "LANG": "C.UTF-8", "PYTHONUTF8": "1"}
        main, other = pty.openpty()
        fcntl.ioctl(main, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.process = subprocess.Popen(
            [*COMMAND, "monitor", "forwarder.yaml", *BUS, "--refresh", "10"],
            stdin=other, stdout=other, stderr=other, env=environment, start_new_session=True,
        )  # fmt: skip
        os.close(other)
        self._file = main
        self.seen = ""

    def read(self) -> bool:
        """Take what it has drawn; False at its end."""
        if not select.select([self._file], [], [], 0.2)[0]:
            return True
        try:
            data = os.read(self._file, 1 << 16)
        except OSError:  # the other side is closed
            return False
        self.seen += data.decode("utf-8", "replace")
        return bool(data)

    def wait_for(self, pattern: str) -> str:
        """Until a picture has this; that picture."""
        until = time.monotonic() + ANSWER_S
        while True:
            picture = MARKS.sub("", self.seen.split("\x1b[H")[-1])
            if re.search(pattern, picture):
                return picture
            assert self.read(), self.seen
            assert time.monotonic() < until, f"no {pattern!r} in\n{picture}"

    def press(self, keys: bytes) -> None:
        os.write(self._file, keys)

    def end(self) -> int:
        """Ctrl-C."""
        self.process.send_signal(signal.SIGINT)
        while self.read() and self.process.poll() is None:
            pass
        while self.read():
            pass
        os.close(self._file)
        return self.process.wait(ANSWER_S)


@pytest.mark.slow
def test_a_drive_on_the_terminal(tmp_path: Path) -> None:
    terminal = Terminal()
    try:
        terminal.wait_for("no status received")
        with running("run", log=tmp_path / "run"):
            terminal.wait_for(r"slew +NEUTRAL_WAIT")
            with running("operator", log=tmp_path / "operator"):
                picture = terminal.wait_for(r"lift +READY")
            rows = picture.splitlines()
            assert len(rows) <= 24
            assert max(len(row.rstrip()) for row in rows) <= 80
            terminal.wait_for("JOYSTICK_TIMEOUT")
            terminal.press(b"ap")
            picture = terminal.wait_for("PAUSED")
            assert ("slew " in picture, "near_far " in picture) == (True, False)
            terminal.press(b"aaap")
        terminal.wait_for("STALE")
    finally:
        code = terminal.end()
    assert code == 0
    assert terminal.seen.rstrip().endswith("\x1b[?1049l")  # the terminal is as it was


@pytest.mark.slow
def test_lines_for_pipes_and_nothing_is_sent(tmp_path: Path) -> None:
    with LocalMulticastBus(GROUP) as bus:
        monitor = subprocess.Popen(
            [*COMMAND, "monitor", "forwarder.yaml", *BUS], stdout=subprocess.PIPE, text=True
        )
        assert monitor.stdout is not None
        try:
            lines = [monitor.stdout.readline() for _ in range(2)]
            assert all("slew=no-status near_far=no-status" in line for line in lines)
            from_our_bus = [m for m in iter(lambda: bus.recv(0), None) if m.arbitration_id != 0]
            with running("run", log=tmp_path / "run"):
                while "slew=NEUTRAL_WAIT(JOYSTICK_TIMEOUT)" not in lines[-1]:
                    lines.append(monitor.stdout.readline())
                    assert lines[-1], lines
        finally:
            monitor.terminate()
            assert monitor.wait(ANSWER_S) == 0
            monitor.stdout.close()
    assert any("axis=slew state=NEUTRAL_WAIT reason=" in line for line in lines)
    assert [m for m in from_our_bus if m.channel == GROUP] == []


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["monitor", "record"])
@pytest.mark.parametrize(
    ("number", "codes"), [(signal.SIGINT, (130, -2)), (signal.SIGTERM, (-15,))]
)
def test_a_second_signal_ends_what_waits_for_an_adapter(
    tmp_path: Path, verb: str, number: int, codes: tuple[int, ...]
) -> None:
    """A server of socketcand that never answers holds the process that opens it."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        options = {"host": "127.0.0.1", "port": server.getsockname()[1]}
        content = yaml.safe_load(text_of("forwarder"))
        bus = {"interface": "socketcand", "channel": "can0", "options": options}
        content["buses"] = {"crane": bus}
        file = tmp_path / "machine.yaml"
        file.write_text(yaml.safe_dump(content), encoding="utf-8")
        process = subprocess.Popen([*COMMAND, verb, str(file)], cwd=tmp_path)
        server.settimeout(ANSWER_S)
        connection, _ = server.accept()
        try:
            for _ in range(40):  # two that come together are one; a third kills what leaves
                process.send_signal(number)
                with suppress(subprocess.TimeoutExpired):
                    process.wait(0.5)
                    break
            assert process.poll() in codes
        finally:
            process.kill()
            process.wait()
            connection.close()


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["no.yaml"], 2, "no.yaml: No such file or directory"),
        (["forwarder.yaml", "--interface", "nothing"], 3, "bus crane: cannot open nothing"),
        (["forwarder.yaml", "--refresh", "50"], 2, "Invalid value for '--refresh'"),
    ],
)
def test_what_cannot_be_is_reported(arguments: list[str], code: int, text: str) -> None:
    result = CliRunner().invoke(app, ["monitor", *arguments])
    assert result.exit_code == code
    assert text in result.output
