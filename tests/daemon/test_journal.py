"""The log on real pipes and devices: a line for each event, and never a wait for a reader."""

import errno
import logging
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from types import FrameType

import pytest

from canshaper.daemon.journal import MOST_BYTES, MOST_LINES, JournalHandler

pytestmark = pytest.mark.processes

# Only to end a test that hangs: nothing here waits for anything.
ANSWER_S = 30
PIPE_BYTES = 65_536


@pytest.fixture(autouse=True)
def never_wait() -> Iterator[None]:
    """A handler that blocks, or never comes to an end, is interrupted and fails the test."""

    def hung(_number: int, _frame: FrameType | None) -> None:
        pytest.fail("the handler did not return")  # no OSError: those it catches

    before = signal.signal(signal.SIGALRM, hung)
    signal.alarm(ANSWER_S)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


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


@pytest.fixture
def pipe() -> Iterator[Pipe]:
    opened = Pipe()
    yield opened
    opened.close()


def log(handler: logging.Handler, text: str, level: int = logging.INFO) -> None:
    handler.handle(logging.LogRecord("canshaper", level, "", 0, text, (), None))


# -- lines -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("level", "prefix"),
    [(logging.INFO, "<6>"), (logging.WARNING, "<4>"), (logging.ERROR, "<3>")],
)
def test_the_journal_gets_the_priority_before_the_line(pipe: Pipe, level: int, prefix: str) -> None:
    log(JournalHandler(pipe.writer, journal=True), "axis=slew state=READY", level)
    assert pipe.read() == f"{prefix}axis=slew state=READY\n"


def test_a_person_gets_the_time_and_the_level(pipe: Pipe) -> None:
    log(JournalHandler(pipe.writer, journal=False), "axis=slew", logging.WARNING)
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} WARNING axis=slew\n", pipe.read())


def test_an_event_is_one_line_whatever_it_holds(pipe: Pipe) -> None:
    handler = JournalHandler(pipe.writer, journal=True)
    log(handler, "one\ntwo\n")
    log(handler, "µ \udcff")
    try:
        raise ValueError("broken")
    except ValueError:
        record = logging.LogRecord("x", logging.ERROR, "", 0, "failed", (), sys.exc_info())
        handler.handle(record)
    first, second, third = pipe.lines()
    assert first == "<6>one | two | "
    assert second == "<6>µ \\udcff"
    assert third.startswith("<3>failed | Traceback")
    assert third.endswith("ValueError: broken")


@pytest.mark.parametrize("length", [MOST_BYTES - 5, MOST_BYTES - 4, MOST_BYTES, 100_000])
def test_a_long_line_is_cut_to_what_a_pipe_takes_at_once(pipe: Pipe, length: int) -> None:
    handler = JournalHandler(pipe.writer, journal=True)
    log(handler, "x" * length)
    log(handler, "next")
    line, following = pipe.lines()
    assert line == "<6>" + "x" * min(length, MOST_BYTES - 4)
    assert following == "<6>next"


# -- a reader that is slow, and one that has gone --------------------------------------------------


def test_a_full_pipe_is_not_waited_for(pipe: Pipe) -> None:
    handler = JournalHandler(pipe.writer, journal=True)
    for number in range(5000):
        log(handler, f"{number:4} " + "x" * 100)
    lines = pipe.lines()
    assert 0 < len(lines) < 5000
    assert [line[3:8] for line in lines] == [f"{n:4} " for n in range(len(lines))]


def test_some_lines_are_kept_the_others_are_counted_and_reported(pipe: Pipe) -> None:
    """Every line is either there, in order, or in the count."""
    handler = JournalHandler(pipe.writer, journal=True)
    total = 5000
    for number in range(total):
        log(handler, f"{number} " + "x" * 100)
    lines = pipe.lines()
    at_once = len(lines)
    for _ in range(10):
        handler.flush()
        lines += pipe.lines()
    reported = [
        int(n) for line in lines for n in re.findall(r"(\d+) lines of the log were lost", line)
    ]
    numbers = [int(n) for line in lines for n in re.findall(r"^<6>(\d+) x", line)]
    assert numbers == list(range(at_once + MOST_LINES))
    assert sum(reported) == total - len(numbers)
    log(handler, "and on")
    assert pipe.lines() == ["<6>and on"]


def test_a_slow_reader_gets_whole_lines_in_order(pipe: Pipe) -> None:
    """It reads a little, now and then: nothing is lost, nothing is cut in two."""
    handler = JournalHandler(pipe.writer, journal=True)
    received = b""
    total = 1000
    for number in range(total):
        log(handler, f"{number} " + "x" * 2000)
        if number >= MOST_LINES // 2:
            received += os.read(pipe.reader, 2100)
    while received.count(b"\n") < total:
        received += os.read(pipe.reader, 3000)
        handler.flush()
    numbers = [int(n) for n in re.findall(r"<6>(\d+) x{2000}\n", received.decode())]
    assert numbers == list(range(total))


