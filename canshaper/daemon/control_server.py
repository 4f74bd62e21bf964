"""The daemon's end of the control socket: it never blocks, and takes one request a tick at most."""

import json
import os
import select
import socket
import struct
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

# Largest answer; one for a hundred adjustable numbers takes a tenth of it.
MOST_BYTES = 65536
# Largest request: to read and refuse one of this size takes the loop a tenth of a millisecond
# (benchmarks/control.py).
MOST_REQUEST = 4096
MOST_CLIENTS = 4
# A client that is silent for so long is closed, so that others can connect.
SILENT_NS = 10_000_000_000
# Least time between two requests: someone who drags a slider must not keep the loop busy.
LEAST_BETWEEN_NS = 50_000_000
_PEER = struct.Struct("3i")  # struct ucred: pid, uid, gid

# Function of a request and of a text that names the client. It returns the answer, and raises
# ValueError for a wrong request.
Answer = Callable[[Mapping[str, Any], str], Mapping[str, Any]]


class ControlServer:
    """Listens at a path. Each message is one JSON object, and the answer is one JSON object.

    Args:
        path: path of the socket; its directory must exist.
        mode: file mode of the socket. A user who may write to it may change numbers of the machine.

    Raises:
        OSError: the socket cannot be made, or another daemon answers at this path.
    """

    def __init__(self, path: Path, mode: int) -> None:
        self._path = path
        self._clients: dict[int, socket.socket] = {}
        self._spoke_ns: dict[int, int] = {}  # time of the last request, or of the connection
        self._not_before_ns = 0
        self._socket = _listening(path, mode)
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)

    def serve(self, answer: Answer, now_ns: int) -> None:
        """Accept a new client, answer one request, and close clients silent for ``SILENT_NS``.

        The client served longest ago comes first. Within ``LEAST_BETWEEN_NS`` of the last request
        this does nothing.
        """
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
                data = client.recv(MOST_REQUEST + 1)  # the rest of a longer one is lost
                if data:
                    client.send(_answered(data, answer, _peer(client)), socket.MSG_DONTWAIT)
            except OSError:  # the client is gone, or does not read its answers
                data = b""
            if not data:
                self._drop(number)
                continue
            self._spoke_ns[number] = now_ns
            self._not_before_ns = now_ns + LEAST_BETWEEN_NS
            return

    def close(self) -> None:
        """Close all clients and the socket, and remove its path."""
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
        before = os.umask(0o777 & ~mode)  # no one else may open it at any moment
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
    """Return whether a killed daemon left a socket at this path, at which no one listens."""
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
        # As floats, numbers that are too large become infinite instead of slow.
        request = json.loads(data, parse_int=float)
        if not isinstance(request, dict):
            raise ValueError('expected {} or {"set": {KEY: VALUE}}, got no object')
        reply = answer(request, peer)
    except (ValueError, ArithmeticError, RecursionError) as error:
        reply = {"error": str(error)}
    return json.dumps(reply).encode()
