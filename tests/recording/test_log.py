"""Every format gives the same frames; clocks that are set, and large logs."""

import gzip
import tracemalloc
from pathlib import Path

import can
import pytest

from canshaper.recording.log import LogFile, TimedFrame
from tests.recording.lines import FRAMES, HEADER, LINES, error_of, log, prefix
from tests.recording.writing import messages, written

# -- formats -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("suffix", "first"), [("log", 0), ("asc", 1), ("blf", 1), ("csv", 0), ("db", 0), ("trc", 1)]
)
def test_every_format_gives_the_frames_that_were_written(
    tmp_path: Path, suffix: str, first: int
) -> None:
    path = written(tmp_path / f"drive.{suffix}", messages(FRAMES, first))
    expected = FRAMES
    if suffix == "log":
        expected = [f._replace(channel=f"can{f.channel}") for f in FRAMES]
    if suffix in ("csv", "db"):
        expected = [f._replace(channel="") for f in FRAMES]
    if suffix in ("asc", "blf"):  # python-can's begin with their first frame
        expected = [f._replace(time_ns=f.time_ns - FRAMES[0].time_ns) for f in FRAMES]
    assert list(LogFile(path)) == expected
    if suffix != "db":  # a database cannot be packed
        packed = tmp_path / f"other.{suffix}.gz"
        packed.write_bytes(gzip.compress(path.read_bytes()))
        assert list(LogFile(packed)) == expected


def test_candump_of_python_can_with_directions_and_of_nanoseconds(tmp_path: Path) -> None:
    path = log(tmp_path, "(7.000001) vcan0 110#0A0b R\n", "(7.123456789) vcan0 110# T\n")
    assert [f.time_ns for f in LogFile(path)] == [7_000_001_000, 7_123_456_789]


def test_times_are_exact_at_the_date_of_today(tmp_path: Path) -> None:
    path = log(tmp_path, "(1763750000.249713) can0 110#\n", "(1763750000.249714) can0 110#\n")
    assert [f.time_ns for f in LogFile(path)] == [
        1_763_750_000_249_713_000,
        1_763_750_000_249_714_000,
    ]
    start = 1_763_750_000_000_000_000
    frames = [f._replace(time_ns=start + i * 10_001_000) for i, f in enumerate(FRAMES)]
    blf = written(tmp_path / "a.blf", messages(frames))
    # The writer had floats; the reader adds no error of its own.
    assert [round(f.time_ns, -3) for f in LogFile(blf)] == [f.time_ns for f in frames]


ASC = """date Sat Nov 21 10:15:30.400 am 2026
base hex  timestamps absolute
internal events logged
// version 13.0.0
Begin Triggerblock Sat Nov 21 10:15:30.400 am 2026
   0.000000 Start of measurement
   0.100123 1  110             Rx   d 2 0A 0B  Length = 234000 BitCount = 120 ID = 272
   0.200000 1  1CFE3506x       Tx   d 1 FF
   0.200000 1  1CFE3506x       TxRq d 1 FF
   0.250000 1  ErrorFrame
   0.255000 CANFD   2 Rx ErrorFrame   Not Acknowledge error, dominant error flag   fffe c7 31ca Rx
   0.260000 2  7FF             Rx   r 3
   0.300000 1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   0.300000 CANFD   2 Rx        111                    Joystick 0 0 8  3 01 02 03   0    0   0 0 0 0
   0.310000 CANFD   2 Rx        112                           0 0 2  2 01 02   120000  130   0 0 0 0
   0.320000 CANFD   2 Rx        113                           1 0 2  2 01 02   120000  130   3000 0
   0.330000 CANFD   2 Rx        113                  1 0 9 12 1 2 3 4 5 6 7 8 9 A B C  120 130 3000
   0.400000 CAN 1 Status:chip status error active
End TriggerBlock
"""


def test_asc_of_vectors_tools(tmp_path: Path) -> None:
    file = LogFile(log(tmp_path, ASC, name="a.asc"))
    assert list(file) == [
        TimedFrame(100_123_000, "1", 0x110, False, b"\x0a\x0b"),
        TimedFrame(200_000_000, "1", 0x1CFE3506, True, b"\xff"),
        TimedFrame(300_000_000, "2", 0x111, False, b"\x01\x02\x03"),
        TimedFrame(310_000_000, "2", 0x112, False, b"\x01\x02"),
        TimedFrame(320_000_000, "2", 0x113, False, b"\x01\x02"),
        TimedFrame(330_000_000, "2", 0x113, False, bytes(range(1, 13))),
    ]
    assert file.left_out == {"error": 2, "remote": 1}


