"""The log on pipes, disks and terminals that take nothing: never a wait for a reader."""

import os
import re

import pytest

from canshaper.daemon.journal import MOST_LINES, JournalHandler
from tests.daemon.pipes import Pipe, log

pytestmark = [pytest.mark.processes, pytest.mark.usefixtures("never_wait")]


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
