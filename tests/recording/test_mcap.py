"""MCAP: written by canshaper, read by mcap's own reader, by protobuf and by canshaper."""

import gzip
import math
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from canshaper.bus.packet import FDF
from canshaper.errors import CutOffError, LogError
from canshaper.recording.form import Channel, Group
from canshaper.recording.listen import ReceivedFrame
from canshaper.recording.log import LogFile
from canshaper.recording.mcap_write import FRAME, McapWriter, Schema
from tests.recording.exports import (
    START_NS,
    exported_drive,
    frames,
    frames_of,
    others,
    replayed,
    timed,
)
from tests.recording.lines import error_of


def by_topic(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Times and messages of each topic, decoded by the schemas of the file alone."""
    classes: dict[int, Any] = {}
    found = defaultdict(list)
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            if schema.id not in classes:
                assert schema.encoding == channel.message_encoding == "protobuf"
                pool = DescriptorPool()
                for one in FileDescriptorSet.FromString(schema.data).file:
                    pool.Add(one)
                classes[schema.id] = GetMessageClass(pool.FindMessageTypeByName(schema.name))
            decoded = classes[schema.id].FromString(message.data)
            found[channel.topic].append((message.log_time, decoded))
    return found


def units(path: Path) -> dict[str, dict[str, str]]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return {one.topic: one.metadata for one in summary.channels.values()}


def written(path: Path, chunk: int = 1 << 20) -> Path:
    writer = McapWriter(path)
    writer._mcap._Writer__chunk_size = chunk
    for frame in [*frames(), *others(frames()[-1].time_ns)]:
        writer.frame(frame, sent=frame.can_id % 2 > 0)
    writer.close()
    return path


def test_every_frame_comes_back_to_the_bit_and_the_nanosecond(tmp_path: Path) -> None:
    log = LogFile(written(tmp_path / "a.mcap"))
    assert list(log) == [timed(one) for one in frames()]
    assert dict(log.left_out) == {"error": 1, "remote": 2}
    packed = tmp_path / "a.mcap.gz"
    packed.write_bytes(gzip.compress((tmp_path / "a.mcap").read_bytes()))
    assert list(LogFile(packed)) == [timed(one) for one in frames()]


def flags_of(frame: ReceivedFrame) -> int:
    return 0 if frame.flags is None else frame.flags | FDF


def test_mcaps_own_reader_has_the_same_frames(tmp_path: Path) -> None:
    topics = by_topic(written(tmp_path / "a.mcap"))
    for bus in ("crane", "body-2"):
        data = [(t, m) for t, m in topics[f"/can/{bus}"] if m.kind == 0]
        assert [(t, m.id, m.extended, m.data, m.flags, m.sent) for t, m in data] == [
            (f.time_ns, f.can_id, f.extended, f.data, flags_of(f), f.can_id % 2 > 0)
            for f in frames()
            if f.bus == bus
        ]
    assert [m.kind for _, m in topics["/can/crane"] if m.kind] == [2, 1, 1]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Any]]:
    path = tmp_path_factory.mktemp("drive") / "drive.mcap"
    return path, exported_drive(path)


def test_a_replay_of_the_export_is_that_of_the_drive(drive: tuple[Path, list[Any]]) -> None:
    path, ticks = drive
    assert list(LogFile(path)) == frames_of(ticks)
    assert [r.sent for _, r in replayed(path)] == [r.sent for _, r in ticks]


def test_axes_events_and_signals_are_those_of_the_ticks(drive: tuple[Path, list[Any]]) -> None:
    path, ticks = drive
    topics = by_topic(path)
    slew = topics["/axes/slew"]
    rows = [(tick.now_ns, result.rows["slew"][:3]) for tick, result in ticks]
    assert [(t, (m.command, m.applied, m.sway)) for t, m in slew] == rows
    lines = [(tick.now_ns, text) for tick, result in ticks for text in result.events]
    assert [(t, m.message) for t, m in topics["/events"]] == lines
    assert all(1e9 * m.timestamp.seconds + m.timestamp.nanos == t for t, m in topics["/events"])
    states: dict[int, str] = {}
    for time_ns, text in lines:
        if text.startswith("axis=slew state="):
            states[time_ns] = text.split()[1].removeprefix("state=")
    enum = slew[0][1].DESCRIPTOR.fields_by_name["state"].enum_type.values_by_number
    assert len(states) > 3
    seen = {t: enum[m.state].name for t, m in slew}
    assert {t: seen[t] for t in states} == states
    said = {text.rpartition("=")[2] for _, text in lines if text.startswith("axis=slew state=")}
    reasons = slew[0][1].DESCRIPTOR.fields_by_name["reason"].enum_type.values_by_number
    assert said <= {reasons[m.reason].name for _, m in slew} <= {*said, "START"}
    assert units(path)["/axes/slew"] == {"sway": "deg"}
    assert units(path)["/signals/crane/TipPosition"] == {
        "SlewAngle": "deg",
        "Radius": "m",
        "Height": "m",
    }
    status = [round(m.ShapedCommand, 2) for _, m in topics["/signals/crane/SlewStatus"]]
    assert {*status} <= {round(100.0 * row[1], 2) for _, row in rows}
    assert max(status) > 50.0


def test_the_scene_is_the_crane(drive: tuple[Path, list[Any]]) -> None:
    topics = by_topic(drive[0])
    crane = dict(topics["/crane"])
    scenes, moves = topics["/scene"], dict(topics["/tf"])
    assert len(scenes) > 400
    for time_ns, scene in scenes:
        pose, (entity,) = crane[time_ns], scene.entities
        boom, rope = entity.lines
        tip, grapple = boom.points[-1], rope.points[-1]
        slew = math.radians(pose.slew)
        assert (tip.x, tip.y) == pytest.approx(
            (pose.radius * math.cos(slew), pose.radius * math.sin(slew))
        )
        assert tip.z == pose.height > grapple.z
        assert entity.spheres[0].pose.position.z == grapple.z
        one, two = moves[time_ns].transforms
        assert (one.translation.x, two.translation.x) == (tip.x, grapple.x)
    swings = [abs(m.sway_across) for _, m in topics["/crane"]]
    assert 1.0 < max(swings) < 30.0
    across = max(scenes, key=lambda one: abs(crane[one[0]].sway_across))
    tip, grapple = across[1].entities[0].lines[1].points
    assert math.dist((tip.x, tip.y), (grapple.x, grapple.y)) > 0.01


def test_two_codes_of_one_message_may_have_the_same_names(tmp_path: Path) -> None:
    writer = McapWriter(tmp_path / "a.mcap")
    texts = {1: "ON", 3: "ON", 2: "not ready", 4: "5 bar"}
    channels = (Channel("one", "", texts), Channel("two", "", texts), Channel("three", "m/s²"))
    row = writer.group(Group("x/2 a-ö", channels))
    row(START_NS, (3, 7, 0.1))
    writer.close()
    ((time_ns, message),) = by_topic(tmp_path / "a.mcap")["/x/2 a-ö"]
    assert (time_ns, message.one, message.two, message.three) == (START_NS, 3, 7, 0.1)
    names = message.DESCRIPTOR.fields_by_name["one"].enum_type.values_by_name
    assert [*names] == ["VALUE_0", "ON", "not_ready", "VALUE_3_ON", "VALUE_4_5_bar"]


def test_schemas_have_the_numbers_of_foxglove() -> None:
    messages = pytest.importorskip("foxglove.messages", reason="foxglove-sdk: make test-exports")
    for name in ("SceneUpdate", "FrameTransforms", "Log"):
        theirs = {
            one.name: {field.name: (field.number, field.type, field.label) for field in one.field}
            for file in FileDescriptorSet.FromString(getattr(messages, name).get_schema().data).file
            for one in file.message_type
        }
        (ours,) = [
            file
            for file in FileDescriptorSet.FromString(Schema(f"foxglove.{name}").data).file
            if file.package == "foxglove"
        ]
        for one in ours.message_type:
            for field in one.field if one.name in theirs else ():
                same = field.number, field.type, field.label
                assert theirs[one.name][field.name] == same, (one.name, field.name)


# -- damaged, cut off, foreign -----------------------------------------------------------------


def test_a_file_cut_off_anywhere_gives_whole_frames_and_says_so(tmp_path: Path) -> None:
    whole = written(tmp_path / "a.mcap", chunk=2000).read_bytes()
    expected, most = [timed(one) for one in frames()], 0
    for size in range(8, len(whole), 331):
        path = tmp_path / "cut.mcap"
        path.write_bytes(whole[:size])
        got = []
        with pytest.raises(CutOffError) as error:
            for one in LogFile(path):
                got.append(one)
        assert str(error.value).startswith(str(path))
        assert "the log is cut off" in str(error.value)
        assert got == expected[: len(got)]
        most = max(most, len(got))
    assert most == len(expected)


def test_a_chunk_with_a_wrong_sum_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = McapWriter(path)
    writer._mcap._Writer__compression = CompressionType.NONE
    for frame in frames(8):
        writer.frame(frame)
    writer.close()
    content = path.read_bytes()
    assert content.count(frames(8)[7].data) == 1
    path.write_bytes(content.replace(frames(8)[7].data, bytes(64)))
    message = error_of(path)
    assert message.startswith(f"{path}: expected an MCAP log that is whole (mcap recover")
    assert "crc validation failed in Chunk" in message


def foreign(path: Path, schema: str, encoding: str, data: bytes, topic: str = "/imu") -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        number = writer.register_schema(schema, encoding, b"")
        channel = writer.register_channel(topic, encoding, number)
        writer.add_message(channel, START_NS, data, START_NS)
        writer.finish()
    return path


@pytest.mark.parametrize(
    ("schema", "encoding", "text"),
    [
        (
            "sensor_msgs/msg/Imu",
            "cdr",
            "expected CAN frames, the schema canshaper.CanFrame, got other schemas only: /imu"
            " (sensor_msgs/msg/Imu)",
        ),
        (FRAME, "json", "got other schemas only: /imu (canshaper.CanFrame)"),
        (FRAME, "protobuf", "frame 1: expected one, got no message of canshaper.CanFrame"),
    ],
)
def test_foreign_schemas_are_named(tmp_path: Path, schema: str, encoding: str, text: str) -> None:
    path = foreign(tmp_path / "a.mcap", schema, encoding, b"\xff\xff")
    assert text in error_of(path)


@pytest.mark.parametrize(
    ("content", "text"),
    [(b"", "cut off"), (b"x" * 200, "expected an MCAP log that is whole, got InvalidMagic")],
)
def test_what_is_no_mcap_is_named(tmp_path: Path, content: bytes, text: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    assert text in error_of(path)


def test_impossible_frames_are_left_out_and_clocks_that_jump_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = McapWriter(path)
    one = frames(1)[0]
    writer.frame(one)
    writer.frame(one._replace(can_id=0x800, extended=False))
    writer.frame(one._replace(data=bytes(9), flags=None))
    writer.frame(one._replace(time_ns=one.time_ns - 10**9))
    writer.close()
    log = LogFile(path)
    with pytest.raises(LogError, match=r"mixed clocks: a time 1\.000 s before that of the frame"):
        list(log)
    assert log.left_out == {"impossible": 2}


def test_a_missing_extra_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path / "a.mcap")
    monkeypatch.setitem(sys.modules, "mcap.exceptions", None)
    assert error_of(path) == (
        f"{path}: MCAP logs need mcap.exceptions, which is missing: pip install 'canshaper[mcap]'"
    )
