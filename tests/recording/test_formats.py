"""Formats of other tools, as those write them; ``tests/recording/test_log.py`` has the common."""

from pathlib import Path

import pytest

from canshaper.recording.log import LogFile, TimedFrame
from tests.recording.lines import error_of, kept

DAY_NS = 86_400 * 10**9


# -- PEAK's TRC ------------------------------------------------------------------------------------

FRAMES = [
    TimedFrame(17_535_400_000, "1", 0x100, True, bytes(8)),
    TimedFrame(17_700_300_000, "1", 0x704, False, b"\x01\xaf"),
]
TRC = {
    "1.0": """;##########################
     1)     17535  00000100  8  00 00 00 00 00 00 00 00
     2)     17540  FFFFFFFF  4  00 00 00 08 -- -- -- -- BUSHEAVY
     3)     17700      0704  2  01 AF
     4)     48937      0704  1  RTR""",
    "1.1": """;$FILEVERSION=1.1
;$STARTTIME=2.5
     1)     17535.4  Tx     00000100  8  00 00 00 00 00 00 00 00
     2)     17540.3  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY
     3)     17700.3  Rx         0704  2  01 AF
     4)     17800.3  Error      0704  2  01 AF
     5)     48937.6  Rx         0704  1  RTR""",
    "1.2": """;$FILEVERSION=1.2
;$STARTTIME=2.5
     1)     17535.400 1  Tx    00000100  8  00 00 00 00 00 00 00 00
     2)     17540.300 1  Warng FFFFFFFF  4  00 00 00 08
     3)     17700.300 1  Rx        0704  2  01 AF
     4)     48937.600 1  Rx        0704  1  RTR""",
    "1.3": """;$FILEVERSION=1.3
;$STARTTIME=2.5
     1)     17535.400 1  Tx    00000100 -  8    00 00 00 00 00 00 00 00
     2)     17540.300 1  Warng FFFFFFFF -  4    00 00 00 08 BUSHEAVY
     3)     17700.300 1  Rx        0704 -  2    01 AF
     4)     48937.600 1  Rx        0704 -  1    RTR""",
    "2.0": """;$FILEVERSION=2.0
;$STARTTIME=2.5
;$COLUMNS=N,O,T,I,d,l,D
      1     17535.400 DT 00000100 Tx 8  00 00 00 00 00 00 00 00
      2     17540.300 ST          Rx    00 00 00 08
      3     17700.300 DT     0704 Rx 2  01 AF
      4     17701.300 FB     0704 Rx 2  01 AF
     12     48937.600 RR     0704 Rx 1""",
    "2.1": """;$FILEVERSION=2.1
;$STARTTIME=2.5
;$COLUMNS=N,O,T,B,I,d,R,L,D
      1     17535.400 DT 1  00000100 Tx -  8    00 00 00 00 00 00 00 00
      2     17540.300 ST 1         - Rx -  4    00 00 00 08
      3     17700.300 DT 1      0704 Rx -  2    01 AF
     12     48937.600 RR 1      0704 Rx -  1""",
}


@pytest.mark.parametrize("version", TRC)
def test_every_version_of_trc(tmp_path: Path, version: str) -> None:
    file = LogFile(kept(tmp_path, "drive.trc", TRC[version]))
    begin_ns = round(-25_569 * DAY_NS + 2.5 * DAY_NS)
    expected = [frame._replace(time_ns=frame.time_ns + begin_ns) for frame in FRAMES]
    if version == "1.0":  # whole milliseconds, from the start of the log
        expected = [f._replace(time_ns=f.time_ns // 10**6 * 10**6) for f in FRAMES]
    expected += [expected[1]._replace(time_ns=expected[1].time_ns + 10**6)] * (
        version == "2.0"
    )  # FB
    assert list(file) == expected
    assert file.left_out["remote"] == 1
    assert file.left_out["error"] == (version == "1.1")


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (";$FILEVERSION=3.0\n", "a.trc:1: expected a version of 1.0, 1.1, 1.2, 1.3, 2.0, 2.1, got"),
        (";$STARTTIME=today\n", "a.trc:1: expected days since 1899-12-30, got 'today'"),
        (";$FILEVERSION=2.1\n1 1.0 DT\n", "a.trc:2: expected ;$COLUMNS=, which versions from 2.0"),
        ("1) 17 0100 x 00\n", "a.trc:1: expected a line of TRC 1.0: N O I L D, got '1) 17 0100 x"),
        ("1) 17 0100\n", "a.trc:1: expected a line of TRC 1.0"),
        ("1) 17 0100 2 00\n", "a.trc:1: expected all of them, 8 at most, got 1 of 2 bytes"),
        ("1) 17 0100 2 00 1", "a.trc:1: expected a line of TRC 1.0"),
        ("1) 17 0800 0\n", "got id 0x800"),
    ],
)
def test_what_is_no_trc(tmp_path: Path, content: str, text: str) -> None:
    assert text in error_of(kept(tmp_path, "a.trc", content))


# -- candump as it stands on the screen ------------------------------------------------------------


