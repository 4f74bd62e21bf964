"""The daemon's end of the control socket: never waits, and takes one request a tick at most."""

import json
import os
import select
import socket
import struct
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

# An answer; a deployment with a hundred adjustable numbers takes a tenth of it.
MOST_BYTES = 65536
# A request: to read and refuse nonsense of this size costs the loop a tenth of a millisecond
# (benchmarks/control.py).
MOST_REQUEST = 4096
MOST_CLIENTS = 4
# A client that asks nothing for so long is closed, to leave room for others.
SILENT_NS = 10_000_000_000
# Between two requests: a slider that is dragged must not keep the loop busy.
LEAST_BETWEEN_NS = 50_000_000
_PEER = struct.Struct("3i")  # struct ucred: pid, uid, gid

# Takes a request and who asks; gives the answer. Raises ValueError with what is wrong.
Answer = Callable[[Mapping[str, Any], str], Mapping[str, Any]]


class ControlServer:
    """Listens at a path; each message is one JSON object, each gets one in return.

    Args:
        path: where the socket appears; its directory has to be there.
        mode: file mode of the socket: who may write to it may change the machine's numbers.

    Raises:
        OSError: there can be no socket, or another daemon answers at this path.
    """

    def __init__(self, path: Path, mode: int) -> None:
        self._path = path
        self._clients: dict[int, socket.socket] = {}
        self._spoke_ns: dict[int, int] = {}  # when a client came, or asked last
        self._not_before_ns = 0
        self._socket = _listening(path, mode)
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)

    def serve(self, answer: Answer, now_ns: int) -> None:
        """Take what waits: a new client, and one request of the client that asked longest ago."""
        if now_ns < self._not_before_ns:
            return
        waiting = {number for number, _ in self._poll.poll(0)}
        if self._socket.fileno() in waiting:
            self._accept(now_ns)
        for number, spoke_ns in sorted(self._spoke_ns.items(), key=lambda item: item[1]):
            if number not in waiting:
                if now_ns - spoke_ns > SILENT_NS:
                    self._drop(number)
                continue
            client = self._clients[number]
            try:
                data = client.recv(MOST_REQUEST + 1)  # of a longer message the rest is lost
                if data:
                    client.send(_answered(data, answer, _peer(client)), socket.MSG_DONTWAIT)
            except OSError:  # gone, or does not read its answers
                data = b""
            if not data:
                self._drop(number)
                continue
            self._spoke_ns[number] = now_ns
            self._not_before_ns = now_ns + LEAST_BETWEEN_NS
            return

    def close(self) -> None:
        """End; the path is free again."""
        for number in [*self._clients]:
            self._drop(number)
        self._socket.close()
        with suppress(OSError):
            self._path.unlink()

    def _accept(self, now_ns: int) -> None:
        with suppress(OSError):
            client, _ = self._socket.accept()
            if len(self._clients) >= MOST_CLIENTS:
                client.close()
                return
            client.setblocking(False)
            self._clients[client.fileno()] = client
            self._spoke_ns[client.fileno()] = now_ns
            self._poll.register(client, select.POLLIN)

    def _drop(self, number: int) -> None:
        self._poll.unregister(number)
        del self._spoke_ns[number]
        self._clients.pop(number).close()


def _listening(path: Path, mode: int) -> socket.socket:
    one = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)
    try:
        if _is_dead(path):
            path.unlink()
        before = os.umask(0o777 & ~mode)  # at no moment may somebody else open it
        try:
            one.bind(str(path))
        finally:
            os.umask(before)
        one.listen(MOST_CLIENTS)
    except OSError:
        one.close()
        raise
    return one


def _is_dead(path: Path) -> bool:
    """Whether a socket is there that no one listens at: left by a daemon that was killed."""
    if not path.is_socket():
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK) as one:
        try:
            one.connect(str(path))
        except ConnectionRefusedError:
            return True
        except OSError:
            return False
    return False


def _peer(client: socket.socket) -> str:
    data = client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size)
    pid, uid, _ = _PEER.unpack(data)
    return f"uid={uid} pid={pid}"


def _answered(data: bytes, answer: Answer, peer: str) -> bytes:
    try:
        if len(data) > MOST_REQUEST:
            raise ValueError(f"expected a request of {MOST_REQUEST} bytes at most, got more")
        # A number of a thousand digits is infinite like every other that is too large.
        request = json.loads(data, parse_int=float)
        if not isinstance(request, dict):
            raise ValueError('expected {} or {"set": {KEY: VALUE}}, got no object')
        reply = answer(request, peer)
    except (ValueError, ArithmeticError, RecursionError) as error:
        reply = {"error": str(error)}
    return json.dumps(reply).encode()