def test_asc_with_decimal_numbers(tmp_path: Path) -> None:
    path = log(tmp_path, "base dec  timestamps absolute\n", "1.5 1 272 Rx d 2 10 255\n")
    path = path.rename(path.with_suffix(".asc"))
    assert list(LogFile(path)) == [TimedFrame(1_500_000_000, "1", 272, False, b"\x0a\xff")]


def test_what_is_no_data_frame_is_left_out_and_counted(tmp_path: Path) -> None:
    others = [
        "(1.1) can0 20000080#0000000000000000\n",  # the error class is no id
        "(1.1) can0 20000004#0004000000000000\n",
        "(1.2) can0 110#R\n",
        "(1.2) can0 110#R8\n",
    ]
    file = LogFile(log(tmp_path, LINES[0], *others))
    assert len(list(file)) == 1
    assert file.left_out == {"error": 2, "remote": 2}
    binary = [
        can.Message(timestamp=1.0, arbitration_id=0x110, data=b"\x01"),
        can.Message(timestamp=1.1, is_error_frame=True),
        can.Message(timestamp=1.2, arbitration_id=0x110, is_remote_frame=True),
    ]
    for name in ("b.blf", "b.csv"):
        file = LogFile(written(tmp_path / name, binary))
        assert len(list(file)) == 1
        assert file.left_out == {"error": 1, "remote": 1}


# -- clocks ------------------------------------------------------------------------------------


@pytest.mark.parametrize("digits", [11, 400, 5000])
@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("a.log", "({}.000000) can0 110#0102\n"),
        ("a.log", "({}.0) can0 110#0102\n"),
        ("a.asc", "{}.0 1 110 Rx d 1 01\n"),
        ("a.csv", "{}.0,0x110,0,0,0,2,AQI=\n"),
    ],
)
def test_a_time_that_no_clock_can_have(
    tmp_path: Path, name: str, line: str, before: bool, digits: int
) -> None:
    start = HEADER if name == "a.csv" else "base hex timestamps absolute\n" * (name == "a.asc")
    start += line.format(1) * before
    path = log(tmp_path, start, line.format("9" * digits), line.format(2), name=name)
    result, error = prefix(path)
    assert len(result) == before
    assert f"{path}:{len(start.splitlines()) + 1}: expected a" in str(error)
    assert "mixed clocks" not in str(error)


def test_a_clock_that_was_set_is_reported_with_its_place(tmp_path: Path) -> None:
    back = log(tmp_path, "(100.5) can0 110#\n", "(100.4) can0 110#\n")
    assert error_of(back) == (
        f"{back}:2: expected one clock for the whole log (split it here), got mixed"
        " clocks: a time 0.100 s before that of the frame before"
    )
    forth = log(tmp_path, "(100.5) can0 110#\n", "(1763750000.4) can0 110#\n")
    assert ", got mixed clocks: a time 1763749899.900 s after" in error_of(forth)


def test_frames_of_two_sockets_may_stand_in_the_wrong_order(tmp_path: Path) -> None:
    path = log(tmp_path, "(1.5) can0 110#\n", "(1.499) can1 111#\n", "(1.501) can0 110#\n")
    file = LogFile(path)
    assert [(f.time_ns // 10**6, f.channel) for f in file] == [
        (1500, "can0"),
        (1500, "can1"),
        (1501, "can0"),
    ]
    assert file.disordered == 1


# -- large ones --------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_large_log_takes_no_more_memory(tmp_path: Path) -> None:
    def peak(count: int) -> int:
        rows = (
            f"({i // 1000}.{i % 1000:03d}000) can0 110#00112233445566{i % 256:02X}\n"
            for i in range(count)
        )
        path = log(tmp_path, *rows)
        tracemalloc.start()
        try:
            assert sum(1 for _ in LogFile(path)) == count
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(100)
    assert peak(100_000) < peak(5_000) + 50_000


def test_progress_goes_from_nothing_to_all(tmp_path: Path) -> None:
    path = log(tmp_path, *(f"({i}.0) can0 110#0011223344556677\n" for i in range(40_000)))
    seen: list[float] = []
    count = sum(1 for _ in LogFile(path, seen.append))
    assert count == 40_000
    assert seen == sorted(seen)
    assert 0.0 <= seen[0] < 0.2
    assert seen[-1] == 1.0
    assert len(seen) >= 5
