"""Logs as people have them: times of another kind, lines of tools, byte order marks."""

import gzip
import random
from itertools import accumulate, pairwise
from pathlib import Path

import pytest

from canshaper.recording.log import LogFile
from tests.recording.lines import error_of

STEPS_US = [0, *(9_900 + 37 * n % 211 for n in range(40)), 1_500_000, 10_000, 9_990, 10_010]
TIMES_NS = [1000 * t for t in accumulate(STEPS_US)]
SCREEN = " (%03d.%06d)  can0  110   [2]  %02X 00\n"
FILE = "(%03d.%06d) can0 110#%02X00\n"


def kept(folder: Path, name: str, content: str | bytes) -> LogFile:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return LogFile(path)


def rows(form: str, times_us: list[int]) -> list[str]:
    return [form % (*divmod(t, 10**6), n) for n, t in enumerate(times_us)]


def times(log: LogFile) -> list[int]:
    return [frame.time_ns for frame in log]


# -- times that are differences --------------------------------------------------------------------


@pytest.mark.parametrize("form", [SCREEN, FILE, FILE.replace("\n", "\r\n")])
@pytest.mark.parametrize("steps", [STEPS_US, [0] + [10_000] * 20, STEPS_US[3:]])
def test_differences_are_summed_up(tmp_path: Path, form: str, steps: list[int]) -> None:
    log = kept(tmp_path, "a.log", "".join(rows(form, steps)))
    assert times(log) == [1000 * t for t in accumulate(steps)]
    assert any("candump -t d" in text for text in log.warnings())


def test_time_also_passes_at_frames_that_are_left_out(tmp_path: Path) -> None:
    lines = rows(FILE, STEPS_US)
    lines[5] = lines[5].replace("110#0500", "20000004#0004000000000000")
    log = kept(tmp_path, "a.log", "".join(lines))
    assert times(log) == TIMES_NS[:5] + TIMES_NS[6:]


@pytest.mark.parametrize("form", [SCREEN, FILE])
def test_times_from_zero_are_none(tmp_path: Path, form: str) -> None:
    log = kept(tmp_path, "a.log", "".join(rows(form, list(accumulate(STEPS_US)))))
    assert times(log) == TIMES_NS
    assert list(log.warnings()) == []


def test_frames_of_two_sockets_are_none(tmp_path: Path) -> None:
    """Each batch of one socket stands behind that of the other, up to 8 ms late."""
    one = [1000 * n + 800 * (n % 10 < 5) for n in range(100)]
    random.Random(5).shuffle(batch := one[40:48])
    log = kept(tmp_path, "a.log", "".join(rows(FILE, [*one[:40], *batch, *one[48:]])))
    assert len(times(log)) == 100
    assert log.disordered > 0
    assert not any("candump -t d" in text for text in log.warnings())


def test_two_logs_in_one_file_are_none(tmp_path: Path) -> None:
    part = list(accumulate([1_000_000] * 10))
    path = tmp_path / "a.log"
    path.write_text("".join(rows(FILE, part + part)))
    assert "mixed clocks" in error_of(path)


GVRET = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"


@pytest.mark.parametrize(
    ("first", "stamps"),
    [
        (0, [-2_000_000, -1_990_000, -1_980_000, 20_000]),
        (2**31 - 5000, [2**31 - 5000, -(2**31) + 5000, -(2**31) + 15_000]),
        (2**32 - 5000, [2**32 - 5000, 5000, 15_000]),
    ],
)
def test_a_clock_of_32_bits(tmp_path: Path, first: int, stamps: list[int]) -> None:
    content = GVRET + "".join(f"{t},00000110,false,Rx,0,1,0A,\n" for t in stamps)
    steps = [(b - a) % 2**32 for a, b in pairwise(stamps)]
    expected = [1000 * (first + t) for t in (0, *accumulate(steps))]
    assert times(kept(tmp_path, "a.csv", content)) == expected


# -- lines of tools --------------------------------------------------------------------------------

