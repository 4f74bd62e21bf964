"""Tables of phones and loggers, right and wrong ones."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from canshaper.commissioning.identification.data import series_of
from canshaper.commissioning.identification.series import Kind
from canshaper.commissioning.identification.table import read_table
from canshaper.commissioning.identification.verdict import identify
from canshaper.errors import IdentificationError
from canshaper.recording.tables import is_table
from canshaper_sim.grapple import Grapple, Sway
from tests.commissioning.identification.machine import driven, period_of, phone

PERIOD = period_of(Grapple().mode5)
SWUNG = driven(30.0, sway=Sway(0.15))

LAYOUTS = {
    "phyphox": (
        '"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)"',
        "{t:.9f},{x:.6e},{y:.6e},{z:.6e}",
    ),
    "phyphox with semicolon and decimal comma": (
        '"Time (s)";"Gyroscope x (rad/s)";"Gyroscope y (rad/s)";"Gyroscope z (rad/s)"',
        "{t:.6f};{x:.9f};{y:.9f};{z:.9f}",
    ),
    "with tabs": (
        "Time (s)\tGyroscope x (rad/s)\tGyroscope y (rad/s)\tGyroscope z (rad/s)",
        "{t:.6f}\t{x:.9f}\t{y:.9f}\t{z:.9f}",
    ),
    "Sensor Logger": (
        "time,seconds_elapsed,z,y,x",
        "16999{t:014.9f},{t:.6f},{z:.6f},{y:.6f},{x:.6f}",
    ),
    "milliseconds by name": (
        "timestamp_ms,gyro_x,gyro_y,gyro_z",
        "{t:.6f}e3,{x:.6f},{y:.6f},{z:.6f}",
    ),
    "nanoseconds without a unit": ("time,gyrX,gyrY,gyrZ", "{t:.6f}e9,{x:.6f},{y:.6f},{z:.6f}"),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_what_apps_write(tmp_path: Path, name: str) -> None:
    """A phone turned by 30 degrees: both columns show the swing, and its direction is found."""
    header, row = LAYOUTS[name]
    file = tmp_path / ("Gyroscope.csv" if name == "Sensor Logger" else "swing.csv")
    phone(file, SWUNG, header=header, row=row)
    if "comma" in name:
        file.write_text(file.read_text().replace(".", ","))
    assert is_table(file)
    series = series_of(read_table(file), None)
    assert series.unit.kind is Kind.RATE
    assert series.time_s[-1] == pytest.approx(30.0, abs=0.05)
    # All of the swing is in the direction that was found: rate amplitude by angle and frequency.
    highest = 0.15 * Grapple().mode5.omega_rad_s
    assert np.abs(series.value).max() == pytest.approx(highest, rel=0.08)
    finding = identify("slew", "", [series])
    assert finding.usable, finding.problems
    assert finding.period_s and finding.damping_ratio
    assert finding.period_s.value == pytest.approx(PERIOD, rel=0.002)
    assert finding.damping_ratio.value == pytest.approx(Grapple().mode5.zeta, rel=0.05)


def test_a_named_column_is_used_as_it_is(tmp_path: Path) -> None:
    table = read_table(phone(tmp_path / "a.csv", SWUNG))
    for name in ("Gyroscope y (rad/s)", "gyroscope Y"):
        series = series_of(table, name)
        assert np.array_equal(series.value, table.columns["Gyroscope y (rad/s)"])


def test_degrees_a_second(tmp_path: Path) -> None:
    text = phone(tmp_path / "a.csv", SWUNG).read_text().replace("rad/s", "deg/s")
    (tmp_path / "a.csv").write_text(text)
    table = read_table(tmp_path / "a.csv")
    series = series_of(table, "Gyroscope x")
    assert series.value[5] == pytest.approx(math.radians(table.columns["Gyroscope x (deg/s)"][5]))


def test_a_round_swing_is_reported(tmp_path: Path) -> None:
    reported = driven(30.0, sway=Sway(0.15, 0.0, 0.0, 0.3))
    series = series_of(read_table(phone(tmp_path / "a.csv", reported)), None)
    assert any("swing it in one direction only" in note for note in series.notes)


Edits = dict[int, Callable[[str], str]]


def edited(tmp_path: Path, edits: Edits) -> Path:
    """The table of a phone, with some lines changed."""
    file = phone(tmp_path / "a.csv", SWUNG)
    lines = file.read_text().splitlines()
    for number, edit in edits.items():
        lines[number] = edit(lines[number])
    file.write_text("\n".join(lines))
    return file


ROWS = range(1, 1501)
EDITS: dict[str, tuple[Edits, int, str]] = {
    "cut off": ({-1: lambda row: row[:-25]}, 1499, ":1501: the last line is cut off and left out"),
    "no numbers": (
        {100: lambda _: "battery low", 300: lambda _: "1.0,,,", 400: lambda row: '"' + row},
        1497,
        ":101: 2 lines are wrong and left out",
    ),
    "beyond any sensor": (
        {100: lambda row: row.rpartition(",")[0] + ",1e308"},
        1499,
        ":101: 1 lines are wrong and left out",
    ),
    "infinite": ({100: lambda row: row.partition(",")[0] + ",inf,-inf,inf"}, 1499, ""),
    "empty column": (dict.fromkeys(ROWS, lambda row: row.rpartition(",")[0] + ","), 1500, ""),
}


@pytest.mark.parametrize("name", EDITS)
def test_what_is_no_number_is_left_out_and_reported(tmp_path: Path, name: str) -> None:
    edits, left, note = EDITS[name]
    file = edited(tmp_path, edits)
    series = series_of(read_table(file), None)
    assert series.notes == ([f"{file}{note}"] if note else [])
    assert len(series.time_s) == left
    assert identify("slew", "", [series]).usable


@pytest.mark.parametrize("number", ["", "nan", "inf", "1e12"])
@pytest.mark.parametrize("at", [2, 700, 1501])
def test_a_line_without_a_time_is_left_out_and_reported(
    tmp_path: Path, at: int, number: str
) -> None:
    file = edited(tmp_path, {at - 1: lambda row: number + "," + row.partition(",")[2]})
    table = read_table(file)
    assert table.notes == [f"{file}:{at}: 1 lines are without a time and left out"]
    assert table.time_s[0] == 0.0
    assert identify("slew", "", [series_of(table, None)]).usable


def test_a_gyroscope_without_a_number(tmp_path: Path) -> None:
    file = edited(tmp_path, dict.fromkeys(ROWS, lambda row: row.partition(",")[0] + ",,,"))
    text = r"a\.csv: expected a number in each line of Gyroscope x"
    with pytest.raises(IdentificationError, match=text):
        series_of(read_table(file), None)


def test_a_clock_that_goes_back(tmp_path: Path) -> None:
    file = edited(tmp_path, {1500: lambda row: f"{row}\n0.0,0,0,0"})
    with pytest.raises(IdentificationError, match=r"a\.csv: .*the time goes back by 30 s"):
        series_of(read_table(file), None)


WRONG = {
    "empty": ("", "expected a table with a header, got no text"),
    "nono header": ("0.0,1.0\n0.1,2.0\n", 'such as "Time (s),Gyroscope x (rad/s)", got numbers'),
    "one column": ("Time (s)\n0.0\n", "at least two columns"),
    "no times": ("x,y\n0.0,1.0\n0.1,2.0\n", "got x, y"),
    "only times": ("time (s),timestamp\n0.0,1.0\n0.1,2.0\n", "got times only"),
    "one line": ("time (s),x\n0.0,1.0\n", "expected 2 lines of numbers or more, got 1"),
    "text": (
        "time (s),x\n" + "\n".join(f"{k},hello" for k in range(100)),
        ":2: expected 2 numbers a line, got 100 lines of 100 without",
    ),
    "dates": (
        "time,x\n" + "\n".join(f"2026-01-01T00:00:{k:02},{k}" for k in range(50)),
        "expected 2 numbers a line, got",
    ),
    "bytes": ("\0\1\2,\0", "expected a table with a header, got no text"),
    "an endless field": (
        "time (s),x\n0.0,1.0\n0.1," + "2" * 140_000,
        ":3: expected a table of numbers, got field larger than field limit (131072)",
    ),
    "an endless header": (
        "a," + "b" * 140_000,
        ":1: expected a table of numbers, got field larger than field limit",
    ),
    "times of no clock": (
        "time (s),x\n" + "1e12,1.0\n" * 50,
        ":2: expected a time in each line of column time (s), got none in 50 of 50",
    ),
    "no unit of time": ("time,x\n0.0,1.0\n1e12,2.0\n", "are no sampling in s, ms"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_tables(tmp_path: Path, name: str) -> None:
    text, message = WRONG[name]
    file = tmp_path / "a.csv"
    file.write_text(text)
    with pytest.raises(IdentificationError) as error:
        read_table(file)
    assert message in str(error.value)
    assert str(file) in str(error.value)


def test_a_column_that_is_not_there(tmp_path: Path) -> None:
    table = read_table(phone(tmp_path / "a.csv", SWUNG))
    with pytest.raises(
        IdentificationError, match=r"expected a column, got 'Gyro w'; there are Gyroscope x"
    ):
        series_of(table, "Gyro w")


@pytest.mark.parametrize(
    "header",
    [
        "Time (s),Acceleration x (m/s^2)",
        "time,accel_x",
        *(f"Time (s),ax ({unit})" for unit in ("g", "mg", "m/s²", "m/s/s")),
    ],
)
def test_an_acceleration_is_refused(tmp_path: Path, header: str) -> None:
    file = tmp_path / "a.csv"
    file.write_text(header + "\n" + "\n".join(f"{0.01 * k},{k % 3}" for k in range(50)))
    with pytest.raises(IdentificationError, match="does not show the swing"):
        series_of(read_table(file), header.partition(",")[2])


def test_no_gyroscope_and_no_name(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("Time (s),p (bar)\n" + "\n".join(f"{0.01 * k},{k % 3}" for k in range(50)))
    with pytest.raises(IdentificationError, match="name the column"):
        series_of(read_table(file), None)


def test_progress(tmp_path: Path) -> None:
    reported: list[float] = []
    file = tmp_path / "a.csv"
    file.write_text("Time (s),x\n" + "".join(f"{0.01 * k:.2f},{k % 7}\n" for k in range(100_000)))
    read_table(file, reported.append)
    assert reported == sorted(reported)
    assert 0.0 < reported[0] < reported[-1] <= 1.0


@pytest.mark.parametrize(
    "header",
    [
        "timestamp,arbitration_id,extended,remote,error,dlc,data",
        "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2",
        "Time Stamp,ID,Extended,Bus,LEN,D1,D2",
        "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;ESI;RTR;DataBytes",
        "CSV CAN data",
    ],
)
def test_a_log_of_frames_is_no_table(tmp_path: Path, header: str) -> None:
    file = tmp_path / "log.csv"
    file.write_text(f"{header}\n")
    assert not is_table(file)
    file.write_text("Time (s),x\n")
    assert is_table(file)
    assert not is_table(tmp_path / "a.log")