@pytest.mark.parametrize("lines", [1, 2, 1000])
def test_a_reader_that_has_gone_stops_nothing(pipe: Pipe, lines: int) -> None:
    """EPIPE: Python ignores the signal, the write fails."""
    os.close(pipe.reader)
    handler = JournalHandler(pipe.writer, journal=True)
    for number in range(lines):
        log(handler, f"line {number}")
    handler.flush()


@pytest.mark.parametrize("lines", [1, 2, 1000])
def test_a_full_disk_stops_nothing(lines: int) -> None:
    fd = os.open("/dev/full", os.O_WRONLY)
    try:
        handler = JournalHandler(fd, journal=True)
        for number in range(lines):
            log(handler, f"line {number}")
        handler.flush()
    finally:
        os.close(fd)


def test_after_a_full_disk_the_log_goes_on_and_reports_the_gap(pipe: Pipe) -> None:
    full = os.open("/dev/full", os.O_WRONLY)
    fd = os.dup(full)
    handler = JournalHandler(fd, journal=True)
    try:
        for number in range(10):
            log(handler, f"line {number}")
        os.dup2(pipe.writer, fd)  # there is room again
        log(handler, "there is room")
        handler.flush()
        lines = pipe.lines()
    finally:
        os.close(full)
        os.close(fd)
    assert "<6>there is room" in lines
    reported = [
        int(n) for line in lines for n in re.findall(r"(\d+) lines of the log were lost", line)
    ]
    assert sum(reported) == 10


def test_kept_lines_that_find_the_disk_full_are_counted_too(pipe: Pipe) -> None:
    jammed = Pipe()
    full = os.open("/dev/full", os.O_WRONLY)
    fd = os.dup(jammed.writer)
    handler = JournalHandler(fd, journal=True)
    total = 1000
    try:
        for number in range(total):
            log(handler, f"{number} " + "x" * 1000)
        written = len(jammed.lines())
        os.dup2(full, fd)
        handler.flush()
        os.dup2(pipe.writer, fd)
        log(handler, "there is room")
        handler.flush()
    finally:
        os.close(full)
        os.close(fd)
        jammed.close()
    lines = pipe.lines()
    assert lines[0] == "<6>there is room"
    assert lines[1:] == [f"<4>{total - written} lines of the log were lost"]


def test_a_terminal_that_no_one_reads_stops_nothing() -> None:
    """A shell over a network that stalls: the terminal has room for a part of a line only."""
    master, slave = os.openpty()
    try:
        handler = JournalHandler(slave, journal=False)
        for number in range(5000):
            log(handler, f"line {number} " + "x" * 100)
    finally:
        os.close(master)
        os.close(slave)


@pytest.mark.parametrize(("message", "arguments"), [("%d", ("x",)), ("%s %s", ("one",))])
def test_a_record_that_cannot_be_formatted_stops_nothing(
    pipe: Pipe, message: str, arguments: tuple[str, ...]
) -> None:
    """A library may log it; the other handlers of logging go on after it too."""
    handler = JournalHandler(pipe.writer, journal=True)
    handler.handle(logging.LogRecord("x", logging.WARNING, "", 0, message, arguments, None))
    log(handler, "next")
    assert pipe.lines()[-1] == "<6>next"


# -- standard error of a daemon --------------------------------------------------------------------

SET_UP = """
import logging
from canshaper.daemon import journal
journal.set_up()
logging.getLogger("canshaper").info("axis=slew")
logging.getLogger("canshaper").debug("no")
logging.getLogger("canshaper").warning("fault=CHECKSUM")
logging.getLogger("canshaper").critical("worst")
logging.getLogger("library").info("no")
logging.getLogger("library").warning("careful")
"""


def standard_error(environment: dict[str, str], pipe: Pipe) -> str:
    """What a process writes to a pipe that is its standard error."""
    subprocess.run(
        [sys.executable, "-c", SET_UP],
        stderr=pipe.writer,
        check=True,
        env={**os.environ, **environment},
        timeout=ANSWER_S,
    )
    return pipe.read()


def test_the_journal_is_known_by_device_and_inode(pipe: Pipe) -> None:
    info = os.fstat(pipe.writer)
    written = standard_error({"JOURNAL_STREAM": f"{info.st_dev}:{info.st_ino}"}, pipe)
    assert written.splitlines() == [
        "<6>axis=slew",
        "<4>fault=CHECKSUM",
        "<3>worst",
        "<4>careful",
    ]


@pytest.mark.parametrize("stream", ["", "1:2"])
def test_any_other_standard_error_is_for_people(pipe: Pipe, stream: str) -> None:
    """Also that of a program which a unit has started and connected to something else."""
    lines = standard_error({"JOURNAL_STREAM": stream}, pipe).splitlines()
    assert [re.sub(r"^[-\d]+ [:,\d]+ ", "", line) for line in lines] == [
        "INFO axis=slew",
        "WARNING fault=CHECKSUM",
        "CRITICAL worst",
        "WARNING careful",
    ]
