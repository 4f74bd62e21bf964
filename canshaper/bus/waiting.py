"""Reading a bus of python-can: an error of its interface costs one frame, no more."""

from collections.abc import Iterator
from typing import Any

import can

# Failures of an interface in one read: a garbled line of an adapter costs that line, and what waits
# behind it must not grow old; a bus that is gone fails at every call.
MOST_FAILURES = 20


def receive(bus: Any, timeout_s: float | None = 0.0) -> can.Message | None:
    """The next frame of a bus, or None where none comes in time; raises as the interface does."""
    try:
        message: can.Message | None = bus.recv(timeout_s)
    except Exception as error:
        # slcan keeps a line that is no text, and would fail at it for ever.
        if isinstance(error.__cause__, UnicodeDecodeError):
            getattr(bus, "_buffer", bytearray()).clear()
        raise
    return message


def waiting(bus: Any, most: int) -> Iterator[can.Message | Exception | None]:
    """Yield what waits, or what the interface raised in its place; None where nothing waits."""
    failures = 0
    for _ in range(most):
        try:
            message = receive(bus)
        except Exception as error:  # each interface raises its own kinds
            yield error
            failures += 1
            if failures == MOST_FAILURES:
                return
        else:
            yield message
            if message is None:
                return
