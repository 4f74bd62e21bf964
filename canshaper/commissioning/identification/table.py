"""Logs that are tables of numbers: what phone apps and data loggers write as CSV.

The reader takes comma, semicolon and tab, decimal point and comma, and a header with units, as
phyphox ("Time (s)","Gyroscope x (rad/s)") and Sensor Logger (time,seconds_elapsed,z,y,x) write it.
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

from canshaper.commissioning.identification.series import Array, Unit, unit_of
from canshaper.errors import IdentificationError

_HEADER = re.compile(r"^(.*?)\s*[(\[]\s*([^)\]]*?)\s*[)\]]\s*$")
_TIME = re.compile(r"time|zeit|seconds|timestamp|^t$|uptime", re.IGNORECASE)
_TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
_GYRO = re.compile(r"gyr|rotation.?rate|angular.?(rate|vel)|omega|drehrate", re.IGNORECASE)
_ACCELERATION = re.compile(r"acc|beschl", re.IGNORECASE)
# Least and most time between samples of a phone or a logger, s; shows the unit of bare numbers.
_SAMPLING_S = (5e-4, 0.5)
# A table with more wrong lines than one in so many is no table.
_WRONG_LINES = 50
# More than any sensor has in any unit, and than nanoseconds since 1970; its square is finite.
_LARGEST = 1e30
# Seconds since 1970 in the year 2286: no clock is that late.
_LATEST_S = 1e10
_REPORT_EVERY = 20_000


@dataclass(frozen=True)
class Table:
    """Columns of numbers over time, in the order of the file; time counts from the first line."""

    path: Path
    time_s: Array
    columns: dict[str, Array]  # by the name in the header
    notes: list[str]  # what was left out

    def unit(self, name: str) -> Unit:
        """Return the unit of a column; a gyroscope without one is in rad/s, as phones have it.

        Raises:
            IdentificationError: it is an acceleration.
        """
        text = _named(name)[1]
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
        """Return the column with this name, with or without its unit, in any case.

        Raises:
            IdentificationError: there is none; the message lists those that are there.
        """
        lower = name.strip().lower()
        for known in self.columns:
            if lower in (known.lower(), _named(known)[0].lower()):
                return known
        raise IdentificationError(
            f"{self.path}: expected a column, got {name!r}; there are {', '.join(self.columns)}"
        )

    def gyroscope(self) -> list[str]:
        """Return the columns of a gyroscope, or x, y, z of a file named so; no absolute value."""
        names = [n for n in self.columns if _GYRO.search(n)]
        if not names and _GYRO.search(self.path.stem):
            names = [n for n in self.columns if re.fullmatch(r"[xyz]", n, re.IGNORECASE)]
        return [n for n in names if not re.search(r"abs|magnitude|norm", n, re.IGNORECASE)]


def read_table(path: Path, on_progress: Callable[[float], None] | None = None) -> Table:
    """Read a table; ``on_progress`` is called with the part that is read, 0 to 1.

    Raises:
        IdentificationError: it is none, has no times, or too many wrong lines.
        OSError: it cannot be read.
    """
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        number, names, delimiter = _header(path, file)
        flat = array("d")  # of each line its number and its values
        wrong: list[int] = []
        size, read = max(path.stat().st_size, 1), 0
        for line, text in enumerate(file, number + 1):
            row = _row(path, line, text, delimiter)
            read += len(text)
            if on_progress and line % _REPORT_EVERY == 0:
                on_progress(min(1.0, read / size))
            if not any(row):
                continue
            numbers = _numbers(row, delimiter)
            if numbers is None or len(numbers) != len(names):
                wrong.append(line)
            else:
                flat.extend([line, *numbers])
    lines, *values = np.array(flat).reshape(-1, 1 + len(names)).T
    notes = _left_out(path, len(names), lines, wrong)
    return _with_times(path, dict(zip(names, values, strict=True)), lines, notes)


def _header(path: Path, file: TextIO) -> tuple[int, list[str], str]:
    """Return line number and names of the header, and the delimiter."""
    for number, line in enumerate(file, 1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        if "\0" in text or "\ufffd" in text:
            break
        delimiter = max("\t;,", key=re.sub(r'"[^"]*"', "", text).count)
        names = [n.strip() for n in _row(path, number, text, delimiter)]
        if len(names) < 2:
            what = "a header with the names of at least two columns, separated by comma, semicolon"
            raise IdentificationError(f"{path}:{number}: expected {what} or tab, got {text[:60]!r}")
        if _numbers(names, delimiter) is not None:
            what = 'a header that names the columns, such as "Time (s),Gyroscope x (rad/s)"'
            raise IdentificationError(f"{path}:{number}: expected {what}, got numbers")
        return number, names, delimiter
    raise IdentificationError(f"{path}: expected a table with a header, got no text")


def _row(path: Path, number: int, line: str, delimiter: str) -> list[str]:
    """Return the fields of one line; it is read alone, so that an open quote takes no others."""
    try:
        return next(csv.reader([line.replace("\0", "")], delimiter=delimiter), [])
    except csv.Error as error:  # a field longer than the reader takes
        text = f"expected a table of numbers, got {error}"
        raise IdentificationError(f"{path}:{number}: {text}") from None


def _numbers(row: list[str], delimiter: str) -> list[float] | None:
    """Return the numbers of a line, NaN for an empty field; None where one is none or too large."""
    if delimiter != ",":
        row = [f.replace(",", ".") for f in row]
    try:
        numbers = [float(f) if f.strip() else math.nan for f in row]
    except ValueError:
        return None
    return None if any(_LARGEST < abs(n) < math.inf for n in numbers) else numbers


def _left_out(path: Path, width: int, lines: Array, wrong: list[int]) -> list[str]:
    """Return notes on wrong lines; IdentificationError for more than a few, or no others."""
    count, bad = len(lines), len(wrong)
    if bad * _WRONG_LINES > count + _WRONG_LINES:
        text = f"expected {width} numbers a line, got {bad} lines of {count + bad} without"
        raise IdentificationError(f"{path}:{wrong[0]}: {text}")
    if count < 2:
        raise IdentificationError(f"{path}: expected 2 lines of numbers or more, got {count}")
    if not wrong:
        return []
    ending = bad == 1 and wrong[0] > lines[-1]
    what = "the last line is cut off and" if ending else f"{bad} lines are wrong and"
    return [f"{path}:{wrong[0]}: {what} left out"]


def _with_times(path: Path, columns: dict[str, Array], lines: Array, notes: list[str]) -> Table:
    """Return the table over its column of times, without lines that have no time."""
    name, factor = _time(path, columns)
    # Infinite values are no numbers: the sum of two would warn.
    others = {
        n: np.where(np.isfinite(c), c, np.nan) for n, c in columns.items() if not _TIME.search(n)
    }
    if not others:
        text = f"expected a column of values, got times only: {', '.join(columns)}"
        raise IdentificationError(f"{path}: {text}")
    good = np.abs(columns[name]) * factor <= _LATEST_S  # which NaN is not
    if not good.all():
        place, wrong = f"{path}:{lines[~good][0]:.0f}", np.count_nonzero(~good)
        if len(lines) - wrong < 2:
            text = f"expected a time in each line of column {name}"
            raise IdentificationError(f"{place}: {text}, got none in {wrong} of {len(lines)}")
        notes = [*notes, f"{place}: {wrong} lines are without a time and left out"]
    time = columns[name][good]
    return Table(path, (time - time[0]) * factor, {n: c[good] for n, c in others.items()}, notes)


def _named(header: str) -> tuple[str, str]:
    """Return name and unit of "Gyroscope x (rad/s)"; "" for a header without a unit."""
    match = _HEADER.match(header)
    return (match[1], match[2]) if match else (header, "")


def _time(path: Path, columns: dict[str, Array]) -> tuple[str, float]:
    """Return the column of times, and its unit in seconds."""
    named = [n for n in columns if _TIME.search(n)]
    # A column that counts seconds from the start comes before one that counts from 1970.
    named.sort(key=lambda n: (_unit_of_time(n) is None, not re.search("elapsed", n, re.IGNORECASE)))
    for name in named:
        values = columns[name][np.isfinite(columns[name])]
        if not len(values):
            continue
        if (factor := _unit_of_time(name)) is not None:
            return name, factor
        steps = np.diff(values)
        step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
        for factor in (1.0, 1e-3, 1e-6, 1e-9):
            if _SAMPLING_S[0] <= step * factor <= _SAMPLING_S[1]:
                return name, factor
        raise IdentificationError(
            f'{path}: column {name}: expected a unit in the header, such as "Time (s)", got none,'
            f" and steps of {step:g} are no sampling in s, ms, µs or ns"
        )
    text = f'expected a column that is called time, such as "Time (s)", got {", ".join(columns)}'
    raise IdentificationError(f"{path}: {text}")


def _unit_of_time(name: str) -> float | None:
    plain, unit = _named(name)
    if not unit:
        unit = "s" if re.match("seconds", plain, re.IGNORECASE) else plain.rpartition("_")[2]
    return _TIME_UNITS.get(unit.lower())
