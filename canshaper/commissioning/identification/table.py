"""Logs that are tables of numbers: what phone apps and data loggers write as CSV.

Understood are comma, semicolon and tab, decimal point and comma, a header with units, as phyphox
("Time (s)","Gyroscope x (rad/s)") and Sensor Logger (time,seconds_elapsed,z,y,x) write it.
"""

import csv
import math
import re
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from canshaper.commissioning.identification.series import Array, Unit, unit_of
from canshaper.errors import IdentificationError

_HEADER = re.compile(r"^(.*?)\s*[(\[]\s*([^)\]]*?)\s*[)\]]\s*$")
_TIME = re.compile(r"time|zeit|seconds|timestamp|^t$|uptime", re.IGNORECASE)
_TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
_GYRO = re.compile(r"gyr|rotation.?rate|angular.?(rate|vel)|omega|drehrate", re.IGNORECASE)
_ACCELERATION = re.compile(r"acc|beschl", re.IGNORECASE)
# Time between samples of a phone or a logger, s; shows the unit of times that have none.
_SAMPLING_S = (5e-4, 0.5)
# A table with more wrong lines than one in so many is no table.
_WRONG_LINES = 50
# No sensor has more, in whatever unit, and nanoseconds since 1970 are fewer; squares stay finite.
_LARGEST = 1e30
# The year 2286; no clock is there.
_LATEST_S = 1e10
_REPORT_EVERY = 20_000

Lines = NDArray[np.int64]


@dataclass(frozen=True)
class Table:
    """Columns of numbers over time.

    Attributes:
        path: the file.
        time_s: times from the first line, s; in the order of the file.
        columns: values by the name in the header.
        units: unit of each column, as written; "" where the header has none.
        notes: what was left out.
    """

    path: Path
    time_s: Array
    columns: dict[str, Array]
    units: dict[str, str]
    notes: list[str]

    def unit(self, name: str) -> Unit:
        """Unit of a column; a gyroscope without one is in rad/s, as phones have it.

        Raises:
            IdentificationError: it is an acceleration.
        """
        text = self.units[name]
        where = name if _GYRO.search(name) else f"{self.path.stem} {name}"
        if not text and _GYRO.search(where):
            text = "rad/s"
        if not text and _ACCELERATION.search(where):
            text = "m/s²"
        try:
            return unit_of(text)
        except IdentificationError as error:
            raise IdentificationError(f"{self.path}: column {name} {error}") from None

    def column(self, name: str) -> str:
        """The column of that name, with or without its unit, large or small.

        Raises:
            IdentificationError: there is none; the message lists those that are there.
        """
        lower = name.strip().lower()
        for known in self.columns:
            plain = _named(known)[0].lower()
            if lower in (known.lower(), plain):
                return known
        raise IdentificationError(
            f"{self.path}: expected a column, got {name!r}; there are {', '.join(self.columns)}"
        )

    def gyroscope(self) -> list[str]:
        """Columns of a gyroscope, its absolute value left out."""
        names = [n for n in self.columns if _GYRO.search(n)]
        if not names and _GYRO.search(self.path.stem):
            names = [n for n in self.columns if re.fullmatch(r"[xyz]", n, re.IGNORECASE)]
        return [n for n in names if not re.search(r"abs|magnitude|norm", n, re.IGNORECASE)]


def is_table(path: Path) -> bool:
    """Whether a file is a table of numbers rather than a log of CAN frames.

    Raises:
        OSError: it cannot be read.
    """
    if path.suffix.lower() not in (".csv", ".tsv", ".txt"):
        return False
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        return "arbitration_id" not in file.readline(10_000)


def read_table(path: Path, on_progress: Callable[[float], None] | None = None) -> Table:
    """Read a table.

    Args:
        path: the file.
        on_progress: called with the part that is read, 0 to 1.

    Raises:
        IdentificationError: it is none, has no times, or its clock goes back.
        OSError: it cannot be read.
    """
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        number, names, delimiter = _header(path, file)
        values = [array("d") for _ in names]
        lines = array("q")
        wrong: list[int] = []
        size = max(path.stat().st_size, 1)
        read = 0
        for line, text in enumerate(file, number + 1):
            row = _row(path, line, text, delimiter)
            read += sum(len(f) for f in row) + len(row) + 1
            if on_progress and line % _REPORT_EVERY == 0:
                on_progress(min(1.0, read / size))
            if not row or not any(row):
                continue
            numbers = _numbers(row, delimiter)
            if numbers is None or len(numbers) != len(names):
                wrong.append(line)
                continue
            lines.append(line)
            for column, value in zip(values, numbers, strict=True):
                column.append(value)
    return _table(path, names, [np.array(v) for v in values], np.array(lines), wrong)


