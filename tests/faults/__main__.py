"""Random drives with faults, one again by its seed, or many: ``python -m tests.faults --help``."""

import argparse
import sys
import time
from collections import Counter

from tests.faults.drive import Drive
from tests.faults.judge import Violation


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("seed", type=int, nargs="?", default=0, help="first seed")
    parser.add_argument("--count", type=int, default=1, help="how many seeds from there")
    parser.add_argument("--trace", action="store_true", help="print every frame and the judge")
    parser.add_argument("--stats", action="store_true", help="print what was seen")
    options = parser.parse_args()
    stats: Counter[str] = Counter()
    wrong = 0
    start_s = time.perf_counter()
    for seed in range(options.seed, options.seed + options.count):
        try:
            stats += Drive(seed, trace=print if options.trace else None).run()
        except Violation as violation:
            wrong += 1
            print(violation)
    took_s = time.perf_counter() - start_s
    if options.stats:
        for name, count in sorted(stats.items()):
            print(f"{count:10d}  {name}")
    print(f"{options.count} drives from seed {options.seed}, {wrong} wrong, {took_s:.0f} s")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
