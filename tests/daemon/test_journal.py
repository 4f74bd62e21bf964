"""The log on real pipes and devices: a line for each event, in the form that its reader takes."""

import logging
import os
import re
import subprocess
import sys

import pytest

from canshaper.daemon.journal import MOST_BYTES, JournalHandler
from tests.daemon.pipes import ANSWER_S, Pipe, log

pytestmark = [pytest.mark.processes, pytest.mark.usefixtures("never_wait")]


@pytest.mark.parametrize(
    ("level", "prefix"), [(logging.INFO, "<6>"), (logging.WARNING, "<4>"), (logging.ERROR, "<3>")]
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
    """Text that a process writes to a pipe that is its standard error."""
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
    assert written.splitlines() == ["<6>axis=slew", "<4>fault=CHECKSUM", "<3>worst", "<4>careful"]


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
