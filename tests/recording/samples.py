"""Foreign sample logs, read by canshaper and by python-can, frame by frame.

    python -m tests.recording.samples FOLDER...

The folders are those of other projects (python-can, SavvyCAN, asammdf, vector_blf); every file in
them with the suffix of a format is read by both. Prints what is not equal, with the reason, and
the sums; status 1 where a log differs, or python-can reads what canshaper refuses without need.
"""

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from decimal import Decimal
from pathlib import Path

import can

from canshaper.errors import LogError
from canshaper.recording.channels import fits
from canshaper.recording.log import FORMATS, LogFile

Row = tuple[int, bool, bytes]
Timed = tuple[Decimal, Row]
KNOWN = {
    "sources/test_CanMessage.asc": "python-can passes over its first frame: no header before it"
}
"""What differs because python-can is wrong: folder and name of the log, and why."""
ROUNDING_S = Decimal("0.000002")
"""python-can's times are floats, of a date exact to less than this."""


def samples(folders: Sequence[Path]) -> Iterator[Path]:
    """Files with the suffix of a format, in the order of their names."""
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            name = path.name.lower().removesuffix(".gz")
            if path.is_file() and Path(name).suffix in FORMATS:
                yield path


def ours(path: Path) -> tuple[list[Timed], str]:
    """Frames of canshaper's reader; and why it ends before the end of the log."""
    rows: list[Timed] = []
    try:
        for frame in LogFile(path):
            row = frame.can_id, frame.extended, frame.data
            rows.append((Decimal(frame.time_ns) / 10**9, row))
    except LogError as error:
        return rows, str(error)
    return rows, ""


def theirs(path: Path) -> tuple[list[Timed], str]:
    """Data frames of python-can's reader; and why it ends before the end of the log."""
    rows: list[Timed] = []
    try:
        with can.LogReader(path) as reader:
            for message in reader:
                if not (message.is_error_frame or message.is_remote_frame):
                    row = message.arbitration_id, message.is_extended_id, bytes(message.data)
                    rows.append((Decimal(message.timestamp), row))
    except Exception as error:  # whatever a foreign reader raises at a foreign file
        return rows, f"{type(error).__name__}: {error}"
    return rows, ""


def compared(path: Path) -> tuple[str, str]:
    """A verdict on one log, and the reason.

    canshaper's reader is stricter on purpose: it leaves out what no bus carries, and ends where the
    log is cut off or its clock is set back, after the same frames.
    """
    mine, refused = ours(path)
    other, failed = theirs(path)
    if failed or not other:
        why = failed or "python-can finds no data frame"
        if mine:
            return "canshaper alone", f"{len(mine)} frames; {why}"
        return "neither reads", f"{why}; canshaper: {refused}"
    if known := KNOWN.get("/".join(path.parts[-2:])):
        return "python-can wrong", known
    possible = [row for row in other if fits(row[1][0], extended=row[1][1])]
    first = first_difference(mine, possible)
    ended = "cut off" in refused or "mixed clocks" in refused
    if first is not None or (len(mine) < len(possible) and not ended):
        at = len(mine) if first is None else first
        one, two = (dict(enumerate(rows)).get(at) for rows in (mine, possible))
        return "different", f"frame {at + 1}: canshaper {one}, python-can {two}; {refused}"
    if refused or len(possible) < len(other):
        left = len(other) - len(possible)
        return "stricter", f"{len(mine)} of {len(other)} frames, {left} impossible; {refused}"
    return "equal", ""


def first_difference(mine: Sequence[Timed], other: Sequence[Timed]) -> int | None:
    """Index of the first frame that is not the same, or comes at another time; None if all are.

    Frames that canshaper has not read are no difference here; those that it alone has are.
    """
    for number, (one_s, one) in enumerate(mine):
        if number == len(other) or one != other[number][1]:
            return number
        passed_s, passed = one_s - mine[0][0], other[number][0] - other[0][0]
        if abs(passed_s - passed) > ROUNDING_S:
            return number
    return None


def main(arguments: Sequence[str]) -> int:
    """Compare all samples in these folders."""
    counts: Counter[str] = Counter()
    for path in samples([Path(one) for one in arguments]):
        verdict, reason = compared(path)
        counts[verdict] += 1
        if verdict != "equal":
            print(f"{verdict}: {path}: {reason}".replace("\n", " ")[:400])
    print(f"{counts.total()} logs: {dict(counts)}")
    return 1 if counts["different"] or not counts else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
