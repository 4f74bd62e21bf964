"""Raw CAN frames of an MCAP log, as ``canshaper`` writes it."""

import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

from canshaper.codec.layout import CLASSICAL_BYTES
from canshaper.errors import LogError
from canshaper.recording.channels import MOST_BYTES, Place, TimedFrame, fits
from canshaper.recording.form import install

MOST_NAMED = 5
# What mcap raises at a damaged file besides its own.
DAMAGED = (
    ArithmeticError,
    LookupError,
    MemoryError,
    RuntimeError,
    TypeError,
    ValueError,
    struct.error,
)
_new = tuple.__new__  # TimedFrame(...) in half the time


def mcap(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    """Frames of topics with the schema of ``mcap_schemas``, in the order of the file."""
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
        got = f"{type(error).__name__} {error}".rstrip()
        raise place.error(got, "an MCAP log that is whole") from None


def _frames(file: BinaryIO, place: Place) -> Iterator[TimedFrame]:
    from google.protobuf.message import DecodeError  # noqa: PLC0415
    from mcap.records import Channel, Message, Schema  # noqa: PLC0415
    from mcap.stream_reader import StreamReader  # noqa: PLC0415

    from canshaper.recording.mcap_schemas import FRAME, KINDS  # noqa: PLC0415
    from canshaper.recording.mcap_schemas import Schema as Ours  # noqa: PLC0415

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
