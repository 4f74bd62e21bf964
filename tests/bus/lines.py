"""Counterparts of adapters: a pseudo-terminal for slcan, a small server for socketcand."""

import os
import pty
import re
import select
import socket
import threading
import time
import tty
from collections.abc import Callable

ANSWER_S = 30.0  # only to end a test that hangs
THEIR_BYTES = 4096  # N_TTY_BUF_SIZE of drivers/tty/n_tty.c


def until(holds: Callable[[], object]) -> None:
    """Wait until something holds."""
    end = time.monotonic() + ANSWER_S
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.002)


class SerialLine:
    """A pseudo-terminal with an adapter of slcan, or none, at its other end."""

    def __init__(self) -> None:
        self._ours, self._theirs = pty.openpty()
        tty.setraw(self._theirs)
        self.path = os.ttyname(self._theirs)
        self.text = b""

    def read(self) -> bytes:
        """Read until nothing more comes; return all of it so far."""
        while select.select([self._ours], [], [], 0.05)[0]:
            self.text += os.read(self._ours, 65536)
        return self.text

    def write(self, text: bytes) -> None:
        os.write(self._ours, text)

    def close(self) -> None:
        os.close(self._ours)
        os.close(self._theirs)


class Socketcand:
    """The raw mode of socketcand's protocol, as its doc/protocol.md has it, for one client.

    The real one needs a kernel with SocketCAN. It may stop reading, as a network does that is gone.
    """

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        # So that what is not read is soon seen by the sender: loopback takes megabytes else.
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        self.port = self._server.getsockname()[1]
        self.frames: list[str] = []
        self.reads = True
        self._client: socket.socket | None = None
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        client, _ = self._server.accept()
        client.sendall(b"< hi >")
        for expected in (b"< open can0 >", b"< rawmode >"):
            assert client.recv(256) == expected
            client.sendall(b"< ok >")
        self._client = client
        rest = ""
        while True:
            if not self.reads:
                time.sleep(0.01)
                continue
            try:
                data = client.recv(4096)
            except OSError:
                return
            if not data:
                return
            *whole, rest = (rest + data.decode()).split(">")
            self.frames += [re.sub(r"\s+", " ", one).strip("< ") for one in whole]

    def send(self, can_id: int, data: bytes) -> None:
        until(lambda: self._client)
        assert self._client
        self._client.sendall(f"< frame {can_id:03X} 1.5 {data.hex()} >".encode())

    def hang_up(self) -> None:
        """Say that nothing more will come."""
        assert self._client
        self._client.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        if self._client:
            self._client.close()
        self._server.close()