@pytest.mark.parametrize(
    ("stamp", "time_ns"),
    [
        ("(1436509052.249713)", 1_436_509_052_249_713_000),
        ("(000.000020)", 20_000),
        ("(1436509052.249713001)", 1_436_509_052_249_713_001),
    ],
)
@pytest.mark.parametrize("flags", ["", "  RX - -", "  TX B E"])
def test_candump_as_it_stands_on_the_screen(
    tmp_path: Path, stamp: str, time_ns: int, flags: str
) -> None:
    content = f""" {stamp}  can0{flags}  110   [2]  0A FF
 {stamp}  can0{flags}  1CFE3506   [8]  31 32 33 34 35 36 37 38   '12345678'
 {stamp}  can0{flags}  110   [0]
 {stamp}  can0{flags}  110   [0]  remote request
 {stamp}  can0{flags}  110  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B
 {stamp}  can0{flags}  20000004   [8]  00 08 00 00 00 00 00 00   ERRORFRAME
"""
    file = LogFile(kept(tmp_path, "a.log", content))
    assert list(file) == [
        TimedFrame(time_ns, "can0", 0x110, False, b"\x0a\xff"),
        TimedFrame(time_ns, "can0", 0x1CFE3506, True, b"12345678"),
        TimedFrame(time_ns, "can0", 0x110, False, b""),
        TimedFrame(time_ns, "can0", 0x110, False, bytes(range(12))),
    ]
    assert file.left_out == {"remote": 1, "error": 1}


def test_candump_with_a_date(tmp_path: Path) -> None:
    content = " (2026-11-21 10:15:30.000001)  can0  110   [0]\n" * 2
    first, second = LogFile(kept(tmp_path, "a.log", content))
    assert first == second
    assert first.time_ns % 10**9 == 1000


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("  can0  110   [2]  0A FF", "expected times before the frames: candump -L, or candump -t"),
        (" (now)  can0  110   [2]  0A FF", "expected times before the frames"),
        (" (1.0)  can0  110   [2]  0A", "expected all of them, got 1 of 2 bytes"),
        (" (1.0)  can0  110  [65] " + " 0A" * 65, "expected 64 at most, got 65 of 65 bytes"),
        (" (1.0)  can0  FFF   [1]  0A", "got id 0xfff"),
        (" (1.0)  can0  FFFF  [1]  0A", "expected a line of candump -L"),
    ],
)
def test_what_candump_does_not_show(tmp_path: Path, line: str, text: str) -> None:
    assert text in error_of(kept(tmp_path, "a.log", f"{line}\n"))


# -- SavvyCAN's GVRET ------------------------------------------------------------------------------

GVRET = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"


def test_gvret(tmp_path: Path) -> None:
    rows = """166064000,0000021A,false,Rx,0,8,FE,36,12,FE,69,05,07,AD,
166064001,1CFE3506,true,Tx,1,2,01,2,

166064002,1CFE3506,true,Tx,1,0,
166064003,0000021A,false,Rx,0,12,FE,36,12,FE,69,05,07,AD,1,2,3,4,
166064004,0000021A,false,Rx,0,65,FE,
"""
    file = LogFile(kept(tmp_path, "a.csv", "\ufeff" + GVRET + rows))
    assert list(file) == [
        TimedFrame(166_064_000_000, "0", 0x21A, False, bytes.fromhex("FE3612FE690507AD")),
        TimedFrame(166_064_001_000, "1", 0x1CFE3506, True, b"\x01\x02"),
        TimedFrame(166_064_002_000, "1", 0x1CFE3506, True, b""),
        TimedFrame(166_064_003_000, "0", 0x21A, False, bytes.fromhex("FE3612FE690507AD01020304")),
    ]
    assert file.left_out == {"impossible": 1}


def test_gvret_without_directions(tmp_path: Path) -> None:
    content = GVRET.replace("Dir,", "") + "5,21A,0,0,1,FE\n"
    assert list(LogFile(kept(tmp_path, "a.csv", content))) == [
        TimedFrame(5000, "0", 0x21A, False, b"\xfe")
    ]


@pytest.mark.parametrize(
    ("row", "text"),
    [
        ("1,21A,false,Rx,0,2,FE,", "a.csv:2: expected all of them, got 1 of 2 bytes"),
        ("1,FFF,false,Rx,0,0,", "got id 0xfff"),
        ("1,xyz,false,Rx,0,0,", "a.csv:2: expected a row of Time Stamp,ID,Extended,Dir,Bus,LEN,D1"),
    ],
)
def test_a_wrong_row_of_gvret(tmp_path: Path, row: str, text: str) -> None:
    assert text in error_of(kept(tmp_path, "a.csv", f"{GVRET}{row}\n"))


# -- Vector's ASC ----------------------------------------------------------------------------------


def test_asc_with_times_from_line_to_line(tmp_path: Path) -> None:
    content = """base hex  timestamps relative
   0.000000 Start of measurement
   0.100000 1  110             Rx   d 1 0A
   0.200000 1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   0.050000 1  110             Rx   d 1 0B
   0.000001 1  110             Rx   d 1 0C
"""
    frames = list(LogFile(kept(tmp_path, "a.asc", content)))
    assert [f.time_ns for f in frames] == [100_000_000, 350_000_000, 350_001_000]


def test_asc_of_two_headers_takes_the_times_that_the_second_names(tmp_path: Path) -> None:
    content = """base hex  timestamps relative
   0.100000 1  110             Rx   d 1 0A
base hex  timestamps absolute
   0.300000 1  110             Rx   d 1 0B
   0.500000 1  110             Rx   d 1 0C
"""
    frames = list(LogFile(kept(tmp_path, "a.asc", content)))
    assert [f.time_ns for f in frames] == [100_000_000, 300_000_000, 500_000_000]


def test_a_remote_frame_on_a_channel_of_fd(tmp_path: Path) -> None:
    content = """base hex  timestamps absolute
   1.0 CANFD   3 Tx     50005x      0 1 5 0 140000 73 200050 7a60 46500250
   1.0 CANFD   3 Tx        110      0 0 0 0 140000 73 200040 7a60 46500250
"""
    file = LogFile(kept(tmp_path, "a.asc", content))
    assert list(file) == [TimedFrame(10**9, "3", 0x110, False, b"")]
    assert file.left_out == {"remote": 1}
