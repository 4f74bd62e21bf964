"""Client of the control socket, for ``set``, ``fault``, ``metrics`` and the live page."""

import getpass
import json
import os
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from canshaper.daemon.control_server import MOST_BYTES
from canshaper.errors import ControlError

# The daemon answers within a tick or two.
ANSWER_S = 5.0


def table(path: Path) -> dict[str, dict[str, float]]:
    """Return a daemon's adjustable numbers by key, each with ``now``, ``file``, ``low``, ``high``.

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
    """Return the name of the person who runs this program; with sudo the one who called that."""
    return os.environ.get("SUDO_USER") or getpass.getuser()


def change(path: Path, values: Mapping[str, float], by: str = "") -> None:
    """Change numbers of a running daemon, all or none; they hold until it ends or reads its file.

    Args:
        path: its control socket.
        values: numbers by their keys, such as ``axes.slew.sway.period_s``.
        by: program that changes them for the person, for the daemon's log.

    Raises:
        ControlError: no daemon answers, or it refuses; then nothing has changed.
    """
    _ask(path, {"set": dict(values), "by": f"{person()}/{by}" if by else person()})


def rehearse(path: Path, what: str) -> dict[str, Any]:
    """Let a running daemon make a fault by its name, ``end`` or ``report`` it; return its report.

    Raises:
        ControlError: no daemon answers, or it refuses.
    """
    answer = _ask(path, {"fault": what, "by": person()})["fault"]
    assert isinstance(answer, dict)
    return answer


def write_black_box(path: Path, on_wait: Callable[[], None]) -> str:
    """Let a running daemon write its black box, and wait for that.

    Args:
        path: its control socket.
        on_wait: called between two questions to sleep; an error that it raises ends the wait.

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


def _ask(path: Path, request: Mapping[str, Any]) -> dict[str, Any]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as one:
        one.settimeout(ANSWER_S)
        try:
            one.connect(str(path))
            one.send(json.dumps(request).encode())
            data = one.recv(MOST_BYTES)
        except TimeoutError:
            raise ControlError(f"{path}: the daemon does not answer") from None
        except OSError as error:
            text = error.strerror or str(error)
            raise ControlError(f"{path}: {text}: no daemon with a control section?") from None
    if not data:
        raise ControlError(f"{path}: the daemon takes no more connections now")
    answer: dict[str, Any] = json.loads(data)
    if "error" in answer:
        raise ControlError(str(answer["error"]))
    return answer