def _header(path: Path, file: TextIO) -> tuple[int, list[str], str]:
    """Line number of the header, its names, and the delimiter."""
    for number, line in enumerate(file, 1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        if "\0" in text or "\ufffd" in text:
            break
        delimiter = max("\t;,", key=_outside_quotes(text).count)
        names = [n.strip() for n in _row(path, number, text, delimiter)]
        if len(names) < 2:
            raise IdentificationError(
                f"{path}:{number}: expected a header with the names of at least two columns,"
                f" separated by comma, semicolon or tab, got {text[:60]!r}"
            )
        if _numbers(names, delimiter) is not None:
            raise IdentificationError(
                f"{path}:{number}: expected a header that names the columns, such as"
                ' "Time (s),Gyroscope x (rad/s)", got numbers'
            )
        return number, names, delimiter
    raise IdentificationError(f"{path}: expected a table with a header, got no text")


def _outside_quotes(text: str) -> str:
    return re.sub(r'"[^"]*"', "", text)


def _row(path: Path, number: int, line: str, delimiter: str) -> list[str]:
    """Fields of a line; of one alone, so that a quote left open swallows no others."""
    try:
        return next(csv.reader([line.replace("\0", "")], delimiter=delimiter), [])
    except csv.Error as error:  # a field longer than the reader takes
        text = f"expected a table of numbers, got {error}"
        raise IdentificationError(f"{path}:{number}: {text}") from None


def _numbers(row: list[str], delimiter: str) -> list[float] | None:
    """The numbers of a line, NaN for an empty field; None where something else stands there."""
    if delimiter != ",":
        row = [f.replace(",", ".") for f in row]
    try:
        numbers = [float(f) if f.strip() else math.nan for f in row]
    except ValueError:
        return None
    return None if any(_LARGEST < abs(n) < math.inf for n in numbers) else numbers


def _table(
    path: Path, names: list[str], values: list[Array], lines: Lines, wrong: list[int]
) -> Table:
    count = len(lines)
    notes = []
    if wrong:
        if len(wrong) * _WRONG_LINES > count + _WRONG_LINES:
            raise IdentificationError(
                f"{path}:{wrong[0]}: expected {len(names)} numbers a line, got"
                f" {len(wrong)} lines of {count + len(wrong)} without"
            )
        ending = len(wrong) == 1 and (not count or wrong[0] > lines[-1])
        what = "the last line is cut off and" if ending else f"{len(wrong)} lines are wrong and"
        notes.append(f"{path}:{wrong[0]}: {what} left out")
    if count < 2:
        raise IdentificationError(f"{path}: expected 2 lines of numbers or more, got {count}")
    columns = dict(zip(names, values, strict=True))
    time_name, factor = _time(path, columns)
    time = columns.pop(time_name)
    others = {n: c for n, c in columns.items() if not _TIME.search(n)}
    if not others:
        raise IdentificationError(
            f"{path}: expected a column of values, got times only: {', '.join(names)}"
        )
    good = np.abs(time) * factor <= _LATEST_S  # which NaN is not
    if not good.all():
        place, wrong_times = f"{path}:{lines[~good][0]}", np.count_nonzero(~good)
        if np.count_nonzero(good) < 2:
            text = f"expected a time in each line of column {time_name}"
            raise IdentificationError(f"{place}: {text}, got none in {wrong_times} of {count}")
        notes.append(f"{place}: {wrong_times} lines are without a time and left out")
    time = time[good]
    # Infinite is no number either; two of them would make a warning of a sum.
    others = {n: np.where(np.isfinite(c), c, np.nan)[good] for n, c in others.items()}
    units = {n: _named(n)[1] for n in others}
    return Table(path, (time - time[0]) * factor, others, units, notes)


def _named(header: str) -> tuple[str, str]:
    """Name and unit of "Gyroscope x (rad/s)"."""
    match = _HEADER.match(header)
    return (match[1], match[2]) if match else (header, "")


def _time(path: Path, columns: dict[str, Array]) -> tuple[str, float]:
    """The column of times, and what makes seconds of it."""
    named = [n for n in columns if _TIME.search(n)]
    # One that counts seconds from the start rather than one that counts from 1970.
    named.sort(key=lambda n: (_unit_of_time(n) is None, not re.search("elapsed", n, re.IGNORECASE)))
    for name in named:
        values = columns[name]
        if not np.isfinite(values).any():
            continue
        if (factor := _unit_of_time(name)) is not None:
            return name, factor
        steps = np.diff(values[np.isfinite(values)])
        step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
        for factor in (1.0, 1e-3, 1e-6, 1e-9):
            if _SAMPLING_S[0] <= step * factor <= _SAMPLING_S[1]:
                return name, factor
        raise IdentificationError(
            f'{path}: column {name}: expected a unit in the header, such as "Time (s)", got none,'
            f" and steps of {step:g} are no sampling in s, ms, µs or ns"
        )
    raise IdentificationError(
        f'{path}: expected a column that is called time, such as "Time (s)", got'
        f" {', '.join(columns)}"
    )


def _unit_of_time(name: str) -> float | None:
    plain, unit = _named(name)
    if not unit:
        unit = "s" if re.match("seconds", plain, re.IGNORECASE) else plain.rpartition("_")[2]
    return _TIME_UNITS.get(unit.lower())
