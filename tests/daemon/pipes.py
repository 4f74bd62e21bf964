"""A pipe that a handler of the log writes to."""

import errno
import logging
import os

# Only to end a test that hangs: nothing here waits for anything.
ANSWER_S = 30
PIPE_BYTES = 65_536


class Pipe:
    """A pipe in its usual, blocking mode, with its reader's end."""

    def __init__(self) -> None:
        self.reader, self.writer = os.pipe()
        os.set_blocking(self.reader, False)

    def read(self) -> str:
        """All that waits."""
        data = b""
        while True:
            try:
                part = os.read(self.reader, PIPE_BYTES)
            except BlockingIOError:
                break
            if not part:
                break
            data += part
        return data.decode()

    def lines(self) -> list[str]:
        return self.read().splitlines()

    def close(self) -> None:
        for one in (self.reader, self.writer):
            try:
                os.close(one)
            except OSError as error:
                assert error.errno == errno.EBADF  # closed by the test


def log(handler: logging.Handler, text: str, level: int = logging.INFO) -> None:
    handler.handle(logging.LogRecord("canshaper", level, "", 0, text, (), None))
