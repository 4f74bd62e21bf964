"""CPU time of ``canshaper identify`` on long logs, next to python-can only reading them.

The log is a drive of both axes with random strokes, hardly ever left alone: the solver has hundreds
of stretches, and some free swings to find between them.

    python benchmarks/identify.py [--lines 100000 1000000]
"""

import argparse
import random
import subprocess
import sys
import tempfile
from pathlib import Path

from measure import cpu_s

from tests.commissioning.identification.machine import FILE, Push, candump, driven

LINES_S = 200.0
READ = "import can, sys\nfor _ in can.LogReader(sys.argv[1]): pass"


def strokes(seconds: float, seed: int) -> list[Push]:
    """Strokes of slew and near-far, one in ten with a longer pause behind it."""
    chance, pushes = random.Random(seed), []
    for axis in ("slew", "near_far"):
        at = 2.0
        while at < seconds - 10.0:
            long, level = (
                chance.uniform(0.3, 3.0),
                chance.choice((-1, 1)) * chance.uniform(0.2, 1.0),
            )
            pushes.append(Push(axis, at, long, level))
            at += long + chance.uniform(0.3, 4.0 if chance.random() < 0.9 else 25.0)
    return pushes


def process_s(*command: object) -> float:
    """Processor time of a process that may have not enough data, s."""

    def run() -> None:
        words = [sys.executable, *map(str, command)]
        done = subprocess.run(words, stdout=subprocess.DEVNULL, check=False)
        if done.returncode not in (0, 1):
            raise SystemExit(done.returncode)

    return cpu_s(run)


def main() -> None:
    """Print a line for each length."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--lines", type=int, nargs="+", default=[100_000])
    for lines in parser.parse_args().lines:
        with tempfile.TemporaryDirectory() as folder:
            log = candump(
                Path(folder) / "drive.log", driven(lines / LINES_S, strokes(lines / LINES_S, 1))
            )
            read = process_s("-c", READ, log)
            ours = process_s("-m", "canshaper", "identify", log, "--file", FILE, "--out", folder)
        print(f"{lines} lines: identify {ours:.1f} s, {ours / read:.1f} x of python-can's reading")


if __name__ == "__main__":
    main()
