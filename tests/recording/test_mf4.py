"""MF4: written by canshaper, read by asammdf, python-can and canshaper.

asammdf is in no environment of the quick tests: ``make test-exports``.
"""

import gzip
from pathlib import Path
from typing import Any

import can
import pytest

from canshaper.recording.form import Channel, Group
from canshaper.recording.listen import ReceivedFrame
from canshaper.recording.log import LogFile
from tests.golden.replay import CONFIG
from tests.recording.exports import (
    START_NS,
    exported_drive,
    frames,
    frames_of,
    others,
    replayed,
    timed,
)
from tests.recording.lines import FRAMES, error_of
from tests.recording.writing import messages
from tests.recording.writing import written as written_by_python_can

asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed: make test-exports")
from canshaper.recording import mf4_write  # noqa: E402  (needs asammdf)

# What asammdf and pandas warn of is not ours.
pytestmark = pytest.mark.filterwarnings("default")
DBC = CONFIG.parent / "dbc" / "forwarder.dbc"


def written(path: Path, made: list[ReceivedFrame]) -> Path:
    writer = mf4_write.Mf4Writer(path, ["crane", "body-2"])
    for frame in made:
        writer.frame(frame, sent=frame.can_id % 2 > 0)
    writer.close()
    return path


def test_every_frame_comes_back_to_the_bit_and_the_nanosecond(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mf4_write, "HELD", 150)  # several parts
    log = LogFile(written(tmp_path / "a.mf4", [*frames(), *others(frames()[-1].time_ns)]))
    assert list(log) == [timed(one) for one in frames()]
    assert dict(log.left_out) == {"error": 1, "remote": 2}
    packed = tmp_path / "a.mf4.gz"
    packed.write_bytes(gzip.compress((tmp_path / "a.mf4").read_bytes()))
    assert list(LogFile(packed)) == [timed(one) for one in frames()]


def test_python_can_reads_the_same(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mf4", frames())
    with can.MF4Reader(path) as reader:
        theirs = [
            (m.channel, m.arbitration_id, m.is_extended_id, bytes(m.data), m.is_fd, m.is_rx)
            for m in reader
        ]
    assert theirs == [
        (
            1 if f.bus == "crane" else 2,
            f.can_id,
            f.extended,
            f.data,
            f.flags is not None,
            f.can_id % 2 == 0,
        )
        for f in frames()
    ]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Any]]:
    path = tmp_path_factory.mktemp("drive") / "drive.mf4"
    return path, exported_drive(path)


def test_a_replay_of_the_export_is_that_of_the_drive(drive: tuple[Path, list[Any]]) -> None:
    path, ticks = drive
    assert list(LogFile(path)) == frames_of(ticks)
    assert [r.sent for _, r in replayed(path)] == [r.sent for _, r in ticks]


def test_asammdf_decodes_the_buses_with_our_dbc(drive: tuple[Path, list[Any]]) -> None:
    with asammdf.MDF(drive[0]) as mdf:
        decoded = mdf.extract_bus_logging({"CAN": [(str(DBC), 0)]})
        radius, direct = decoded.get("Radius"), mdf.get("Radius")
        assert (radius.unit, direct.unit) == ("m", "m")
        assert radius.samples.tolist() == pytest.approx(direct.samples.tolist())
        assert len(radius) > 800


def test_values_have_units_and_states_their_names(drive: tuple[Path, list[Any]]) -> None:
    path, ticks = drive
    with asammdf.MDF(path) as mdf:
        (slew,) = (i for i, g in enumerate(mdf.groups) if g.channel_group.acq_name == "axes/slew")
        sway, state = mdf.get("sway", group=slew), mdf.get("state", group=slew)
        rows = [result.rows["slew"].sway_deg for _, result in ticks]
        assert sway.unit == "deg"
        assert sway.samples.tolist() == rows
        assert [round(t * 1e9) for t in sway.timestamps] == [tick.now_ns for tick, _ in ticks]
        assert {b"READY", b"ACTIVE", b"TRIPPED"} <= {*state.samples.tolist()}
        events = mdf.get("events").samples.tolist()
        assert [e.decode() for e in events] == [t for _, r in ticks for t in r.events]


def test_a_row_behind_the_first_part_and_an_unknown_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mf4_write, "HELD", 2)
    writer = mf4_write.Mf4Writer(tmp_path / "a.mf4", [])
    row = writer.group(Group("x", (Channel("v", "m/s²"), Channel("c", "", {0: "OFF", 1: "ON"}))))
    for number in range(5):
        row(START_NS + number, (0.1 * number, number))
    writer.close()
    with asammdf.MDF(tmp_path / "a.mf4") as mdf:
        value, code = mdf.get("v"), mdf.get("c")
        start_ns = mdf.header.abs_time
        assert value.unit == "m/s²"
        assert value.samples.tolist() == [0.1 * number for number in range(5)]
        assert [start_ns + round(t * 1e9) for t in value.timestamps] == [
            START_NS + number for number in range(5)
        ]
        assert code.samples.tolist() == [b"OFF", b"ON", *[b"unknown"] * 3]
    text = "expected an MF4 log with bus logging, or the log of another tool, got 1 groups of"
    assert text in error_of(tmp_path / "a.mf4")


def test_a_drive_of_nothing_can_be_read(tmp_path: Path) -> None:
    assert "got 0 groups of channels" in error_of(written(tmp_path / "a.mf4", []))


def test_the_log_of_python_can(tmp_path: Path) -> None:
    dated = [f._replace(time_ns=f.time_ns + START_NS // 10**9 * 10**9) for f in FRAMES]
    path = written_by_python_can(tmp_path / "drive.mf4", messages(dated))
    got = list(LogFile(path))
    assert [f[1:] for f in got] == [f[1:] for f in dated]
    # Its seconds since its start are those of floats of a date.
    assert all(abs(a.time_ns - b.time_ns) < 1000 for a, b in zip(got, dated, strict=True))


@pytest.mark.parametrize("size", [0, 20, 100, 3000, -100])
def test_a_file_cut_off_is_named(tmp_path: Path, size: int) -> None:
    path = written(tmp_path / "a.mf4", frames())
    path.write_bytes(path.read_bytes()[:size])
    message = error_of(path)
    assert message.startswith(f"{path}: expected an MF4 log that is whole, got ")
    assert "\n" not in message
