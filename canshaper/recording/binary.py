"""Logs that are not text: MF4, read by asammdf, and the database of python-can's logger."""

import marshal
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import IO, BinaryIO

from canshaper.errors import LogError
from canshaper.recording.channels import MOST_BYTES, Place, TimedFrame
from canshaper.recording.form import install
from canshaper.recording.mf4_child import WHOLE

# A float of that many seconds still holds nanoseconds; a date holds microseconds.
FINE_S = 4e6
_new = tuple.__new__  # TimedFrame(...) in half the time


def mf4(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Data frames of all bus events, by time to the ns; those of one group in their order."""
    with tempfile.TemporaryDirectory() as folder:
        path = place.path
        if path.suffix.lower() != ".mf4":  # packed
            path = Path(folder) / "log.mf4"
            with path.open("wb") as copy:
                shutil.copyfileobj(file, copy)
        command = [sys.executable, "-m", "canshaper.recording.mf4_child", str(path)]
        with subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        ) as process:
            try:
                assert process.stdout is not None
                yield from _handed_over(process.stdout, place)
            finally:
                process.kill()


def _handed_over(pipe: IO[bytes], place: Place) -> Iterator[TimedFrame]:
    """Frames that the other process has read."""
    while True:
        try:
            part = marshal.load(pipe)
        except (EOFError, ValueError, TypeError):
            raise place.error("one at which asammdf crashed", WHOLE) from None
        if isinstance(part, list):
            for row in part:
                place.number += 1
                yield _new(TimedFrame, row)
            continue
        place.left_out.update(part["left out"])
        if part["fault"]:
            got, expected = part["fault"]
            if not expected:
                raise LogError(f"{place.path}: MF4 logs need {got}, {install('mf4')}")
            raise place.error(got, expected)
        return


def database(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """The database of python-can's logger; without channels, and which frames are of CAN FD."""
    left_out = place.left_out
    try:
        with closing(sqlite3.connect(place.path)) as connection:
            rows = connection.execute("SELECT * FROM messages")
            for number, (time_s, can_id, wide, remote, error, _, data) in enumerate(rows, start=1):
                place.number = number
                if error or remote:
                    left_out["error" if error else "remote"] += 1
                    continue
                content = b"" if data is None else data
                if can_id >> (29 if wide else 11) or len(content) > MOST_BYTES:
                    left_out["impossible"] += 1
                    continue
                frame = (_nanoseconds(time_s), "", can_id, bool(wide), bytes(content))
                yield _new(TimedFrame, frame)
    except (sqlite3.Error, OverflowError, TypeError, ValueError) as error:
        raise place.error(_reason(error), "a database of python-can's logger") from error


def _nanoseconds(time_s: float) -> int:
    """Round a time to what a float can hold: ns of a short one, us of a date."""
    return round(time_s * 1e9) if time_s < FINE_S else round(time_s * 1e6) * 1000


def _reason(error: Exception) -> str:
    return f"{type(error).__name__} {error}".rstrip()
