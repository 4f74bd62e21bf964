"""A drive as MCAP: frames and values as messages of protobuf, zstd in chunks of a megabyte."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mcap.writer import Writer as Mcap

from canshaper.recording.form import Group, Point, Row
from canshaper.recording.listen import ReceivedFrame
from canshaper.recording.mcap_schemas import FRAME, KINDS, Schema

WORLD = "crane"
BOOM_COLOUR = {"r": 0.9, "g": 0.6, "b": 0.1, "a": 1.0}
ROPE_COLOUR = {"r": 0.5, "g": 0.5, "b": 0.5, "a": 1.0}
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
        self._schemas: dict[str, tuple[int, Schema]] = {}
        self._buses: dict[str, int] = {}
        self._heads: dict[tuple[int, bool, int | None, str, bool], bytes] = {}
        self._log = self._channel("/events", "foxglove.Log")
        self._scene = self._channel("/scene", "foxglove.SceneUpdate")
        self._moves = self._channel("/tf", "foxglove.FrameTransforms")
        self._frame = self._schema(FRAME)[1].message

    def _schema(self, name: str, group: Group | None = None) -> tuple[int, Schema]:
        """A schema, and its number in the file."""
        if name not in self._schemas:
            schema = Schema(name, group.channels if group else None)
            number = self._mcap.register_schema(name, "protobuf", schema.data)
            self._schemas[name] = number, schema
        return self._schemas[name]

    def _channel(self, topic: str, schema: str) -> tuple[int, Any]:
        number, one = self._schema(schema)
        return self._mcap.register_channel(topic, "protobuf", number), one.message

    def frame(self, frame: ReceivedFrame, *, sent: bool = False) -> None:
        """Write a frame as it was on its bus, on the topic /can/BUS."""
        channel = self._buses.get(frame.bus)
        if channel is None:
            number = self._schema(FRAME)[0]
            channel = self._buses[frame.bus] = self._mcap.register_channel(
                f"/can/{frame.bus}", "protobuf", number, {"bus": frame.bus}
            )
        key = frame.can_id, frame.extended, frame.flags, frame.kind, sent
        head = self._heads.get(key)
        if head is None:
            message = self._frame(
                id=frame.can_id,
                extended=frame.extended,
                sent=sent,
                flags=frame.flags or 0,
                kind=KINDS.index(frame.kind or "data"),
            )
            # Data, with the largest number, comes last: two messages one behind the other are one.
            head = self._heads[key] = message.SerializeToString() + b"\x3a"
        data = frame.data
        time_ns = frame.time_ns
        self._mcap.add_message(channel, time_ns, head + bytes((len(data),)) + data, time_ns)

    def group(self, group: Group) -> Row:
        """Return what writes the values of a new group, on the topic of its name."""
        word = group.name.replace("/", ".").replace("-", "_")
        units = {channel.name: channel.unit for channel in group.channels if channel.unit}
        number, schema = self._schema(f"canshaper.{word}", group)
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
        tip, stamp = boom[-1], _stamp(time_ns)
        pose = {"position": _point((0.0, 0.0, 0.0)), "orientation": UPRIGHT}
        lines = [
            {"pose": pose, "thickness": 0.15, "points": [*map(_point, boom)], "color": BOOM_COLOUR},
            {
                "pose": pose,
                "thickness": 0.05,
                "points": [_point(tip), _point(grapple)],
                "color": ROPE_COLOUR,
            },
        ]
        hung = {"position": _point(grapple), "orientation": UPRIGHT}
        ball = {"pose": hung, "size": _point((0.5, 0.5, 0.5)), "color": ROPE_COLOUR}
        entity = {"timestamp": stamp, "frame_id": WORLD, "id": "crane", "lines": lines}
        self._add(self._scene, time_ns, entities=[entity | {"spheres": [ball]}])
        moved = [
            {
                "timestamp": stamp,
                "parent_frame_id": WORLD,
                "child_frame_id": child,
                "translation": _point(place),
                "rotation": UPRIGHT,
            }
            for child, place in (("tip", tip), ("grapple", grapple))
        ]
        self._add(self._moves, time_ns, transforms=moved)

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
