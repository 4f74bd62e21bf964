"""An interface of python-can whose calls wait for a sign of the test."""

import threading
from typing import Any

import can

from canshaper.bus.apart import LEAVE_NS


class Held:
    """An interface that hands a frame on when the test says so."""

    def __init__(self) -> None:
        self.line: int | None = None
        self.go = threading.Semaphore(0)
        self.begun: list[int] = []
        self.sent: list[int] = []
        self.waiting: list[Any] = []
        self.closed = False
        self.error: Exception | None = None

    def send(self, message: can.Message, timeout: float) -> None:
        assert timeout == LEAVE_NS / 1e9
        self.begun.append(message.data[0])
        self.go.acquire()
        if self.error:
            raise self.error
        self.sent.append(message.data[0])

    def recv(self, timeout_s: float) -> Any:
        assert timeout_s == 0
        one = self.waiting.pop(0) if self.waiting else None
        if isinstance(one, Exception):
            raise one
        return one

    def fileno(self) -> int:
        if self.line is None:
            raise NotImplementedError
        return self.line

    def shutdown(self) -> None:
        self.closed = True
        raise OSError


def message(value: int, can_id: int = 1) -> can.Message:
    return can.Message(arbitration_id=can_id, is_extended_id=False, data=[value])
