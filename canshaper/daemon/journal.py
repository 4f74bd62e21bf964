"""The log of the daemon: one line per event on standard error, and never a wait for its reader.

A blocked pipe, a full disk or a reader that has gone would otherwise stop the control loop.
"""

import logging
import os
import select
from collections import deque

from canshaper.errors import printable

STANDARD_ERROR = 2
# Lines kept for a reader that is slow for a moment; more are dropped and counted.
MOST_LINES = 200
# A pipe that says it is writable takes that much without blocking (POSIX: PIPE_BUF, 4096 on Linux).
MOST_BYTES = select.PIPE_BUF
# Priorities of syslog(3), which the journal reads from the start of a line.
PRIORITY = {logging.DEBUG: "<7>", logging.INFO: "<6>", logging.WARNING: "<4>"}


class JournalHandler(logging.Handler):
    """Writes to a file descriptor only what it takes at once.

    Args:
        fd: where to write.
        journal: whether the journal of systemd reads it: priorities instead of times.
    """

    def __init__(self, fd: int, *, journal: bool) -> None:
        super().__init__()
        self._fd = _own_terminal(fd)
        self._journal = journal
        self._lines: deque[bytes] = deque()
        self._dropped = 0
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLOUT)
        line = "%(message)s" if journal else "%(asctime)s %(levelname)s %(message)s"
        self.setFormatter(logging.Formatter(line))

    def emit(self, record: logging.LogRecord) -> None:
        """Queue the record, and write what can be written now."""
        try:
            text = self.format(record)
        except Exception as error:  # a wrong call of some library must not end the loop
            text = f"{record.msg!r} ({error})"
        self._add(text, record.levelno)
        self.flush()

    def flush(self) -> None:
        """Write lines while they are accepted at once; where writing fails, all are lost."""
        while self._lines and self._writable():
            line = self._lines[0]
            try:
                written = os.write(self._fd, line)
            except BlockingIOError:
                return
            except OSError:  # disk full, reader gone
                self._dropped += len(self._lines)
                self._lines.clear()
                return
            if written < len(line):
                self._lines[0] = line[written:]
                continue
            self._lines.popleft()
            if self._dropped and len(self._lines) < MOST_LINES // 2:
                dropped, self._dropped = self._dropped, 0
                self._add(f"{dropped} lines of the log were lost", logging.WARNING)

    def _add(self, text: str, level: int) -> None:
        if len(self._lines) >= MOST_LINES:
            self._dropped += 1
            return
        # Text of others, a peer's name or a piece of a file, must not look like a line of ours.
        text = printable(text.replace("\n", " | "))
        if self._journal:
            text = PRIORITY.get(level, "<3>") + text
        self._lines.append(text.encode(errors="replace")[: MOST_BYTES - 1] + b"\n")

    def _writable(self) -> bool:
        return any(events & select.POLLOUT for _, events in self._poll.poll(0))


def _own_terminal(fd: int) -> int:
    """A terminal that says it is writable may take one byte; opened again, it can refuse the rest.

    To set the flag on the descriptor we were given would set it for the shell, too.
    """
    try:
        if os.isatty(fd):
            return os.open(os.ttyname(fd), os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        pass
    return fd


def set_up() -> JournalHandler:
    """Let the daemon log to standard error; what is no event of ours from warnings on."""
    handler = JournalHandler(STANDARD_ERROR, journal=_is_journal(STANDARD_ERROR))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    logging.getLogger("canshaper").setLevel(logging.INFO)
    return handler


def _is_journal(fd: int) -> bool:
    """Whether systemd has connected the descriptor to its journal (systemd.exec(5))."""
    try:
        info = os.fstat(fd)
    except OSError:  # closed
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{info.st_dev}:{info.st_ino}"
