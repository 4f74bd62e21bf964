"""Schemas of what an MCAP file holds, in protobuf: what Foxglove, rerun and PlotJuggler all read.

Messages of Foxglove have its names and numbers (github.com/foxglove/foxglove-sdk, schemas), and of
their fields those that are used here.
"""

import re
from collections.abc import Iterable
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, duration_pb2, timestamp_pb2
from google.protobuf.message_factory import GetMessageClass

from canshaper.recording.form import Channel

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
    """A message that is written: its class, and its schema for the file.

    Args:
        name: with its package.
        channels: of a message of values; by default it is one of the table.

    Attributes:
        name: as above.
        message: class of protobuf.
        data: serialised FileDescriptorSet, with all that it needs.
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
    """Make a field one of named values; the names of two enums in one message may be the same."""
    holder = message.nested_type.add(name=f"{field.name}_")
    field.type, field.type_name = 14, f"{scope}.{holder.name}.Value"
    enum, used = holder.enum_type.add(name="Value"), set()
    for number in sorted({0, *texts}):  # the first has to be 0, and names are words
        text = re.sub(r"\W", "_", texts.get(number, f"VALUE_{number}"), flags=re.ASCII)
        if text in used or not text[:1].isalpha():
            text = f"VALUE_{number}_{text}"
        used.add(text)
        enum.value.add(name=text, number=number)
