"""A drive as MCAP: frames and values as messages of protobuf, zstd in chunks of a megabyte."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mcap.writer import Writer as Mcap

from canshaper.bus.packet import FDF
from canshaper.recording.form import Group, Point, Row
from canshaper.recording.listen import ReceivedFrame
from canshaper.recording.mcap_schemas import FRAME, KINDS, Schema

WORLD = "crane"
FOOT = 0.0, 0.0, 0.0
ORANGE = {"r": 0.9, "g": 0.6, "b": 0.1, "a": 1.0}
GREY = {"r": 0.5, "g": 0.5, "b": 0.5, "a": 1.0}
UPRIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
INFO = 2  # foxglove.Log.Level


class McapWriter:
    """Writes while it is driven: what is cut off can be read up to the last chunk.

    Args:
        path: the file; one that is there is replaced.

    Raises:
        OSError: it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._mcap: Any = Mcap(self._file)
        self._mcap.start(profile="", library="canshaper")
        self._buses: dict[str, int] = {}
        self._heads: dict[tuple[int, bool, int | None, str, bool], bytes] = {}
        self._log = self._channel("/events", "foxglove.Log")
        self._scene = self._channel("/scene", "foxglove.SceneUpdate")
        self._moves = self._channel("/tf", "foxglove.FrameTransforms")
        self._frame_schema, frame = self._schema(Schema(FRAME))
        self._frame = frame.message

    def _channel(self, topic: str, schema: str) -> tuple[int, Any]:
        """A new topic of a message of the table: its number, and the class of its messages."""
        number, one = self._schema(Schema(schema))
        return self._mcap.register_channel(topic, "protobuf", number), one.message

    def _schema(self, schema: Schema) -> tuple[int, Schema]:
        return self._mcap.register_schema(schema.name, "protobuf", schema.data), schema

    def frame(self, frame: ReceivedFrame, *, sent: bool = False) -> None:
        """Write a frame as it was on its bus, on the topic /can/BUS."""
        channel = self._buses.get(frame.bus)
        if channel is None:
            channel = self._buses[frame.bus] = self._mcap.register_channel(
                f"/can/{frame.bus}", "protobuf", self._frame_schema, {"bus": frame.bus}
            )
        key = frame.can_id, frame.extended, frame.flags, frame.kind, sent
        head = self._heads.get(key)
        if head is None:
            message = self._frame(
                id=frame.can_id,
                extended=frame.extended,
                sent=sent,
                flags=0 if frame.flags is None else frame.flags | FDF,  # old kernels have no FDF
                kind=KINDS.index(frame.kind or "data"),
            )
            # Data, with the largest number, comes last: two messages one behind the other are one.
            head = self._heads[key] = message.SerializeToString() + b"\x3a"
        data = frame.data
        time_ns = frame.time_ns
        self._mcap.add_message(channel, time_ns, head + bytes((len(data),)) + data, time_ns)

    def group(self, group: Group) -> Row:
        """Return what writes the values of a new group, on the topic of its name."""
        # Names of protobuf are words.
        words = (re.sub(r"\W|^(?=\d)", "_", one, flags=re.ASCII) for one in group.name.split("/"))
        units = {channel.name: channel.unit for channel in group.channels if channel.unit}
        name = ".".join(("canshaper", *words))
        number, schema = self._schema(Schema(name, group.channels))
        channel = self._mcap.register_channel(f"/{group.name}", "protobuf", number, units)
        names = [one.name for one in group.channels]
        coded = [one.name for one in group.channels if one.texts is not None]
        message, add = schema.message, self._mcap.add_message

        def row(time_ns: int, values: Sequence[float]) -> None:
            fields = dict(zip(names, values, strict=True))
            for name in coded:
                fields[name] = int(fields[name])
            add(channel, time_ns, message(**fields).SerializeToString(), time_ns)

        return row

    def event(self, time_ns: int, text: str) -> None:
        """Write a line for people."""
        self._add(self._log, time_ns, timestamp=_stamp(time_ns), level=INFO, message=text)

    def pose(self, time_ns: int, boom: Sequence[Point], grapple: Point) -> None:
        """Write the crane as lines and a ball, and the places of tip and grapple as frames."""
        tip, at = boom[-1], {"timestamp": _stamp(time_ns)}
        lines = [
            {
                "pose": _pose(FOOT),
                "thickness": wide,
                "points": [*map(_point, line)],
                "color": colour,
            }
            for wide, line, colour in ((0.15, boom, ORANGE), (0.05, (tip, grapple), GREY))
        ]
        ball = {"pose": _pose(grapple), "size": _point((0.5, 0.5, 0.5)), "color": GREY}
        entity = {"frame_id": WORLD, "id": "crane", "lines": lines, "spheres": [ball]}
        self._add(self._scene, time_ns, entities=[at | entity])
        moved = [
            {"child_frame_id": child, "translation": _point(place), "rotation": UPRIGHT}
            for child, place in (("tip", tip), ("grapple", grapple))
        ]
        frames = [at | {"parent_frame_id": WORLD} | one for one in moved]
        self._add(self._moves, time_ns, transforms=frames)

    def _add(self, channel: tuple[int, Any], time_ns: int, **fields: Any) -> None:
        number, message = channel
        self._mcap.add_message(number, time_ns, message(**fields).SerializeToString(), time_ns)

    def close(self) -> None:
        """Write index and end."""
        try:
            self._mcap.finish()
        finally:
            self._file.close()


def _stamp(time_ns: int) -> dict[str, int]:
    seconds, nanos = divmod(time_ns, 10**9)
    return {"seconds": seconds, "nanos": nanos}


def _point(point: Point) -> dict[str, float]:
    return dict(zip("xyz", point, strict=True))


def _pose(point: Point) -> dict[str, dict[str, float]]:
    return {"position": _point(point), "orientation": UPRIGHT}
