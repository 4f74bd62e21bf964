"""Lines of logs that are text.

candump, ASC and CSV have parsers of our own: python-can's read times as floats, which at today's
date hold a quarter of a microsecond, and let a line that is cut off through as a shorter frame.
Theirs of TRC knows no version 1.2. How long ours take next to them: ``benchmarks/logs.py``.
"""

from collections.abc import Iterator
from functools import partial
from typing import BinaryIO

from canshaper.recording.frames import Place

SECOND_NS = 1_000_000_000
# Far longer than any line of a log; a file without line ends must not fill the memory.
LONGEST_LINE = 65_536
SHOWN = 60


def lines(file: BinaryIO, place: Place, *, last: bool = False) -> Iterator[bytes]:
    """Lines with their end; a last one without is cut off, however good it looks.

    Args:
        file: the log.
        place: where the reader is.
        last: whether the format has no end at its last line.
    """
    for line in iter(partial(file.readline, LONGEST_LINE), b""):
        place.number += 1
        if line[-1] != 10:
            if len(line) == LONGEST_LINE:
                raise place.error(f"{LONGEST_LINE} bytes without a line end", "a log that is text")
            if not last:
                raise place.cut_off(f"no line end after {shown(line)}")
        yield line


def id_text(can_id: int) -> str:
    """An id that is none."""
    return f"id {can_id:#x}"


def shown(line: bytes) -> str:
    """A line as a person reads it, its beginning where it is long."""
    text = line.decode("utf-8", "replace").rstrip()
    return repr(text if len(text) <= SHOWN else text[: SHOWN - 3] + "...")
