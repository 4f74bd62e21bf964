"""Logs that are cut off, damaged or no logs: whole frames, and the error with its place."""

import gzip
from itertools import islice
from pathlib import Path

import can
import pytest

from canshaper.errors import CutOffError, LogError
from canshaper.recording.log import FORMATS, LogFile
from tests.recording.lines import FRAMES, HEADER, LINES, error_of, log, prefix
from tests.recording.writing import messages, written


@pytest.mark.parametrize("suffix", ["log", "asc", "csv"])
def test_a_text_cut_off_anywhere_gives_whole_frames_and_says_so(
    tmp_path: Path, suffix: str
) -> None:
    whole = written(tmp_path / f"a.{suffix}", messages(FRAMES))
    content, frames = whole.read_bytes(), list(LogFile(whole))
    cut = tmp_path / f"cut.{suffix}"
    for size in range(1, len(content)):
        cut.write_bytes(content[:size])
        before, error = prefix(cut)
        assert before == frames[: len(before)]
        if content[size - 1] != ord("\n"):
            assert isinstance(error, CutOffError), content[:size]
            assert f"{cut}:" in str(error)
        elif before:
            assert error is None


def test_a_blf_cut_off_anywhere_gives_whole_frames_and_says_so(tmp_path: Path) -> None:
    whole = tmp_path / "a.blf"
    with can.BLFWriter(whole, compression_level=0) as writer:
        writer.max_container_size = 100
        later = [f._replace(time_ns=f.time_ns + i * 10**10) for i in range(3) for f in FRAMES]
        for message in messages(later):
            writer.on_message_received(message)
    content, frames = whole.read_bytes(), prefix(whole)[0]
    cut = tmp_path / "cut.blf"
    ends = 0
    for size in range(144, len(content)):
        cut.write_bytes(content[:size])
        before, error = prefix(cut)
        assert before == frames[: len(before)]
        ends += not isinstance(error, CutOffError)
    # Only just behind one of its parts is it whole; a byte of padding may still follow that.
    assert ends <= 4 * len(content) // 100


def test_a_packed_log_that_is_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "a.log.gz"
    content = gzip.compress("".join(LINES * 1).encode())
    path.write_bytes(content[:-4])
    before, error = prefix(path)
    assert isinstance(error, CutOffError)
    assert len(before) == len(FRAMES)
    path.write_bytes(content[:20] + b"\x00\xff\x00" + content[23:])
    assert "damaged" in error_of(path) or "expected" in error_of(path)


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.log", "(1.0) can0 110#012\n", "expected a line of candump -L, such as ("),
        ("a.log", "(1.0) can0 110#010203040506070809\n", "expected a line of candump -L, "),
        (
            "a.log",
            "(1.0) can0 FFF#\n",
            "expected an id of 11 bits in 3 digits, or of 29 in 8, got id 0xfff",
        ),
        ("a.log", "", "expected a log with frames, its suffix that of its format, got no frame"),
        (
            "a.log",
            "(1.0) can0 110#R\n" * 2 + "(1.0) can0 20000080#\n",
            "expected a data frame, got other frames only: 2 remote, 1 error",
        ),
        ("a.log", "x" * 70_000, "65536 bytes without a line end"),
        ("a.asc", "1.0 1 Joystick Rx d 1 01\n", "expected a line of an ASC log, such as"),
        ("a.asc", "1.0 1 110 Rx d 3 01 02\n", "expected all of them, got 2 of 3 bytes"),
        ("a.asc", "1.0 1 110 Rx d 1 1FF\n", "with numbers"),
        ("a.asc", "1.0 1 900 Rx d 1 1F\n", "got id 0x900"),
        (
            "a.csv",
            "time;id;value\n",
            "a.csv:1: expected a header that names time, id and data, such as"
            " Time;Channel;ID;DLC;Data, got 'time;id;value'",
        ),
        ("a.blf", "LOGG", "expected a BLF log that is whole, got error"),
        ("a.blf", "x" * 200, "got BLFParseError Unexpected file format"),
        (
            "a.xyz",
            "",
            f"expected the suffix {', '.join(FORMATS)}, each but .db also with .gz behind, got"
            " '.xyz'",
        ),
        ("drive", "", "each but .db also with .gz behind, got none"),
    ],
)
def test_what_is_no_log_is_reported_with_its_place(
    tmp_path: Path, name: str, content: str, text: str
) -> None:
    message = error_of(log(tmp_path, content, name=name))
    assert text in message
    assert str(tmp_path / name) in message


