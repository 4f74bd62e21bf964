"""A control socket of a daemon, and who asks at it."""

import json
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.daemon.bench import Bench, at

RANGE = "axes.slew.filter.a1: [0.5, 1.0]"
clients: list[socket.socket] = []


def control(bench: Bench, path: Path) -> None:
    bench.text += f"control:\n  socket: {path}\n  adjustable:\n    {RANGE}\n"
    bench.file.write_text(bench.text, encoding="utf-8")


def ask(path: Path, request: object) -> Callable[[], socket.socket]:
    def asks() -> socket.socket:
        client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        client.settimeout(5)
        client.connect(str(path))
        client.send(json.dumps(request).encode())
        clients.append(client)
        return client

    clients.clear()
    return asks


def answered(bench: Bench, path: Path, request: object) -> dict[str, Any]:
    replies: list[bytes] = []
    asks = ask(path, request)
    at(bench, {3: asks, 15: lambda: replies.append(clients[0].recv(65536))})
    clients[0].close()
    answer: dict[str, Any] = json.loads(replies[0])
    return answer
