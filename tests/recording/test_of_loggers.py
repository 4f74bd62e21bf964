"""Logs as other loggers and their converters write them, made up: the same frames in each."""

from pathlib import Path

import pytest

from canshaper.recording.log import LogFile
from tests.recording.lines import error_of

# Time in ms, channel, id, whether that is extended, data.
FRAMES = [
    (1_000, "1", 0x110, False, bytes.fromhex("0AFF")),
    (1_010, "2", 0x1CFE3506, True, bytes.fromhex("3132333435363738")),
    (2_500, "1", 0x7FF, False, b""),
]

HERE = Path(__file__).with_name("logs")
LOGS = {path.name: path.read_bytes() for path in sorted(HERE.iterdir())}


@pytest.mark.parametrize("name", LOGS)
def test_the_frames_are_the_same(name: str) -> None:
    frames = list(LogFile(HERE / name))
    steps = [f.time_ns - frames[0].time_ns for f in frames]
    assert steps == [0, 10_000_000, 1_500_000_000]
    named = not name.startswith(("excel-python-can", "a.pcap", "b.pcap"))  # others have channels
    assert [f[1:] for f in frames] == [(f[1] if named else "", *f[2:]) for f in FRAMES]
    if "busmaster" not in name:
        assert frames[0].time_ns == 10**9


def test_what_is_left_out_is_counted() -> None:
    for name, counts in {
        "excel-python-can.csv": {"remote": 1, "error": 1},
        "kvaser.csv": {"remote": 1, "error": 1},
        "kvaser.txt": {"remote": 1, "error": 1},
        "canedge.csv": {"remote": 1},
        "vector.csv": {"error": 1, "without id": 1},
        "busmaster.log": {"remote": 1},
        "a.pcap": {"remote": 1, "error": 1},
        "d.pcapng": {"remote": 1, "error": 1},
    }.items():
        log = LogFile(HERE / name)
        assert len(list(log)) == 3
        assert log.left_out == counts, name


@pytest.mark.parametrize(
    ("name", "old", "new", "text"),
    [
        ("kvaser.csv", "1,272,2,2,10", "1,272,2,2,300", "kvaser.csv:7: expected a row of Time,"),
        ("kvaser.csv", "272,2,2,10", "272,2,3,10", "expected all of them, got 2 of 3 bytes"),
        ("kvaser.csv", "Time,", "Zeitpunkt,", "kvaser.csv:1: expected a header that names time"),
        ("canedge.csv", "0AFF", "0AF", "canedge.csv:2: expected a row of TimestampEpoch;"),
        ("canedge.csv", "1.000000", "1e99999", "canedge.csv:2: expected a row of TimestampEpoch;"),
        ("canedge.csv", ";7FF;", ";FFF;", "got id 0xfff"),
        ("kvaser.txt", "Rx            2", "Rx            3", ":13: expected all of them, got 2 of"),
        ("kvaser.txt", "110    Rx", "110    Up", ":13: expected a line of Kvaser's plain text"),
        ("busmaster.log", "s 2 0A", "s 3 0A", "expected all of them, got 2 of 3 bytes"),
        ("busmaster.log", "0x110 s", "110 standard", ":7: expected a line of BUSMASTER's log"),
    ],
)
def test_a_wrong_line_is_named(tmp_path: Path, name: str, old: str, new: str, text: str) -> None:
    content = LOGS[name].decode()
    assert old in content
    (tmp_path / name).write_text(content.replace(old, new, 1), encoding="utf-8")
    assert text in error_of(tmp_path / name)


A, D = LOGS["a.pcap"], LOGS["d.pcapng"]


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (A.replace(b"\xe3", b"\x71"), "expected 227, SocketCAN (capture at one interface, such as"),
        (D.replace(b"\0\xe3", b"\0\1"), "a.pcap: expected 227, SocketCAN"),
        (A[:-3], "frame 4: the log is cut off"),
        (D[:-3], "frame 4: the log is cut off"),
        (b"PK\3\4", "expected a capture: pcap or pcapng, got the first bytes b'PK"),
    ],
)
def test_another_capture_is_refused(tmp_path: Path, content: bytes, text: str) -> None:
    (tmp_path / "a.pcap").write_bytes(content)
    assert text in error_of(tmp_path / "a.pcap")
