"""The other end of the control socket: for ``canshaper set``, ``metrics`` and the live page."""

import getpass
import json
import os
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

from canshaper.daemon.control_server import MOST_BYTES
from canshaper.errors import ControlError

# The daemon answers within a tick or two.
ANSWER_S = 5.0


def table(path: Path) -> dict[str, dict[str, float]]:
    """Return the adjustable numbers by key, with ``now``, ``file``, ``low`` and ``high``.

    Raises:
        ControlError: no daemon answers.
    """
    answer = _ask(path, {})
    assert isinstance(answer["adjustable"], dict)
    return answer["adjustable"]


def status(path: Path) -> dict[str, Any]:
    """Return state, counters and lateness of a running daemon, see ``Reporter.numbers``.

    Raises:
        ControlError: no daemon answers, or one that does not know the question.
    """
    answer = _ask(path, {"status": True})["status"]
    assert isinstance(answer, dict)
    return answer


def person() -> str:
    """Name of who runs this program, also by sudo."""
    return os.environ.get("SUDO_USER") or getpass.getuser()


def change(path: Path, values: Mapping[str, float], by: str = "") -> None:
    """Change numbers of a running daemon, all or none, until it ends or reads its file again.

    Args:
        path: its control socket.
        values: numbers by their keys, such as ``axes.slew.sway.period_s``.
        by: who else than the person, for the daemon's log.

    Raises:
        ControlError: no daemon answers, or it refuses; then nothing has changed.
    """
    _ask(path, {"set": dict(values), "by": f"{person()}/{by}" if by else person()})


def write_black_box(path: Path, on_wait: Callable[[], None]) -> str:
    """Let a running daemon write its black box, and wait for that.

    Args:
        path: its control socket.
        on_wait: called again and again meanwhile; what it raises ends the waiting.

    Returns:
        The folder where it was written.

    Raises:
        ControlError: no daemon answers, or it cannot write.
    """
    before = _ask(path, {"black_box": "write"})["black_box"]
    while True:
        now = _ask(path, {"black_box": "report"})["black_box"]
        if now["tried"] != before["tried"]:
            break
        on_wait()
    if now["fault"]:
        raise ControlError(f"{now['folder']}: {now['fault']}")
    return str(now["folder"])


class Connection:
    """A connection to the control socket of a daemon, to be closed.

    Args:
        path: its control socket.

    Raises:
        ControlError: no daemon answers.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.settimeout(ANSWER_S)
        try:
            self._socket.connect(str(path))
        except OSError as error:
            self.close()
            raise self._lost(error) from None

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    def close(self) -> None:
        """Close it."""
        self._socket.close()

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return the answer to a request.

        Raises:
            ControlError: the daemon does not answer, or it refuses.
        """
        try:
            self._socket.send(json.dumps(request).encode())
            data = self._socket.recv(MOST_BYTES)
        except OSError as error:
            raise self._lost(error) from None
        if not data:
            raise ControlError(f"{self._path}: the daemon takes no more connections now")
        answer: dict[str, Any] = json.loads(data)
        if "error" in answer:
            raise ControlError(str(answer["error"]))
        return answer

    def _lost(self, error: OSError) -> ControlError:
        if isinstance(error, TimeoutError):
            return ControlError(f"{self._path}: the daemon does not answer")
        text = error.strerror or str(error)
        return ControlError(f"{self._path}: {text}: no daemon with a control section?")


def _ask(path: Path, request: Mapping[str, Any]) -> dict[str, Any]:
    with Connection(path) as one:
        return one.ask(request)
