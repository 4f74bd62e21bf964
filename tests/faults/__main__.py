"""Random drives and sequences with faults, one again by its seed, or many.

Without --deployment: drives of the controller, over changed deployments, judged tick by tick.
With it: sequences of the whole daemon on a deployment of config/ as it is shipped, judged by the
rules of docs/safety.md.
"""

import argparse
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator

from tests.faults.drive import Drive
from tests.faults.judge import Violation
from tests.faults.sequence import Sequence
from tests.faults.shipped import MADE, NAMES

# Sequences after which a line says how far it is.
PROGRESS = 500


def run_one(
    name: str | None, seed: int, trace: Callable[[str], None] | None = None
) -> tuple[Counter[str], str]:
    """Drive one sequence; return its counts, and what is wrong with it."""
    try:
        one = Sequence(name, seed, trace=trace) if name else Drive(seed, trace=trace)
        return one.run(), ""
    except Violation as violation:
        return Counter(), str(violation)
    except Exception as error:  # one that ends the daemon is the worst of all
        return Counter(), f"deployment {name}, seed {seed}: {type(error).__name__}: {error}"


def _names(name: str | None) -> list[str | None]:
    return [*NAMES, *MADE] if name == "all" else [name]


def run_many(
    name: str | None, first: int, count: int, jobs: int
) -> Iterator[tuple[Counter[str], str]]:
    """Run many, in so many processes; ``all`` takes the shipped deployments in turn."""
    names = _names(name)
    work = [(names[seed % len(names)], seed) for seed in range(first, first + count)]
    if jobs == 1:
        for one in work:
            yield run_one(*one)
        return
    with multiprocessing.Pool(jobs) as pool:
        yield from pool.imap_unordered(_unpacked, work, chunksize=20)


def _unpacked(one: tuple[str | None, int]) -> tuple[Counter[str], str]:
    return run_one(*one)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("seed", type=int, nargs="?", default=0, help="first seed")
    parser.add_argument("--count", type=int, default=1, help="how many seeds from there")
    parser.add_argument(
        "--deployment", choices=(*NAMES, *MADE, "all"), help="one of config/, or all"
    )
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--trace", action="store_true", help="print every frame and the judge")
    parser.add_argument("--stats", action="store_true", help="print what was seen")
    options = parser.parse_args()
    stats: Counter[str] = Counter()
    wrong = 0
    start_s = time.perf_counter()
    if options.trace:
        for name in _names(options.deployment):
            print(run_one(name, options.seed, print)[1] or "nothing wrong")
        return 0
    runs = run_many(options.deployment, options.seed, options.count, options.jobs)
    for done, (seen, why) in enumerate(runs, 1):
        stats += seen
        if why:
            wrong += 1
            print(why, flush=True)
        if done % PROGRESS == 0:
            took_s = time.perf_counter() - start_s
            print(f"{done} of {options.count}, {wrong} wrong, {took_s:.0f} s", flush=True)
    took_s = time.perf_counter() - start_s
    if options.stats:
        for name, count in sorted(stats.items()):
            print(f"{count:10d}  {name}")
    what = "sequences" if options.deployment else "drives"
    print(f"{options.count} {what} from seed {options.seed}, {wrong} wrong, {took_s:.0f} s")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
