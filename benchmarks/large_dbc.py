"""A deployment with the DBC file of a whole machine, next to cantools loading that file.

``canshaper check`` of the shipped deployment with thousands of messages more in its DBC file, and
cantools alone; each in a process of its own, its start included, in turn.

    python benchmarks/large_dbc.py [--messages 5000] [--runs 3]
"""

import argparse
import statistics
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.hostile.inputs import with_dbc
from tests.hostile.run import run
from tests.machine.large_dbc import large

PEER = """
import re, sys
from pathlib import Path
import cantools
cantools.database.load_file(sys.argv[1], encoding="cp1252")
status = Path("/proc/self/status").read_text(encoding="ascii")
print(int(re.search(r"VmHWM:\\s+(\\d+) kB", status)[1]) // 1024)
"""


def peer(text: str) -> tuple[float, int]:
    """Seconds and MB of cantools alone."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "a.dbc"
        file.write_text(text, encoding="cp1252")
        start = time.monotonic()
        done = subprocess.run(
            [sys.executable, "-c", PEER, str(file)], stdout=subprocess.PIPE, text=True, check=True
        )
        return time.monotonic() - start, int(done.stdout)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--messages", type=int, default=5000)
    parser.add_argument("--runs", type=int, default=3)
    given = parser.parse_args()
    text = large(given.messages)
    runs: dict[str, list[tuple[float, int]]] = {"canshaper check": [], "cantools.load_file": []}
    for _ in range(given.runs):
        ran = run(with_dbc("a.dbc", text))
        if ran.code:
            raise SystemExit(ran.text)
        runs["canshaper check"].append((ran.seconds, ran.peak_mb))
        runs["cantools.load_file"].append(peer(text))
    medians = [statistics.median(s for s, _ in rows) for rows in runs.values()]
    for (what, rows), seconds in zip(runs.items(), medians, strict=True):
        print(f"{what:20} median {seconds:6.2f} s   most {max(mb for _, mb in rows):4} MB")
    print(f"canshaper check / cantools.load_file: {medians[0] / medians[1]:.2f}")


if __name__ == "__main__":
    main()
