"""The daemon, with notes of its ticks or of its memory.

Nothing of the daemon is changed; its loop is handed a body that calls the daemon's own one. With
``ticks``, a file holds at the end one line for each tick: begin, lateness and duration in ns,
deadlines missed before it. With ``blocks``, the log has from time to time a line with the number of
memory blocks that Python has handed out.

    python benchmarks/observed.py ticks FILE DEPLOYMENT [--interface I --channel C]
    python benchmarks/observed.py blocks SECONDS DEPLOYMENT [--interface I --channel C]
"""

import os
import sys
import time
from array import array
from collections.abc import Callable
from pathlib import Path

import canshaper.daemon.daemon as daemon_module
from canshaper.cli.app import main as canshaper

Body = Callable[[int, int, int], bool]

MOST_TICKS = 200_000  # noted in memory that is there from the start


class Ticks:
    """Notes of every tick, written to a file at the end."""

    def __init__(self, file: str) -> None:
        self._file = Path(file)
        self._notes = array("q", bytes(8 * 4 * MOST_TICKS))
        self._end = 0

    def around(self, body: Body) -> Body:
        """The body with two looks at the clock."""
        clock, notes = time.monotonic_ns, self._notes

        def tick(now_ns: int, missed: int, late_ns: int) -> bool:
            more = body(now_ns, missed, late_ns)
            i = self._end
            if i < len(notes):
                notes[i], notes[i + 1], notes[i + 3] = now_ns, late_ns, missed
                notes[i + 2] = clock() - now_ns
                self._end = i + 4
            return more

        return tick

    def write(self) -> None:
        """Write the file."""
        rows = (self._notes[i : i + 4] for i in range(0, self._end, 4))
        self._file.write_text("".join(" ".join(map(str, row)) + "\n" for row in rows))


class Blocks:
    """Lines in the log."""

    def __init__(self, seconds: str) -> None:
        self._every_ns = round(float(seconds) * 1e9)
        self._due_ns = 0

    def around(self, body: Body) -> Body:
        """The body and now and then a line."""

        def tick(now_ns: int, missed: int, late_ns: int) -> bool:
            more = body(now_ns, missed, late_ns)
            if now_ns >= self._due_ns:
                self._due_ns = now_ns + self._every_ns
                os.write(2, b"blocks=%d\n" % sys.getallocatedblocks())
            return more

        return tick

    def write(self) -> None:
        """Nothing is left."""


def main() -> None:
    """Run ``canshaper run`` with the rest of the command line."""
    notes = {"ticks": Ticks, "blocks": Blocks}[sys.argv[1]](sys.argv[2])
    loop = daemon_module.run_at_deadlines
    daemon_module.run_at_deadlines = lambda period_ns, body, *rest: loop(
        period_ns, notes.around(body), *rest
    )
    sys.argv = ["canshaper", "run", *sys.argv[3:]]
    try:
        canshaper()
    finally:
        notes.write()


if __name__ == "__main__":
    main()
