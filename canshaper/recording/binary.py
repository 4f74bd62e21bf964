"""Readers of binary logs: MF4, MCAP, and the database of python-can's logger.

asammdf reads MF4; the schema of frames in MCAP is canshaper's own.
"""

import marshal
import shutil
import sqlite3
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import IO, Any, BinaryIO

from canshaper.codec.layout import CLASSICAL_BYTES
from canshaper.errors import LogError
from canshaper.recording.channels import MOST_BYTES, Place, TimedFrame, fits
from canshaper.recording.form import install
from canshaper.recording.mf4_child import WHOLE

# A float of that many seconds still holds nanoseconds; a date holds microseconds.
FINE_S = 4e6
_new = tuple.__new__  # TimedFrame(...) in half the time


def mf4(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Yield the data frames of all groups of bus events, merged by their times, to the ns."""
    with tempfile.TemporaryDirectory() as folder:
        path = place.path
        if path.suffix.lower() != ".mf4":  # packed
            path = Path(folder) / "log.mf4"
            with path.open("wb") as copy:
                shutil.copyfileobj(file, copy)
        command = [sys.executable, "-m", "canshaper.recording.mf4_child", str(path)]
        with subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        ) as process:
            try:
                assert process.stdout is not None
                yield from _handed_over(process.stdout, place)
            finally:
                process.kill()


def _handed_over(pipe: IO[bytes], place: Place) -> Iterator[TimedFrame]:
    """Yield the frames that the child process has read; raise LogError for its fault."""
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
    """Yield the data frames of python-can's database at ``place.path``; all channels are empty."""
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
    """Return a time in ns, rounded to what its float holds: to ns below ``FINE_S``, else to us."""
    return round(time_s * 1e9) if time_s < FINE_S else round(time_s * 1e6) * 1000


def _reason(error: Exception) -> str:
    return f"{type(error).__name__} {error}".rstrip()


MOST_NAMED = 5
# Errors that mcap raises for a damaged file, besides its own ones.
DAMAGED = (
    ArithmeticError,
    LookupError,
    MemoryError,
    RuntimeError,
    TypeError,
    ValueError,
    struct.error,
)


def mcap(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Yield the data frames of topics with the schema canshaper.CanFrame, in the file's order."""
    try:
        from mcap.exceptions import McapError  # noqa: PLC0415  (an extra)
        from mcap.stream_reader import CRCValidationError  # noqa: PLC0415
        from zstandard import ZstdError  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise LogError(f"{place}: MCAP logs need {error.name}, {install('mcap')}") from None
    try:
        yield from _frames(file, place)
    except CRCValidationError as error:
        got = f"a damaged chunk ({error})"
        raise place.error(got, "an MCAP log that is whole (mcap recover keeps the rest)") from None
    except LogError:
        raise
    except (McapError, ZstdError, *DAMAGED) as error:
        if not file.read(1):
            raise place.cut_off("its end is missing (mcap recover makes its index)") from None
        raise place.error(_reason(error), "an MCAP log that is whole") from None


def _frames(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    from google.protobuf.message import DecodeError  # noqa: PLC0415
    from mcap.records import Channel, Message, Schema  # noqa: PLC0415
    from mcap.stream_reader import StreamReader  # noqa: PLC0415

    from canshaper.recording.mcap_write import FRAME, KINDS  # noqa: PLC0415
    from canshaper.recording.mcap_write import Schema as Ours  # noqa: PLC0415

    parse, left_out = Ours(FRAME).message.FromString, place.left_out
    others: dict[str, str] = {}
    names: dict[int, str] = {}
    schemas: dict[int, str] = {}
    records: Iterator[Any] = StreamReader(file, validate_crcs=True).records
    for record in records:
        if type(record) is Message:
            name = names.get(record.channel_id)
            if name is None:
                continue
            place.number += 1
            try:
                one = parse(record.data)
            except DecodeError as error:
                raise place.error(f"no message of {FRAME} ({error})", "one") from None
            data, can_id, extended = one.data, one.id, one.extended
            if one.kind:
                left_out[KINDS[one.kind] if one.kind < len(KINDS) else "unknown"] += 1
            elif not fits(can_id, extended=extended) or len(data) > (
                MOST_BYTES if one.flags else CLASSICAL_BYTES
            ):
                left_out["impossible"] += 1
            else:
                yield _new(TimedFrame, (record.log_time, name, can_id, extended, data))
        elif type(record) is Schema:
            schemas[record.id] = record.name
        elif type(record) is Channel:
            if schemas.get(record.schema_id) == FRAME and record.message_encoding == "protobuf":
                names[record.id] = record.metadata.get("bus") or record.topic.rpartition("/")[2]
            else:
                others[record.topic] = schemas.get(record.schema_id, "none")
    if not names and others:
        shown = ", ".join(f"{topic} ({schema})" for topic, schema in [*others.items()][:MOST_NAMED])
        raise place.error(f"other schemas only: {shown}", f"CAN frames, the schema {FRAME}")
