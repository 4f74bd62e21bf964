"""Logs that are not text: BLF and the database of python-can's logger."""

import sqlite3
import struct
from contextlib import closing
from pathlib import Path

import can
import pytest

from canshaper.recording.log import LogFile, TimedFrame
from tests.recording.lines import error_of, kept
from tests.recording.writing import written


def test_an_id_that_none_can_be_does_not_stop_a_blf(tmp_path: Path) -> None:
    frames = [
        can.Message(timestamp=1.0, arbitration_id=n, is_extended_id=False, data=[n % 256])
        for n in (1, 0x4444444, 2)
    ]
    file = LogFile(written(tmp_path / "a.blf", frames))
    assert [f.can_id for f in file] == [1, 2]
    assert file.left_out == {"impossible": 1}


def blf_object(kind: int, body: bytes, header: bytes = bytes(16), version: int = 1) -> bytes:
    length = 16 + len(header) + len(body)
    head = struct.pack("<4sHHLL", b"LOBJ", 16 + len(header), version, length, kind)
    return head + header + body + bytes(length % 4)


def blf_file(path: Path, start: bytes, *containers: bytes) -> Path:
    """With these uncompressed containers behind the header of another log."""
    path.write_bytes(start + b"".join(blf_object(10, bytes(16) + c, b"") for c in containers))
    return path


def test_objects_of_blf_of_every_kind_and_cut_at_containers(tmp_path: Path) -> None:
    start = written(tmp_path / "a.blf", [can.Message(timestamp=0.0)]).read_bytes()[:144]
    microseconds = struct.pack("<LHHQ", 1, 0, 0, 7)
    nanoseconds = struct.pack("<LHHQ", 2, 0, 0, 70_001)
    second_version = struct.pack("<LBxHQQ", 2, 0, 0, 70_002, 0)
    last = struct.pack("<LHHQ", 2, 0, 0, 70_003)
    frame = struct.pack("<HBBL8s", 2, 1, 3, 0x80000123, b"abcdefgh")
    remote = struct.pack("<HBBL8s", 2, 0x80, 3, 0x123, bytes(8))
    fd = struct.pack("<HBBLLBBB5x12s", 2, 0, 9, 0x124, 0, 0, 1, 12, b"abcdefghijkl")
    fd_64 = struct.pack("<BBBB7LHBBL", 2, 9, 12, 0, 0x80000125, 0, 0x1000, *[0] * 4, 0, 0, 0, 0)
    cut = struct.pack("<BBBB7LHBBL", 2, 9, 12, 0, 0x126, 0, 0x1000, *[0] * 4, 0, 0, 76, 0)
    remote_64 = struct.pack("<BBBB7LHBBL", 2, 9, 0, 0, 0x127, 0, 0x10, *[0] * 4, 0, 0, 0, 0)
    objects = b"".join(
        (
            blf_object(86, frame, microseconds),
            blf_object(65, b"a text", microseconds),
            blf_object(1, frame + b"more", nanoseconds),
            blf_object(1, frame, microseconds, version=3),
            blf_object(86, remote, nanoseconds),
            blf_object(86, frame, second_version, version=2),
            blf_object(100, fd, last),
            blf_object(101, fd_64 + b"abcdefghijkl", last),
            blf_object(101, cut + b"abcd, and more", last),
            blf_object(101, remote_64, last),
            blf_object(73, bytes(32), last),
        )
    )
    expected = [TimedFrame(ns, "2", 0x123, True, b"abc") for ns in (70_000, 70_001, 70_002)] + [
        TimedFrame(70_003, "2", 0x124, False, b"abcdefghijkl"),
        TimedFrame(70_003, "2", 0x125, True, b"abcdefghijkl"),
        TimedFrame(70_003, "2", 0x126, False, b"abcd" + bytes(8)),
    ]
    for cut in range(len(objects)):
        file = LogFile(blf_file(tmp_path / "b.blf", start, objects[:cut], objects[cut:]))
        assert [f._replace(time_ns=f.time_ns % 10**6) for f in file] == expected, cut
        assert file.left_out == {"remote": 2, "error": 1}
    with can.BLFReader(tmp_path / "b.blf") as reader:  # which knows no third version either
        theirs = [m for m in reader if not m.is_remote_frame and not m.is_error_frame]
    assert [(m.arbitration_id, m.is_extended_id, bytes(m.data)) for m in theirs] == [
        frame[2:] for frame in expected
    ]


@pytest.mark.parametrize(
    ("objects", "text"),
    [
        (struct.pack("<4sHHLL", b"LOBJ", 16, 1, 0, 65) * 2, "got ValueError an object of 0 bytes"),
        (struct.pack("<4sHHLL20x", b"LOBJ", 32, 1, 36, 86), "got ValueError a frame of 36 bytes"),
        (bytes(20), "got ValueError no object where the next one should be"),
    ],
)
def test_a_damaged_blf(tmp_path: Path, objects: bytes, text: str) -> None:
    start = written(tmp_path / "a.blf", [can.Message(timestamp=0.0)]).read_bytes()[:144]
    assert text in error_of(blf_file(tmp_path / "b.blf", start, objects))


# -- python-can's database -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ("DROP TABLE messages", "expected a database of python-can's logger, got OperationalError"),
        ("ALTER TABLE messages ADD COLUMN more", "expected a database of python-can's logger, got"),
        ("UPDATE messages SET ts = 9e999", "a.db: frame 1: expected a database of python-can's"),
        ("UPDATE messages SET data = 99999999999", "a.db: frame 1: expected a database of"),
        ("UPDATE messages SET data = 'text'", "a.db: frame 1: expected a database of"),
        ("UPDATE messages SET arbitration_id = 'x'", "a.db: frame 1: expected a database of"),
    ],
)
def test_another_database(tmp_path: Path, change: str, text: str) -> None:
    message = can.Message(timestamp=1.0, arbitration_id=1, is_extended_id=False, data=[1])
    path = written(tmp_path / "a.db", [message])
    connection = sqlite3.connect(path)
    connection.execute(change)
    connection.commit()
    connection.close()
    assert text in error_of(path)


def test_a_database_does_not_say_which_frames_are_of_can_fd(tmp_path: Path) -> None:
    lengths = [8, 12, 64]
    frames = [
        can.Message(timestamp=n, arbitration_id=n, data=bytes(n), is_fd=n > 8) for n in lengths
    ]
    path = written(tmp_path / "a.db", frames)
    file = LogFile(path)
    assert [len(frame.data) for frame in file] == lengths
    assert not file.left_out
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("UPDATE messages SET data = zeroblob(65) WHERE arbitration_id = 12")
        connection.commit()
    assert [len(frame.data) for frame in file] == [8, 64]
    assert file.left_out == {"impossible": 1}


def test_what_is_no_database(tmp_path: Path) -> None:
    assert "file is not a database" in error_of(kept(tmp_path, "a.db", "x" * 1000))
    assert "each but .db also with .gz behind, got '.db.gz'" in error_of(
        kept(tmp_path, "a.db.gz", "")
    )