ERROR = " (1.000000)  can0  20000004   [8]  00 08 00 00 00 00 60 00   ERRORFRAME\n"
GOOD = " (1.000000)  can0  110   [1]  0A\n"


@pytest.mark.parametrize(
    ("line", "counts"),
    [
        ("\tcontroller-problem{tx-error-warning}\n", {"words about errors": 1}),
        ("\tprotocol-violation{{}{acknowledge-slot}}\n", {"words about errors": 1}),
        ("\tlost-arbitration{at bit 5},error-counter-tx-rx{{8}{0}}\n", {"words about errors": 1}),
        ("\tbus-off\n\trestarted-after-bus-off\r\n", {"words about errors": 2}),
        ("\tno-acknowledgement-on-tx,bus-error\n", {"words about errors": 1}),
        (
            "DROPCOUNT: dropped 12 CAN frames on 'can0' socket (total drops 12)\n"
            "DROPCOUNT: dropped 1 CAN frame on 'can0' socket (total drops 13)\n",
            {"dropped by the logger": 13},
        ),
    ],
)
def test_lines_of_candump_are_counted(tmp_path: Path, line: str, counts: dict[str, int]) -> None:
    log = kept(tmp_path, "a.log", GOOD + ERROR + line + GOOD)
    assert len(list(log)) == 2
    assert log.left_out == {"error": 1, **counts}
    (text,) = log.warnings()
    assert text.startswith("what is no data frame is left out: 1 error, ")


@pytest.mark.parametrize("line", ["\tCan0\n", "read: Network is down\n", "DROPCOUNT: many\n"])
def test_another_line_is_an_error(tmp_path: Path, line: str) -> None:
    kept(tmp_path, "a.log", GOOD + line)
    assert "a.log:2: expected a line of candump -L" in error_of(tmp_path / "a.log")


def test_asc_before_the_start_of_the_measurement(tmp_path: Path) -> None:
    content = """base hex  timestamps absolute
  -0.020000 1  110             Rx   d 1 0A
  -0.010000 CANFD   2 Rx        111  0 0 2  2 01 02   120000  130   0 0 0 0
   0.000000 Start of measurement
   0.010000 1  110             Rx   d 1 0B
"""
    log = kept(tmp_path, "a.asc", content)
    assert [(f.time_ns, f.data) for f in log] == [(10_000_000, b"\x0b")]
    assert log.left_out == {"before the start": 2}


# -- byte order marks ------------------------------------------------------------------------------

TEXTS = {
    "a.log": "(1.000000) can0 110#0A\n(1.010000) can0 110#0B\n",
    "b.log": " (1.000000)  can0  110   [1]  0A\r\n (1.010000)  can0  110   [1]  0B\r\n",
    "a.trc": ";$FILEVERSION=1.1\n     1)      1000.0  Rx     0110  1  0A \n"
    "     2)      1010.0  Rx     0110  1  0B \n",
    "a.asc": "base hex timestamps absolute\n1.0 1 110 Rx d 1 0A\n1.01 1 110 Rx d 1 0B\n",
    "a.csv": GVRET + "1000000,110,false,Rx,0,1,0A,\n1010000,110,false,Rx,0,1,0B,\n",
}


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("name", TEXTS)
def test_every_encoding_gives_the_frames(
    tmp_path: Path, name: str, encoding: str, packed: bool
) -> None:
    content = TEXTS[name].encode(encoding)
    log = (
        kept(tmp_path, f"{name}.gz", gzip.compress(content))
        if packed
        else kept(tmp_path, name, content)
    )
    assert [(f.time_ns, f.data) for f in log] == [(10**9, b"\x0a"), (1_010_000_000, b"\x0b")]


def test_a_text_in_utf_16_that_is_cut_off(tmp_path: Path) -> None:
    log = kept(tmp_path, "a.log", TEXTS["a.log"].encode("utf-16")[:-3])
    assert "a.log:2: the log is cut off" in error_of(tmp_path / "a.log")
    assert next(iter(log)).data == b"\x0a"