@pytest.mark.parametrize(
    "line",
    [
        "1.0 1 110 Rx d -1 01 02",
        "1.0 1 110 Rx d",
        "1.0 1 110 Rx d 2 0_1 02",
        "1.0 1 110 Rx d \u0661 01",
        "1.0 CANFD 1 Rx 110 1 0 2 ² 01 02 0 0 0",
        "1.0 CANFD 1 Rx 110 1 0 2 2 01 02 0 0 zz",
    ],
)
def test_a_line_of_asc_with_what_is_no_number(tmp_path: Path, line: str) -> None:
    expected = "expected a line of an ASC log, such as 0.015991 1 110 Rx d 2 01 02, with numbers"
    message = error_of(log(tmp_path, line, "\n", name="a.asc"))
    assert message == f"{tmp_path / 'a.asc'}:1: {expected}, got {line!r}"


@pytest.mark.parametrize(
    ("row", "text"),
    [
        ("1.0,0x110,0,0,0,2,AQI", "a.csv:2: expected a row of timestamp,"),
        ("1.0,0x110,0,0,0,3,AQI=", "expected all of them, got 2 of 3 bytes"),
        ("1.0,0x800,0,0,0,2,AQI=", "got id 0x800"),
        ("1.0.0,0x110,0,0,0,2,AQI=", "a row of timestamp,"),
        ("1.0,272,0,0,0,2,AQI=", "a row of timestamp,"),
        ("1e999,0x110,0,0,0,2,AQI=", "a.csv:2: expected ..., got '1e999,0x110"),
        (f"1.0,0x110,0,0,0,{'1' * 5000},AQI=", "a.csv:2: expected ..., got '1.0,0x110"),
        (f"1.0,0x{'f' * 5000},0,0,0,2,AQI=", "a.csv:2: expected ..., got '1.0,0xfff"),
    ],
)
def test_a_wrong_row_of_a_table(tmp_path: Path, row: str, text: str) -> None:
    message = error_of(log(tmp_path, HEADER, row, "\n", name="a.csv"))
    assert all(part in message for part in text.split("..."))


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    says = "expected a log that can be read, got "
    for name in ("no.log", "no.asc", "no.blf", "no.log.gz"):
        path = tmp_path / name
        assert error_of(path) == f"{path}: {says}No such file or directory"
    (tmp_path / "x.log").mkdir()
    assert f"{says}Is a directory" in error_of(tmp_path / "x.log")


IMPOSSIBLE = "frame 1: expected a data frame, got other frames only: 1 impossible"


@pytest.mark.parametrize(
    ("at", "value", "text"),
    [
        (
            24,
            b"\xff" * 8,
            "frame 1: expected a date before 2286, or a time from the start of the log, got a time"
            " further than 10000000000 s",
        ),  # ns
        (36, b"\x00\x08\x00\x00", IMPOSSIBLE),
        (45, b"\x00", IMPOSSIBLE),  # flags of FD
    ],
)
def test_a_damaged_object_of_a_blf(tmp_path: Path, at: int, value: bytes, text: str) -> None:
    path = tmp_path / "a.blf"
    fd = at == 45
    message = can.Message(
        timestamp=1.0, arbitration_id=1, is_extended_id=False, is_fd=fd, data=bytes(12 if fd else 8)
    )
    with can.BLFWriter(path, compression_level=0) as writer:
        writer.on_message_received(message)
    content = bytearray(path.read_bytes())
    at += content.rindex(b"LOBJ")
    content[at : at + len(value)] = value
    path.write_bytes(content)
    with pytest.raises(LogError) as error:
        list(islice(LogFile(path), 5))  # without end where an object has no length
    assert f"{path}: {text}" in str(error.value)
