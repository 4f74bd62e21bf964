"""The log of the daemon: one line per event on standard error, without a wait for its reader.

Otherwise a blocked pipe, a full disk or a closed reader would stop the control loop.
"""

import logging
import os
import select
from collections import deque

from canshaper.errors import printable

STANDARD_ERROR = 2
# Most lines kept for a slow reader; further lines are dropped and counted.
MOST_LINES = 200
# Bytes that a writable pipe takes without blocking (POSIX: PIPE_BUF, 4096 on Linux).
MOST_BYTES = select.PIPE_BUF
# Priorities of syslog(3), which the journal reads at the start of a line.
PRIORITY = {logging.DEBUG: "<7>", logging.INFO: "<6>", logging.WARNING: "<4>"}


class JournalHandler(logging.Handler):
    """Writes lines to a file descriptor, as far as that takes them at once; keeps the others.

    Beyond ``MOST_LINES`` it drops lines, and later logs how many.

    Args:
        fd: file descriptor to write to.
        journal: whether the journal of systemd reads it; lines then begin with a priority instead
            of a time.
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
        """Queue the record, and write as many lines as the descriptor takes now."""
        try:
            text = self.format(record)
        except Exception as error:  # a wrong logging call of a library must not end the loop
            text = f"{record.msg!r} ({error})"
        self._add(text, record.levelno)
        self.flush()

    def flush(self) -> None:
        """Write lines while the descriptor takes them at once; if writing fails, drop them all."""
        while self._lines and any(events & select.POLLOUT for _, events in self._poll.poll(0)):
            line = self._lines[0]
            try:
                written = os.write(self._fd, line)
            except BlockingIOError:
                return
            except OSError:  # the disk is full, or the reader is gone
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
        # A client's name or a part of a file in the text must not look like a line of its own.
        text = printable(text.replace("\n", " | "))
        if self._journal:
            text = PRIORITY.get(level, "<3>") + text
        self._lines.append(text.encode(errors="replace")[: MOST_BYTES - 1] + b"\n")


def _own_terminal(fd: int) -> int:
    """Return a non-blocking descriptor of the same terminal; any other descriptor as it is.

    A writable terminal may take one byte and block at the next. To set O_NONBLOCK on the descriptor
    that we were given would set it for the shell, too.
    """
    try:
        if os.isatty(fd):
            return os.open(os.ttyname(fd), os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        pass
    return fd


def set_up() -> JournalHandler:
    """Let the daemon log its events to standard error, and warnings of other packages."""
    handler = JournalHandler(STANDARD_ERROR, journal=_is_journal(STANDARD_ERROR))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    logging.getLogger("canshaper").setLevel(logging.INFO)
    return handler


def _is_journal(fd: int) -> bool:
    """Return whether systemd has connected a descriptor to its journal (systemd.exec(5))."""
    try:
        info = os.fstat(fd)
    except OSError:  # closed
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{info.st_dev}:{info.st_ino}"
