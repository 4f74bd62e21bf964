"""Writer of a drive as MCAP: protobuf messages of frames and values, in zstd chunks of 1 MB.

The messages of Foxglove have its names and numbers (github.com/foxglove/foxglove-sdk, schemas) and
only the fields used here, which Foxglove, rerun and PlotJuggler all read.
"""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, duration_pb2, timestamp_pb2
from google.protobuf.message_factory import GetMessageClass
from mcap.writer import Writer as Mcap

from canshaper.bus.packet import FDF
from canshaper.recording.form import Channel, Group, Point, Row
from canshaper.recording.listen import ReceivedFrame

FRAME = "canshaper.CanFrame"
KINDS = ("data", "remote", "error")
_TYPES = {"bool": 8, "string": 9, "bytes": 12, "double": 1, "uint32": 13, "fixed32": 7}
_TIMES = {"timestamp": timestamp_pb2, "duration": duration_pb2}
# Name and number of each field and its type, [] where there are several; enums by their values.
_FIELDS = {
    FRAME: "id=1:fixed32 extended=2:bool sent=3:bool flags=4:uint32 kind=5:kind! data=7:bytes",
    "foxglove.Log": "timestamp=1:timestamp level=2:level! message=3:string name=4:string",
    "foxglove.Vector3": "x=1:double y=2:double z=3:double",
    "foxglove.Point3": "x=1:double y=2:double z=3:double",
    "foxglove.Quaternion": "x=1:double y=2:double z=3:double w=4:double",
    "foxglove.Color": "r=1:double g=2:double b=3:double a=4:double",
    "foxglove.Pose": "position=1:Vector3 orientation=2:Quaternion",
    "foxglove.LinePrimitive": "type=1:type! pose=2:Pose thickness=3:double points=5:Point3[] "
    "color=6:Color",
    "foxglove.SpherePrimitive": "pose=1:Pose size=2:Vector3 color=3:Color",
    "foxglove.SceneEntity": "timestamp=1:timestamp frame_id=2:string id=3:string "
    "lifetime=4:duration spheres=9:SpherePrimitive[] lines=11:LinePrimitive[]",
    "foxglove.SceneUpdate": "entities=2:SceneEntity[]",
    "foxglove.FrameTransform": "timestamp=1:timestamp parent_frame_id=2:string "
    "child_frame_id=3:string translation=4:Vector3 rotation=5:Quaternion",
    "foxglove.FrameTransforms": "transforms=1:FrameTransform[]",
}
_ENUMS = {
    "kind": dict(enumerate(KINDS)),
    "level": dict(enumerate(("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"))),
    "type": dict(enumerate(("LINE_STRIP", "LINE_LOOP", "LINE_LIST"))),
}


class Schema:
    """A type of message: its protobuf class, and its schema for the file.

    Args:
        name: name of the message with its package.
        channels: channels of a message of values; None for a message of the table ``_FIELDS``.

    Attributes:
        name: name of the message with its package.
        message: class of protobuf.
        data: serialised FileDescriptorSet with all dependencies.
    """

    def __init__(self, name: str, channels: Iterable[Channel] | None = None) -> None:
        self.name = name
        package = name.rpartition(".")[0]
        file = descriptor_pb2.FileDescriptorProto(
            name=f"{name.replace('.', '/')}.proto", package=package, syntax="proto3"
        )
        files = [file]
        for module in (timestamp_pb2, duration_pb2) if channels is None else ():
            files.insert(0, descriptor_pb2.FileDescriptorProto.FromString(_of(module)))
            file.dependency.append(files[0].name)
        if channels is None:
            names = [one for one in _FIELDS if one.startswith(f"{package}.")]
            for one in names:
                _add(file.message_type.add(name=one.rpartition(".")[2]), _FIELDS[one], package)
        else:
            values = file.message_type.add(name=name.rpartition(".")[2])
            for number, channel in enumerate(channels, start=1):
                field = values.field.add(name=channel.name, number=number, label=1, type=1)
                if channel.texts is not None:
                    _enum(values, field, channel.texts, f".{name}")
        pool: Any = descriptor_pool.DescriptorPool()
        for one in files:
            pool.Add(one)
        self.message: Any = GetMessageClass(pool.FindMessageTypeByName(name))
        self.data: bytes = descriptor_pb2.FileDescriptorSet(file=files).SerializeToString()


def _of(module: Any) -> bytes:
    serialised: bytes = module.DESCRIPTOR.serialized_pb
    return serialised


def _add(message: Any, fields: str, package: str) -> None:
    for one in fields.split():
        name, number, kind = re.split("[=:]", one)
        field = message.field.add(name=name, number=int(number), label=1)
        if kind.endswith("[]"):
            field.label, kind = 3, kind[:-2]
        if kind in _TYPES:
            field.type = _TYPES[kind]
        elif kind.endswith("!"):
            _enum(message, field, _ENUMS[kind[:-1]], f".{package}.{message.name}")
        else:
            word = f".google.protobuf.{kind.title()}" if kind in _TIMES else f".{package}.{kind}"
            field.type, field.type_name = 11, word


def _enum(message: Any, field: Any, texts: Any, scope: str) -> None:
    """Make a field an enum with these texts by number, changed to valid names, each used once."""
    holder = message.nested_type.add(name=f"{field.name}_")
    field.type, field.type_name = 14, f"{scope}.{holder.name}.Value"
    enum, used = holder.enum_type.add(name="Value"), set()
    for number in sorted({0, *texts}):  # the first has to be 0, and names are words
        text = re.sub(r"\W", "_", texts.get(number, f"VALUE_{number}"), flags=re.ASCII)
        if text in used or not text[:1].isalpha():
            text = f"VALUE_{number}_{text}"
        used.add(text)
        enum.value.add(name=text, number=number)


WORLD = "crane"
FOOT = 0.0, 0.0, 0.0
ORANGE = {"r": 0.9, "g": 0.6, "b": 0.1, "a": 1.0}
GREY = {"r": 0.5, "g": 0.5, "b": 0.5, "a": 1.0}
UPRIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
INFO = 2  # foxglove.Log.Level


class McapWriter:
    """Writes during the drive: a file that is cut off can be read up to its last chunk.

    Args:
        path: the file; an existing one is replaced.

    Raises:
        OSError: the file cannot be written.
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
        """Register a topic for a message of ``_FIELDS``; return its number and message class."""
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
        """Return a function that writes the values of a new group to the topic of its name."""
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
        """Write an event as a foxglove.Log of level INFO, on the topic /events."""
        self._add(self._log, time_ns, timestamp=_stamp(time_ns), level=INFO, message=text)

    def pose(self, time_ns: int, boom: Sequence[Point], grapple: Point) -> None:
        """Write the crane as lines and a ball, and tip and grapple as coordinate frames."""
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
        """Write index and end of the file."""
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
